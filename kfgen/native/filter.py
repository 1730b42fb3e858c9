"""One compiled filter as a Python object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kfgen.native.arguments import Row, bits_of, numpy_type, row, shaped, unknown
from kfgen.native.header import Header
from kfgen.native.values import Array, Units, Value, value_of
from kfgen.native.views import ModeView, Parameters
from kfgen.spec.types import Sensor, Spec
from kfgen.status import Status

if TYPE_CHECKING:
    from kfgen.logs import Source
    from kfgen.native.run import RunResult


class NativeFilter:
    """A filter's struct and its functions, in physical units and float64.

    predict, update, init, set_* return the status of the C function as an int (see `kfgen.Status`) and never
    raise for what the filter itself refuses. Arguments of a wrong shape raise ValueError, missing or surplus
    ones TypeError, unknown names KeyError. A new object is initialised.
    """

    def __init__(self, spec: Spec, header: Header, ffi: Any, lib: Any) -> None:
        self.spec = spec
        self.name = spec.name
        self.states = tuple(state.name for state in spec.states)
        self.inputs = tuple(each.name for each in spec.inputs)
        self.sensors = {each.name: tuple(c.name for c in each.components) for each in spec.measurements}
        self._sensors: dict[str, Sensor] = {each.name: each for each in spec.measurements}
        self._header = header
        self._ffi = ffi
        self._lib = lib
        self._value: Value = value_of(header)
        self._units = Units(spec, self._value)
        self._kf = ffi.new(f"{spec.name}_t *")
        self._fields = {name for name, _ in ffi.typeof(f"{spec.name}_t").fields}
        self.init()

    # the filter's functions

    def init(self) -> int:
        """Return to the spec's initial state, covariance and parameters."""
        return int(self._function("init")(self._kf))

    def predict(self, u: Row | None = None, dt: float | None = None) -> int:
        """Advance by one step.

        u: the inputs in the spec's order, or a mapping by name; dt in s. Each only, and always, where the
        spec has it.
        """
        arguments: list[Any] = []
        if self._takes("predict", "u", u, "inputs", bool(self.inputs)):
            arguments.append(self._inputs(u))
        if self._takes("predict", "dt", dt, "run-time dt", False):
            assert dt is not None
            raw = self._raw(np.array(float(dt)), self._units.dt)
            arguments.append(None if raw is None else raw.item())
        return self._call("predict", *arguments)

    def update(self, sensor: str, z: Row, u: Row | None = None, mask: int | Sequence[bool] | None = None) -> int:
        """Take a measurement in.

        z: the components in the spec's order, or a mapping by name. u: where h, R or the sensor's noise use
        inputs. mask: for a sensor with `partial: true`, the components to use: a bit mask (bit i is component
        i) or one truth value per component; what z holds elsewhere does not matter.
        """
        components = self.components(sensor)
        function = f"update_{sensor}"
        if mask is not None:
            function += "_masked"
            if not self._header.has(function):
                raise TypeError(f"sensor {sensor!r} takes no mask; it is not `partial: true` in the spec")
        bits = None if mask is None else bits_of(mask, components)
        values = row(z, components, f"z of {sensor!r}")
        if bits is not None:
            values = np.where([bits >> i & 1 for i in range(len(components))], values, 0.0)
        arguments = [self._struct(sensor, self._raw(values, self._units.z[sensor]))]
        if self._takes(function, "u", u, "inputs", bool(self.inputs)):
            arguments.append(self._inputs(u))
        if bits is not None:
            arguments.append(bits)
        return self._call(function, *arguments)

    def set_state(self, x: ArrayLike) -> int:
        """Replace the state [n]; the covariance stays."""
        return self._call("set_state", self._array(shaped(x, (len(self.states),), "x"), self._units.x))

    def set_covariance(self, P: ArrayLike) -> int:
        """Replace the covariance [n, n], of which the upper triangle is read."""
        n = len(self.states)
        return self._call("set_covariance", self._array(shaped(P, (n, n), "P"), self._units.P))

    def set_sqrt_covariance(self, S: ArrayLike) -> int:
        """Replace the lower Cholesky factor of the covariance [n, n] (`covariance: sqrt` only)."""
        n = len(self.states)
        unit = np.broadcast_to(self._units.x[:, None], (n, n))
        return self._call("set_sqrt_covariance", self._array(shaped(S, (n, n), "S"), unit))

    def redraw(self) -> int:
        """Draw the kept sigma points anew (`redraw: false` only)."""
        return int(self._function("redraw")(self._kf) or 0)

    # what it holds

    @property
    def x(self) -> Array:
        """The state [n]."""
        return self._value.to_physical(self._field("x"), self._units.x)

    @property
    def P(self) -> Array:
        """The full covariance [n, n]."""
        return self._get("get_covariance", self._units.P)

    @property
    def sqrt_covariance(self) -> Array:
        """The lower Cholesky factor of the covariance [n, n] (`covariance: sqrt` only)."""
        n = len(self.states)
        return self._get("get_sqrt_covariance", np.broadcast_to(self._units.x[:, None], (n, n)))

    @property
    def nis(self) -> float:
        """The normalised innovation squared of the last update."""
        return self._number("nis")

    @property
    def log_likelihood(self) -> float:
        """That of the last update (`code: {log_likelihood: true}` only)."""
        return self._number("log_likelihood")

    @property
    def gate_count(self) -> dict[str, int]:
        """Rejections in a row, by sensor, of those that are counted."""
        prefix = "gate_count_"
        counts = {n.removeprefix(prefix): getattr(self._kf, n) for n in sorted(self._fields) if n.startswith(prefix)}
        if not counts:
            raise AttributeError(f"filter {self.name} keeps no gate_count; set `code: {{gate_count: true}}`")
        return counts

    @property
    def R(self) -> dict[str, Array]:
        """The adapted measurement covariances [m, m], by sensor (`adapt_R` only)."""
        names = [name for name in self.sensors if self._header.has(f"get_R_{name}")]
        if not names:
            raise AttributeError(f"filter {self.name} keeps no R; it has no `adapt_R`")
        return {name: self._get(f"get_R_{name}", self._units.R[name]) for name in names}

    @property
    def Q(self) -> Array:
        """The adapted process covariance [n, n] (`adapt_Q` only)."""
        return self._get("get_Q", self._units.P)

    @property
    def mu(self) -> Array:
        """The probabilities of the modes [modes] (imm only); may be set, x then follows at the next call."""
        return self._value.to_physical(self._field("mu"), self._units.one)

    @mu.setter
    def mu(self, mu: ArrayLike) -> None:
        values = shaped(mu, (len(self.modes),), "mu")
        raw = self._raw(values, self._units.one)
        if raw is None:
            raise ValueError("mu has to be finite")
        self._kf.mu = raw.tolist()

    @property
    def modes(self) -> tuple[ModeView, ...]:
        """The filters of the modes in the spec's order (imm only)."""
        if self.spec.imm is None:
            raise AttributeError(f"filter {self.name} has no modes; it is no imm")
        return tuple(ModeView(self, mode.name) for mode in self.spec.imm.modes)

    @property
    def parameters(self) -> Parameters:
        """The run-time parameters by name; assigning to one changes the filter."""
        return Parameters(self)

    @property
    def raw(self) -> dict[str, Any]:
        """Every field of the struct as it lies there: copies in the filter's own type, nested by name."""
        fields: dict[str, Any] = self._plain(self._kf[0])
        return fields

    def copy(self) -> NativeFilter:
        """An independent filter in the same state."""
        other = object.__new__(NativeFilter)
        other.__dict__.update(self.__dict__)
        other._kf = self._ffi.new(f"{self.name}_t *", self._kf[0])
        self._ffi.memmove(other._kf, self._kf, self._ffi.sizeof(self._kf[0]))
        return other

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> NativeFilter:
        return self.copy()

    def __bytes__(self) -> bytes:
        """The bytes of the struct: equal before and after a call that was refused."""
        return bytes(self._ffi.buffer(self._kf))

    def run(self, log: Source, progress: Callable[[int, int], None] | None = None) -> RunResult:
        """Run a whole log at C speed, on from the present state; see `kfgen.native.run.run`."""
        from kfgen.native.run import run

        return run(self, log, progress)

    def components(self, sensor: str) -> tuple[str, ...]:
        """The components of a sensor; KeyError names the known sensors."""
        try:
            return self.sensors[sensor]
        except KeyError:
            raise KeyError(unknown("sensor", sensor, self.sensors)) from None

    def __repr__(self) -> str:
        return f"<kfgen filter {self.name}: {len(self.states)} states, {self._header.real}>"

    # across the border

    def _function(self, name: str) -> Any:
        if not self._header.has(name):
            raise AttributeError(f"filter {self.name} has no function {self.name}_{name}")
        return getattr(self._lib, f"{self.name}_{name}")

    def _takes(self, function: str, argument: str, given: object, what: str, surplus: bool) -> bool:
        """Whether the C function takes an argument; TypeError where it is missing, or given to no purpose."""
        takes = self._header.takes(function, argument)
        if takes and given is None:
            raise TypeError(f"{self.name}: {argument}= is missing; the spec has {what}")
        if not takes and given is not None and not surplus:
            raise TypeError(f"{self.name}: {argument}= was given, but {function} takes no {what}")
        return takes

    def _call(self, function: str, *arguments: Any) -> int:
        if any(argument is None for argument in arguments):  # a fixed-point scalar has no NaN to pass on
            return int(Status.NOT_FINITE)
        return int(self._function(function)(self._kf, *arguments))

    def _raw(self, values: Array, unit: Array | float) -> NDArray[Any] | None:
        return self._value.to_raw(values, unit) if self._value.representable(values) else None

    def _array(self, values: Array, unit: Array) -> Any:
        raw = self._raw(values, unit)
        return None if raw is None else self._ffi.new(f"{self.name}_real_t[]", raw.ravel().tolist())

    def _struct(self, name: str, raw: NDArray[Any] | None) -> Any:
        return None if raw is None else self._ffi.new(f"{self.name}_{name}_t *", raw.tolist())

    def _inputs(self, u: Row | None) -> Any:
        assert u is not None
        return self._struct("inputs", self._raw(row(u, self.inputs, "u"), self._units.u))

    def _get(self, function: str, unit: Array) -> Array:
        out = self._ffi.new(f"{self.name}_real_t[]", unit.size)
        self._function(function)(self._kf, out)
        raw = np.frombuffer(self._ffi.buffer(out), dtype=self._value.dtype).reshape(unit.shape)
        return self._value.to_physical(raw, unit)

    def _number(self, field: str) -> float:
        return float(self._value.to_physical(self._field(field), self._units.one))

    def _field(self, name: str) -> NDArray[Any]:
        if name not in self._fields:
            raise AttributeError(f"filter {self.name} has no field {name}")
        return np.asarray(self._plain(getattr(self._kf, name)), dtype=self._value.dtype)

    def _plain(self, data: Any) -> Any:
        """A C value as numpy arrays and numbers; a struct as a dict."""
        if not isinstance(data, self._ffi.CData):
            return data
        kind = self._ffi.typeof(data)
        if kind.kind == "struct":
            return {name: self._plain(getattr(data, name)) for name, _ in kind.fields}
        return np.array(self._ffi.unpack(data, len(data)), dtype=numpy_type(kind.item, self._ffi))
