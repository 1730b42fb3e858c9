"""One compiled filter as a Python object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kfgen.logs import Source
from kfgen.native.arguments import Row, bits_of, row, shaped, unknown
from kfgen.native.run import RunResult, run
from kfgen.native.struct import Struct
from kfgen.native.values import Array
from kfgen.native.views import ModeView, Parameters
from kfgen.spec.types import Spec


class NativeFilter:
    """A filter's struct and its functions, in physical units and float64.

    predict, update, init, set_* return the status of the C function as an int (see `kfgen.Status`) and never
    raise for what the filter itself refuses. Arguments of a wrong shape raise ValueError, missing or surplus
    ones TypeError, unknown names KeyError. A new object is initialised.
    """

    def __init__(self, spec: Spec, struct: Struct) -> None:
        self.spec = spec
        self.struct = struct
        self.name = spec.name
        self.states = tuple(state.name for state in spec.states)
        self.inputs = tuple(each.name for each in spec.inputs)
        self.sensors = {each.name: tuple(c.name for c in each.components) for each in spec.measurements}
        self.own_inputs = {each.name: tuple(i.name for i in each.inputs) for each in spec.measurements}
        self.init()

    # the filter's functions

    def init(self) -> int:
        """Return to the spec's initial state, covariance and parameters."""
        return self.struct.call("init")

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
            raw = self.struct.raw(np.array(float(dt)), self.struct.units.dt)
            arguments.append(None if raw is None else raw.item())
        return self.struct.call("predict", *arguments)

    def update(
        self, sensor: str, z: Row, u: Row | None = None, mask: int | Sequence[bool] | None = None,
        inputs: Row | None = None,
    ) -> int:  # fmt: skip
        """Take a measurement in.

        z: the components in the spec's order, or a mapping by name. u: where h, R or the sensor's noise use
        inputs. mask: for a sensor with `partial: true`, the components to use: a bit mask (bit i is component
        i) or one truth value per component; what z holds elsewhere does not matter. inputs: of a sensor that has
        some of its own, and then always: in the spec's order, or a mapping by name.
        """
        components = self.components(sensor)
        function = f"update_{sensor}"
        if mask is not None:
            function += "_masked"
            if not self.struct.has(function):
                raise TypeError(f"sensor {sensor!r} takes no mask; it is not `partial: true` in the spec")
        bits = None if mask is None else bits_of(mask, components)
        values = row(z, components, f"z of {sensor!r}")
        if bits is not None:
            values = np.where([bits >> i & 1 for i in range(len(components))], values, 0.0)
        units = self.struct.units
        values = np.concatenate([values, self._own(sensor, inputs)])
        values = self.struct.value.near(values, units.z_periods[sensor])
        arguments = [self.struct.record(sensor, values, units.z[sensor])]
        if self._takes(function, "u", u, "inputs", bool(self.inputs)):
            arguments.append(self._inputs(u))
        if bits is not None:
            arguments.append(bits)
        return self.struct.call(function, *arguments)

    def set_state(self, x: ArrayLike) -> int:
        """Replace the state [n]; the covariance stays."""
        new = self.struct.value.near(shaped(x, (len(self.states),), "x"), self.struct.units.x_periods)
        return self.struct.call("set_state", self.struct.array(new, self.struct.units.x))

    def set_covariance(self, P: ArrayLike) -> int:
        """Replace the covariance [n, n] of the n errors of the state, of which the upper triangle is read."""
        n = len(self.spec.errors)
        return self.struct.call("set_covariance", self.struct.array(shaped(P, (n, n), "P"), self.struct.units.P))

    def set_sqrt_covariance(self, S: ArrayLike) -> int:
        """Replace the lower Cholesky factor of the covariance [n, n] (`covariance: sqrt` only)."""
        n = len(self.spec.errors)
        unit = np.broadcast_to(self.struct.units.errors[:, None], (n, n))
        return self.struct.call("set_sqrt_covariance", self.struct.array(shaped(S, (n, n), "S"), unit))

    def redraw(self) -> int:
        """Draw the kept sigma points anew (`redraw: false` only)."""
        return self.struct.call("redraw")

    # what it holds

    @property
    def x(self) -> Array:
        """The state [n]; with what rounding has left of compensated ones."""
        x = self.struct.value.to_physical(self.struct.field("x"), self.struct.units.x)
        if self.struct.compensated:
            x[list(self.struct.compensated)] += self.struct.field("x_rest").astype(np.float64)
        return x

    @property
    def P(self) -> Array:
        """The full covariance [n, n] of the n errors of the state: of a quaternion three."""
        return self.struct.get("get_covariance", self.struct.units.P)

    @property
    def sqrt_covariance(self) -> Array:
        """The lower Cholesky factor of the covariance [n, n] (`covariance: sqrt` only)."""
        n = len(self.spec.errors)
        return self.struct.get("get_sqrt_covariance", np.broadcast_to(self.struct.units.errors[:, None], (n, n)))

    @property
    def outputs(self) -> dict[str, float]:
        """What the spec's `outputs` are at the present estimate; NaN where one is not finite."""
        return self._told(0)

    @property
    def output_std(self) -> dict[str, float]:
        """Their standard deviations, through the Jacobian."""
        return self._told(1)

    def _told(self, which: int) -> dict[str, float]:
        names = [each.name for each in self.spec.outputs]
        if not names:
            raise AttributeError(f"filter {self.name} has no outputs; its spec has none")
        return dict(zip(names, self.struct.outputs(names)[which].tolist(), strict=True))

    @property
    def nis(self) -> float:
        """The normalised innovation squared of the last update."""
        return self.struct.number("nis")

    @property
    def log_likelihood(self) -> float:
        """That of the last update (`code: {log_likelihood: true}` only)."""
        return self.struct.number("log_likelihood")

    @property
    def gate_count(self) -> dict[str, int]:
        """Rejections in a row, by sensor, of those that are counted."""
        prefix = "gate_count_"
        fields = sorted(name for name in self.struct.fields if name.startswith(prefix))
        counts = {name.removeprefix(prefix): getattr(self.struct.data, name) for name in fields}
        if not counts:
            raise AttributeError(f"filter {self.name} keeps no gate_count; set `code: {{gate_count: true}}`")
        return counts

    @property
    def R(self) -> dict[str, Array]:
        """The adapted measurement covariances [m, m], by sensor (`adapt_R` only)."""
        names = [name for name in self.sensors if self.struct.has(f"get_R_{name}")]
        if not names:
            raise AttributeError(f"filter {self.name} keeps no R; it has no `adapt_R`")
        return {name: self.struct.get(f"get_R_{name}", self.struct.units.R[name]) for name in names}

    @property
    def Q(self) -> Array:
        """The adapted process covariance [n, n] (`adapt_Q` only), per second where the spec's is."""
        return self.struct.get("get_Q", self.struct.units.P)

    @property
    def mu(self) -> Array:
        """The probabilities of the modes [modes] (imm only); may be set, x then follows at the next call."""
        return self.struct.value.to_physical(self.struct.field("mu"), self.struct.units.one)

    @mu.setter
    def mu(self, mu: ArrayLike) -> None:
        values = shaped(mu, (len(self.modes),), "mu")
        raw = self.struct.raw(values, self.struct.units.one)
        if raw is None:
            raise ValueError("mu has to be finite")
        self.struct.data.mu = raw.tolist()

    @property
    def modes(self) -> tuple[ModeView, ...]:
        """The filters of the modes in the spec's order (imm only)."""
        if self.spec.imm is None:
            raise AttributeError(f"filter {self.name} has no modes; it is no imm")
        names = [mode.name for mode in self.spec.imm.modes]
        return tuple(ModeView(self.struct, names, place) for place in range(len(names)))

    @property
    def parameters(self) -> Parameters:
        """The run-time parameters by name; assigning to one changes the filter."""
        return Parameters(self.struct)

    @property
    def raw(self) -> dict[str, Any]:
        """Every field of the struct as it lies there: copies in the filter's own type, nested by name."""
        fields: dict[str, Any] = self.struct.plain(self.struct.data[0])
        return fields

    def copy(self) -> NativeFilter:
        """An independent filter in the same state."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.struct = self.struct.copy()
        return other

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> NativeFilter:
        return self.copy()

    def __bytes__(self) -> bytes:
        """The bytes of the struct: equal before and after a call that was refused."""
        return bytes(self.struct)

    def run(self, log: Source, progress: Callable[[int, int], None] | None = None) -> RunResult:
        """Run a whole log at C speed, on from the present state; see `kfgen.native.run.run`."""
        return run(self.struct, self.spec, log, progress)

    def components(self, sensor: str) -> tuple[str, ...]:
        """The components of a sensor; KeyError names the known sensors."""
        try:
            return self.sensors[sensor]
        except KeyError:
            raise KeyError(unknown("sensor", sensor, self.sensors)) from None

    def __repr__(self) -> str:
        return f"<kfgen filter {self.name}: {len(self.states)} states, {self.struct.declared.real}>"

    # arguments

    def _takes(self, function: str, argument: str, given: object, what: str, surplus: bool) -> bool:
        """Whether the C function takes an argument; TypeError where it is missing, or given to no purpose."""
        takes = self.struct.takes(function, argument)
        if takes and given is None:
            raise TypeError(f"{self.name}: {argument}= is missing; the spec has {what}")
        if not takes and given is not None and not surplus:
            raise TypeError(f"{self.name}: {argument}= was given, but {function} takes no {what}")
        return takes

    def _own(self, sensor: str, inputs: Row | None) -> Array:
        """A sensor's own inputs; TypeError where they are missing, or given to no purpose."""
        names = self.own_inputs[sensor]
        if inputs is None:
            if names:
                raise TypeError(f"{self.name}: inputs= is missing; sensor {sensor!r} has {', '.join(names)}")
            return np.empty(0)
        if not names:
            raise TypeError(f"{self.name}: inputs= was given, but sensor {sensor!r} has none of its own")
        return row(inputs, names, f"inputs of {sensor!r}")

    def _inputs(self, u: Row | None) -> Any:
        assert u is not None
        return self.struct.record("inputs", row(u, self.inputs, "u"), self.struct.units.u)
