"""What is to be measured: a filter's files, and the calls of its functions that a log asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kfgen.emit.declarations import Declarations
from kfgen.errors import KfgenError
from kfgen.logs import Log, as_log
from kfgen.native.emitted import Emitted
from kfgen.native.run import plan
from kfgen.native.values import Units, value_of
from kfgen.spec.sensors import readings_of
from kfgen.spec.types import Spec

ROWS = 60
"""Rows of a log that are run if not said otherwise."""
OUTPUTS, TOLD = "get_outputs", ("value", "std")
"""The function that tells the outputs, where there are some, and its arguments."""
BEFORE = 0.01
"""The step in s before a log's first row, which none is known of: so that every row is predicted and updated."""


@dataclass(frozen=True)
class Step:
    """A call of a function, and what its arguments are set to before: variable -> numbers of the scalar type."""

    function: str
    values: Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Job:
    """A filter to be measured.

    functions: those that are called, and whether they count in the filter's flash. variables: the arguments'
    variables, name -> C type. driver: C that declares them and has a function without arguments for each call.
    """

    name: str
    scalar: str
    files: Mapping[str, str]
    functions: Mapping[str, bool]
    variables: Mapping[str, str]
    calls: Mapping[str, str]
    steps: Sequence[Step]
    rows: int

    @property
    def prefix(self) -> str:
        """Of what the driver defines."""
        return f"{self.name}_kfgen_"

    def driver(self) -> str:
        """The C that stands around the filter: global arguments, and a function without arguments for each call."""
        p = self.prefix
        lines = [f'#include "{self.name}.h"', f"{self.name}_t {p}kf;", f"uint32_t {p}status;"]
        lines += [f"{kind} {p}{variable};" for variable, kind in self.variables.items()]
        lines += [f"const uint32_t {p}size = sizeof({self.name}_t);"]
        for function, call in self.calls.items():
            lines += [f"void {p}{function}(void);", f"void {p}{function}(void) {{ {p}status = (uint32_t){call}; }}"]
        return "\n".join(lines) + "\n"


def make_job(emitted: Emitted, log: Log, rows: int = ROWS) -> Job:
    """The first `rows` rows of a log as calls, as `kfgen run` makes them, and a prediction before the first row where
    the step is given at run time. KfgenError for a log that does not fit."""
    spec, declared = emitted.spec, emitted.declarations
    log = as_log(log, spec)
    log = Log({name: column[:rows] for name, column in log.columns.items()}, min(rows, log.rows), log.source)
    functions, sensors = {"predict": True}, {}
    for sensor in spec.measurements:
        for function, counts in ((f"update_{sensor.name}", True), (f"update_{sensor.name}_masked", False)):
            if declared.has(function):
                functions[function], sensors[function] = counts, sensor.name
    if declared.has(OUTPUTS):
        functions[OUTPUTS] = False
    sources = {f"{spec.name}.{ending}": emitted.files[f"{spec.name}.{ending}"] for ending in ("h", "c")}
    calls = {function: _call(declared, function, sensors.get(function, "")) for function in ("init", *functions)}
    return Job(
        spec.name, spec.scalar, sources, functions, _variables(spec, declared, functions), calls,
        _steps(spec, declared, log), log.rows,
    )  # fmt: skip


def _variables(spec: Spec, declared: Declarations, functions: Mapping[str, bool]) -> dict[str, str]:
    taken = {argument for function in functions for argument in declared.functions[function]}
    kinds = {"u": f"{spec.name}_inputs_t", "dt": f"{spec.name}_real_t", "mask": "uint32_t"}
    variables = {name: kind for name, kind in kinds.items() if name in taken}
    variables |= {name: f"{spec.name}_outputs_t" for name in TOLD if OUTPUTS in functions}
    return variables | {f"z_{sensor.name}": f"{spec.name}_{sensor.name}_t" for sensor in spec.measurements}


def _call(declared: Declarations, function: str, sensor: str) -> str:
    """The C expression that calls a function, of a sensor if it is an update."""
    name, arguments = declared.prefix, declared.functions[function]
    p = f"{name}_kfgen_"
    spelled = {"kf": f"&{p}kf", "u": f"&{p}u", "dt": f"{p}dt", "mask": f"{p}mask", "z": f"&{p}z_{sensor}"}
    spelled |= {name: f"&{p}{name}" for name in TOLD}
    if any(argument not in spelled for argument in arguments):
        raise KfgenError(f"{name}_{function} has an argument that is not understood: {', '.join(arguments)}")
    return f"{name}_{function}({', '.join(spelled[a] for a in arguments)})"


def _steps(spec: Spec, declared: Declarations, log: Log) -> list[Step]:
    work = plan(spec, log)
    if spec.dt is not None and spec.dt.run_time and log.rows:
        work.dt[0], work.step[0] = BEFORE, 1
    scalar = value_of(declared)
    units = Units(spec, scalar)
    steps: list[Step] = []
    for row in range(log.rows):
        u = {"u": scalar.to_raw(work.u[row], units.u)} if spec.inputs else {}
        if work.step[row]:
            steps.append(Step("predict", {**u, "dt": scalar.to_raw(work.dt[row : row + 1], units.dt)}))
        for i, (sensor, place) in enumerate(readings_of(spec)):
            bits, full = int(work.mask[row, i]), (1 << len(sensor.components)) - 1
            if bits:
                given = scalar.near(work.z[row, place], units.z_periods[sensor.name])
                z = {f"z_{sensor.name}": scalar.to_raw(given, units.z[sensor.name])}
                if bits == full:
                    steps.append(Step(f"update_{sensor.name}", {**u, **z}))
                else:
                    mask = {"mask": np.array([bits], dtype=np.uint32)}
                    steps.append(Step(f"update_{sensor.name}_masked", {**u, **z, **mask}))
        if declared.has(OUTPUTS):
            steps.append(Step(OUTPUTS, {}))
    return steps
