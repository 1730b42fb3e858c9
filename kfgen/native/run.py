"""A whole log through a compiled filter at C speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kfgen.late import ages
from kfgen.logs import Log, Source, as_log, held
from kfgen.native.struct import Struct
from kfgen.native.values import Array
from kfgen.spec.constants import value
from kfgen.spec.sensors import columns_of, readings_of
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status

CHUNK = 1 << 15
"""Rows per call of the C driver: long enough to cost nothing, short enough for a progress bar and Ctrl-C."""


@dataclass(frozen=True)
class RunResult:
    """What a run gives, one entry per row of the log.

    t: [N] s, of the log, or step * dt. x: [N, n]. var: [N, n], the covariance's diagonal. nis: sensor -> [N],
    NaN where that sensor was not updated or its update failed. status: [N] uint32, the bits of all calls of
    the row. calls: function -> [N] uint32, its own status (0 where it was not called). mu: [N, modes] for an
    imm, else None. outputs, output_std: name -> [N], what the spec's `outputs` are after the row, and their standard
    deviations; NaN where the filter refuses to tell them. age: sensor -> [N], how many predictions late its reading
    was, where the filter has a history. P: [N, n, n], the whole covariance, where it was asked for. log_likelihood:
    sensor -> [N], NaN as in nis and where the update was gated, where the spec keeps it.
    """

    t: Array
    x: Array
    var: Array
    nis: Mapping[str, Array]
    status: NDArray[np.uint32]
    calls: Mapping[str, NDArray[np.uint32]]
    mu: Array | None = None
    outputs: Mapping[str, Array] = field(default_factory=dict)
    output_std: Mapping[str, Array] = field(default_factory=dict)
    age: Mapping[str, NDArray[np.uint32]] = field(default_factory=dict)
    P: Array | None = None
    log_likelihood: Mapping[str, Array] | None = None

    def late(self) -> dict[str, tuple[int, float, int]]:
        """Of sensors whose readings came late: how many did, how many predictions on average, and at most; without
        those that were too old."""
        found = {}
        for sensor, age in self.age.items():
            taken = age[(age > 0) & ~np.isnan(self.nis[sensor])]
            if taken.size:
                found[sensor] = int(taken.size), float(taken.mean()), int(taken.max())
        return found

    def counts(self, errors: bool = True) -> dict[str, dict[Status, int]]:
        """How often each function returned each error (or warning) bit; functions without are left out."""
        flags = [flag for flag in Status if flag and (flag >= ERROR) == errors]
        found: dict[str, dict[Status, int]] = {}
        for function, status in self.calls.items():
            number = {flag: int(np.count_nonzero(status & flag.value)) for flag in flags}
            number = {flag: n for flag, n in number.items() if n}
            if number:
                found[function] = number
        return found

    @property
    def failed(self) -> bool:
        """Whether there were updates, and each of them returned an error."""
        updates = [status for function, status in self.calls.items() if function != "predict"]
        any_error = any(bool((status >= ERROR).any()) for status in updates)
        return any_error and all(bool(np.isnan(nis).all()) for nis in self.nis.values())


@dataclass(frozen=True)
class Plan:
    """What is to be done in each row; float64, physical.

    step: [N] whether to predict. dt: [N] s. u: [N, nu]. mask: [N, sensors] bits of the components to use, 0
    for no update. z: [N, components and own inputs of all sensors], 0 where there is none. t: [N] s. age: [N, sensors]
    how many predictions ago a reading was made, where the filter has a history.
    """

    t: Array
    step: NDArray[np.uint8]
    dt: Array
    u: Array
    mask: NDArray[np.uint32]
    z: Array
    age: NDArray[np.uint32]


def plan(spec: Spec, log: Log, dt: float = 0.0) -> Plan:
    """The rows of a log as calls of a filter.

    Per row: predict, then the updates in the spec's order. Run-time dt: t minus the t of the row before; no
    predict in the first row and where t is equal. Fixed dt (`dt` gives it in s for `t`): one predict per row, none
    where there is a t and it is that of the row before.
    A sensor is updated where all its components are there, and its own inputs with them; with `partial: true` the
    components that are there are used, otherwise a half-filled row of a sensor is no measurement. An empty input
    keeps the value of the row before; an input that is empty in the first row is a KfgenError.
    """
    rows, columns = log.rows, log.columns
    run_time = spec.dt is not None and spec.dt.run_time
    if run_time:
        t = columns["t"]
        difference = np.diff(t, prepend=t[:1])
        step = difference != 0
    else:
        t = columns["t"] if "t" in columns else np.arange(1.0, rows + 1) * (dt or 1.0)
        difference, step = np.zeros(rows), np.ones(rows, dtype=bool)
        if "t" in columns and spec.dt is not None:
            step[1:] = np.diff(t) != 0
    u = np.empty((rows, len(spec.inputs)))
    for i, each in enumerate(spec.inputs):
        u[:, i] = held(columns[each.name], each.name, log.source)
    mask = np.zeros((rows, len(spec.measurements)), dtype=np.uint32)
    values: list[Array] = []
    absent = np.full(rows, np.nan)
    for i, sensor in enumerate(spec.measurements):
        z = np.column_stack([columns.get(name, absent) for name in columns_of(sensor)])
        m = len(sensor.components)
        bits = (~np.isnan(z[:, :m])) @ (1 << np.arange(m))
        full = (1 << m) - 1
        mask[:, i] = bits if sensor.partial else np.where(bits == full, full, 0)
        mask[np.isnan(z[:, m:]).any(axis=1), i] = 0
        values.append(np.where(np.isnan(z), 0.0, z))
    steps, z = step.astype(np.uint8), np.hstack(values) if values else np.empty((rows, 0))
    age = np.zeros_like(mask) if spec.history is None else ages(spec, log, t, steps)
    return Plan(t, steps, difference, u, mask, z, age)


def run(struct: Struct, spec: Spec, source: Source, progress: Callable[[int, int], None] | None = None) -> RunResult:
    """Run the filter of a struct over a log (a path, a mapping of columns, or a Log), on from its present state.

    See `plan` for what is done in a row. The filter's errors are in the result, none is raised. `progress` is
    called with (rows done, rows) now and then. KfgenError for a log that does not fit the spec.
    """
    return follow(struct, spec, plan(spec, as_log(source, spec), fixed_step(spec)), progress)


def follow(
    struct: Struct,
    spec: Spec,
    work: Plan,
    progress: Callable[[int, int], None] | None = None,
    whole: bool = False,
) -> RunResult:
    """The same of calls that are planned already. whole: with the covariance of each row."""
    rows, n, sensors = len(work.t), len(spec.states), len(spec.measurements)
    errors = len(spec.errors)
    modes = len(spec.imm.modes) if spec.imm else 0
    scalar, units = struct.value, struct.units

    arrays: dict[str, NDArray[Any]] = {
        "step": work.step,
        "dt": scalar.to_raw(work.dt, units.dt),
        "u": scalar.to_raw(work.u, units.u),
        "mask": work.mask.copy(),
        "age": work.age if struct.has_past else np.zeros_like(work.age),
        "z": scalar.to_raw(scalar.near(work.z, units.reading_periods), units.readings),
        "x": np.zeros((rows, n), scalar.dtype),
        "rest": np.zeros((rows, len(struct.compensated)), scalar.dtype),
        "var": np.zeros((rows, errors), scalar.dtype),
        "cov": np.zeros((rows if whole else 0, errors * errors), scalar.dtype),
        "nis": np.zeros((rows, sensors), scalar.dtype),
        "ll": np.zeros((rows, sensors), scalar.dtype),
        "mu": np.zeros((rows, modes), scalar.dtype),
        "out": np.zeros((rows, len(spec.outputs)), scalar.dtype),
        "deviation": np.zeros((rows, len(spec.outputs)), scalar.dtype),
        "told": np.zeros(rows, np.uint8),
        "status": np.zeros((rows, sensors + 1), np.uint32),
    }
    if not scalar.representable(np.concatenate([work.u.ravel(), work.z.ravel(), work.dt])):
        _refuse(work, arrays, spec)
    _call(struct, arrays, rows, progress)

    nis = scalar.to_physical(arrays["nis"], units.one)
    status: NDArray[np.uint32] = arrays["status"]
    updated = (arrays["mask"] != 0) & (status[:, 1:] < ERROR)
    accepted = updated & (status[:, 1:] & Status.GATED.value == 0)
    ll = scalar.to_physical(arrays["ll"], units.one)
    functions = ["predict", *(f"update_{name}" for name in units.z)]
    x = scalar.to_physical(arrays["x"], units.x)
    x[:, list(struct.compensated)] += arrays["rest"].astype(np.float64)
    told: dict[str, dict[str, Array]] = {}
    for kind in ("out", "deviation"):
        numbers = np.where(arrays["told"][:, None] != 0, scalar.to_physical(arrays[kind], units.outputs), np.nan)
        told[kind] = dict(zip((each.name for each in spec.outputs), numbers.T, strict=True))
    return RunResult(
        t=work.t,
        x=x,
        var=scalar.to_physical(arrays["var"], np.diag(units.P))
        if struct.has("get_covariance")
        else np.full((rows, errors), np.nan),
        nis={name: np.where(updated[:, i], nis[:, i], np.nan) for i, name in enumerate(units.z)},
        status=np.bitwise_or.reduce(status, axis=1),
        calls={function: status[:, i] for i, function in enumerate(functions)},
        mu=scalar.to_physical(arrays["mu"], units.one) if modes else None,
        outputs=told["out"],
        output_std=told["deviation"],
        age={name: work.age[:, i] for i, name in enumerate(units.z)} if struct.has_past else {},
        P=scalar.to_physical(arrays["cov"].reshape(rows, errors, errors), units.P) if whole else None,
        log_likelihood={name: np.where(accepted[:, i], ll[:, i], np.nan) for i, name in enumerate(units.z)}
        if spec.code.log_likelihood
        else None,
    )


def _call(
    struct: Struct,
    arrays: Mapping[str, NDArray[Any]],
    rows: int,
    progress: Callable[[int, int], None] | None,
) -> None:
    ffi, function = struct.ffi, getattr(struct.lib, f"{struct.name}_kfgen_run")
    types = dict.fromkeys(("step", "told"), "uint8_t *")
    types |= dict.fromkeys(("mask", "age", "status"), "uint32_t *")
    contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    for first in range(0, rows, CHUNK):
        count = min(CHUNK, rows - first)
        pointers = [
            ffi.from_buffer(types.get(name, f"{struct.name}_real_t *"), array[first : first + count])
            if array.size
            else ffi.NULL
            for name, array in contiguous.items()
        ]
        function(struct.whole, count, *pointers)
        if progress:
            progress(first + count, rows)


def _refuse(work: Plan, arrays: Mapping[str, NDArray[Any]], spec: Spec) -> None:
    """Fixed point cannot carry NaN and infinity: answer calls with them here, as floating point would."""
    status = arrays["status"]
    wrong = ~np.isfinite(np.column_stack([work.u, work.dt])).all(axis=1) & (work.step != 0)
    status[wrong, 0] = Status.NOT_FINITE
    arrays["step"][wrong] = 0
    for i, (_, place) in enumerate(readings_of(spec)):
        wrong = ~np.isfinite(work.z[:, place]).all(axis=1)
        status[wrong, i + 1] = Status.NOT_FINITE
        arrays["mask"][wrong, i] = 0


def fixed_step(spec: Spec) -> float:
    """A fixed dt in s, 0 without one."""
    if spec.dt is None or spec.dt.run_time:
        return 0.0
    return float(value(spec.dt.nominal.tree, spec))
