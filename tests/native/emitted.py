"""What the tests of the emitted C share: specs that use every feature, the four forms, libraries of all of them.

EXACT holds specs whose programs use only operations that IEEE 754 defines to the last bit; LIBM those that call
sin, exp and the like, whose last bits are the platform's.
"""

from __future__ import annotations

import fcntl
import importlib.util
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from kfgen.filters.base import FilterCode
from kfgen.generate import Generated, build
from kfgen.ir.interpret import Memory
from kfgen.ir.interpret import run as interpret
from kfgen.native import NativeFilter, load_filters
from kfgen.override import override
from kfgen.scalars import SCALARS as TYPES
from kfgen.spec import loads
from kfgen.spec.types import Spec
from kfgen.status import Status

FORMS = {
    "ud-bierman": {"covariance": "ud", "update": "bierman"},
    "ud-joseph": {"covariance": "ud", "update": "joseph"},
    "full-joseph": {"covariance": "full", "update": "joseph"},
    "full-standard": {"covariance": "full", "update": "standard"},
}
SCALARS = ("float", "double")


def _problems() -> ModuleType:
    """The standard problems, which stand beside the tests of the reference."""
    path = Path(__file__).resolve().parents[1] / "oracle" / "problems.py"
    found = importlib.util.spec_from_file_location("standard_problems", path)
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


problems = _problems()

SWITCHES = """
kfgen: 1
name: switches
dt: 0.125
parameters: {gain: 0.5, rough: {value: 0.3, unit: m, range: [0, 9], doc: scales the noise of the range}}
states:
  a: {init: 0.5, std: 1, bounds: [-2, 2]}
  b: {init: -0.25, std: 0.5}
  th: {init: 3, std: 0.5, unit: rad, kind: angle}
  lap: {init: 1, std: 0.5, kind: {periodic: 5}}
inputs: {push: {unit: N}, turn: {unit: rad/s}}
let:
  drag: where(b > 0 and a < 1 or not (b >= -1), 0.25*b, 0.5*b)
  curve: "table(a, [-1, 0, 0.5, 2], [0.5, 0, 0.25, -1])"
dynamics:
  form: discrete
  f:
    a: a + dt*(b - curve)
    b: b + dt*(gain*push - drag) + 0.01*sign(a)*abs(b)
    th: th + dt*turn + 0.125*max(a, b)
    lap: lap + dt*(1 + min(a, 0.5)) + 0.03125*(floor(4*t) - 4*t)
  Q: {a: 0.01 + 0.01*b**2, b: rough**2*dt, th: 0.01, lap: "0.01*max(gain, 0.25)"}
measurements:
  range:
    z:
      r: {h: "a + table(b, [-2, 0, 2], [1, 0, 3])", var: "rough**2 + 0.01*a**2"}
      s: {h: b - a**2/4, std: 0.5}
    gate: {probability: 0.95}
  course:
    z:
      th: {h: th + 0.125*a, std: 0.25, unit: rad, kind: angle}
      lap: {h: lap, std: 0.25, kind: {periodic: 5}}
  push:
    z:
      p: {h: "a*push - b*abs(turn)"}
      q: {h: b, residual: "(z - h)/(1 + 0.01*t)"}
    R: [[0.5, "0.125*gain"], ["0.125*gain", 0.25 + 0.01*push**2]]
filter: {type: ekf}
"""

RUN_TIME = """
kfgen: 1
name: run_time
dt: {nominal: 0.1, min: 0.02, max: 0.25}
parameters: {stiff: 0.5}
states:
  p: {init: 0.5, std: 0.5, unit: m}
  v: {init: 0, std: 0.5, unit: m/s}
  c: {init: 0.1, std: 0.1}
inputs: {force: {unit: N}}
noise:
  nf: {std: 0.2}
  nc: {density: 0.0001}
let: {spring: stiff*p + 0.25*p**3}
dynamics:
  form: continuous
  f: {p: v, v: (force + nf)*(1 + c) - spring - 0.3*v + 0.01*t/(1 + t), c: -c/8 + nc}
  integrator: rk4
  substeps: 2
  Q: {p: 1e-4*dt, v: 1e-3*dt**2}
measurements:
  place:
    z:
      x: {h: p + 0.01*t, std: 0.1, unit: m}
    gate: {probability: 0.99}
  both:
    z:
      p: {h: p*(1 + e2)}
      v: {h: v + c*e1, std: 0.1}
    noise: {e1: {std: 0.25}, e2: {std: 0.125}}
filter: {type: ekf}
"""

FREE_STEP = """
kfgen: 1
name: free_step
dt: {nominal: 0.1}
states:
  p: {init: 0, var: 4}
  v: {init: 0, var: 4}
  w: {init: 0.5, var: 1, kind: {periodic: 3}}
initialize: {from: fix, states: {p: x, w: w}}
dynamics:
  form: continuous
  f: {p: v, v: -p/4, w: v/8}
  integrator: midpoint
  Q: {v: 0.01*dt, w: 0.001*dt}
measurements:
  speed:
    z: {v: {h: v, std: 0.5}}
  fix:
    z:
      x: {h: p, std: 0.5}
      w: {h: w, std: 0.25, kind: {periodic: 3}}
filter: {type: ekf}
"""

SEMIDEFINITE = """
kfgen: 1
name: semidefinite
states:
  a: {init: 1}
  b: {init: 2}
  c: {init: 0}
  k: {init: 0.5}
P0: [[1, 0.5, 0, 0], [0.5, 0.25, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
parameters: {q: {value: 0.01}}
noise: {n1: {}, n2: {}}
noise_covariance: [[q, q/2], [q/2, q]]
dynamics:
  form: discrete
  f: {a: 0.75*a + n1, b: 0.5*b + 0.25*a + 2*n2 + n1, c: c + 0.5*a*k}
  Q: [[0.25, 0.125, 0, 0], [0.125, 0.5, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
measurements:
  exact:
    z:
      one: {h: a, std: 0}
      two: {h: a, std: 0}
      sum: {h: a + b, var: 0.25}
      sum_again: {h: a + b, var: 0.25}
  norm:
    z:
      n: {h: "sqrt(a**2 + b**2 + c**2)", std: 0.25}
      w: {h: "a*c + b**(-2)*c", var: q}
    gate: {probability: 0.999}
filter: {type: ekf}
"""

CONFINED = """
kfgen: 1
name: confined
dt: 0.5
states:
  p: {init: 0, std: 1}
  v: {init: 0, std: 1}
  b: {init: 0, std: 0.1, bounds: [-0.25, 0.5]}
dynamics:
  form: continuous
  f: {p: v + b, v: -0.1*v}
  integrator: euler
  Q: {v: 0.01}
measurements:
  place:
    z: {p: {h: p, std: 0.05}}
filter: {type: ekf, variance_floor: {p: 0.01, b: 0.002}, variance_ceiling: {v: 0.25, p: 1.5}}
"""

FUNCTIONS = """
kfgen: 1
name: functions
dt: 0.1
parameters: {power: 1.5}
states:
  a: {init: 0.25, std: 0.1}
  b: {init: 0.5, std: 0.1}
  c: {init: 1.5, std: 0.1}
inputs: {u1: {}}
dynamics:
  form: discrete
  f:
    a: 0.9*a + 0.02*sin(b) + 0.01*tan(a/4) + 0.01*tanh(c) + 0.01*u1
    b: 0.9*b + 0.02*cos(a) + 0.01*asin(a/4) + 0.01*acos(b/4) + 0.01*atan(c)
    c: 0.5*c + 0.2*exp(-a**2) + 0.1*log(2 + c**2) + 0.1*sinh(b/4) + 0.05*cosh(a) + 0.02*(1 + c**2)**power
  Q: {a: 0.001, b: 0.001, c: "0.001*exp(-b)"}
measurements:
  mix:
    z:
      angle: {h: "atan2(a, c)", std: 0.05, kind: angle, unit: rad}
      root: {h: "sqrt(1 + a**2)**3 + hypot(b, c)", std: 0.1}
filter: {type: ekf}
"""

EXACT = {
    **{name: problems.ALL[name] for name in ("cv4", "ball", "chain4", "six_sensors")},
    "switches": SWITCHES, "run_time": RUN_TIME, "free_step": FREE_STEP, "semidefinite": SEMIDEFINITE,
    "confined": CONFINED,
}  # fmt: skip
LARGE = {name: problems.ALL[name] for name in ("chain8", "att")}  # exact as well
LIBM = {
    **{name: problems.ALL[name] for name in ("vehicle4", "radar")},
    "noise_inputs": problems.NOISE_INPUTS, "functions": FUNCTIONS,
}  # fmt: skip
CHAIN16 = {"chain16": problems.ALL["chain16"]}
GROUPS = {"exact": EXACT, "large": LARGE, "libm": LIBM, "chain16": CHAIN16}
ALL = {**EXACT, **LARGE, **LIBM, **CHAIN16}
# rounding as written: what the bit-for-bit tests need. -O1 and -O0 where -O2 takes long; the exact ones are compiled
# with -O2 in the default form only, since no level may change a bit of what only adds, multiplies and divides
FLAGS = {
    "exact": ("-O2", "-ffp-contract=off"),
    "libm": ("-O2", "-ffp-contract=off"),
    "large": ("-O1", "-ffp-contract=off"),
    "chain16": ("-O0", "-ffp-contract=off"),
}


@cache
def spec_of(name: str, form: str, scalar: str) -> Spec:
    """A spec in a form; its own name says which, so that many meet in one library."""
    spec = override(loads(ALL[name]), scalar, filter=FORMS[form])
    return replace(spec, name=f"{name}_{scalar[0]}")


@cache
def generated(name: str, form: str, scalar: str) -> Generated:
    return build(spec_of(name, form, scalar))


@cache
def _library(group: str, form: str, scalar: str, cache_folder: str, compiler: str) -> dict[str, NativeFilter]:
    names = list(GROUPS[group])
    made = [generated(name, form, scalar) for name in names]
    flags = FLAGS["large"] if group == "exact" and form != "ud-bierman" else FLAGS[group]
    with locked(f"{group}-{form}-{scalar}-{compiler}"):
        filters = load_filters(made, flags=flags)
    return dict(zip(names, filters, strict=True))


def library(group: str, form: str, scalar: str) -> dict[str, NativeFilter]:
    """All filters of a group, initialised, compiled with FLAGS; new objects at every call."""
    where = os.environ.get("XDG_CACHE_HOME", ""), os.environ.get("CC", "")
    filters = {name: kf.copy() for name, kf in _library(group, form, scalar, *where).items()}
    for kf in filters.values():
        kf.init()
    return filters


def compiled(name: str, form: str, scalar: str) -> NativeFilter:
    group = next(group for group, specs in GROUPS.items() if name in specs)
    return library(group, form, scalar)[name]


@contextmanager
def locked(name: str) -> Iterator[None]:
    """Test workers share the compiler's cache: the second one waits for the first instead of doing the same."""
    folder = Path(os.environ.get("XDG_CACHE_HOME") or tempfile.gettempdir())
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{name}.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@cache
def _type(scalar: str) -> Any:
    """A scalar type that rounds each constant once only."""
    quick = copy(TYPES[scalar])
    slow, known = quick.convert, {}

    def convert(value: Any) -> Any:
        if not isinstance(value, Fraction):
            return slow(value)
        if value not in known:
            known[value] = slow(value)
        return known[value]

    quick.convert = convert
    return quick


class Program:
    """A filter as its scheduled program, run on the numpy numbers of its scalar type."""

    def __init__(self, code: FilterCode) -> None:
        self.code = code
        self.spec = code.model.spec
        self.type = _type(self.spec.scalar)
        self.functions = {function.name: function for function in code.functions}
        self.memory = Memory()
        for name, values in code.constants.items():
            self.memory.arrays[f"{self.spec.name}_{name}"] = list(values)
        for block in code.blocks:
            if block.size is not None:
                self.memory.arrays[f"kf.{block.name}"] = [None] * block.size
        self.run("init")

    def run(self, function: str, **arguments: Any) -> int:
        """A function with its u, z, mask, dt, x or P; its status."""
        names = {"u": [i.name for i in self.spec.inputs]}
        for sensor in self.spec.measurements:
            if function in (f"update_{sensor.name}", f"update_{sensor.name}_masked"):
                names["z"] = [component.name for component in sensor.components]
        for key, value in arguments.items():
            if key in names:
                for name, each in zip(names[key], value, strict=True):
                    self.memory.numbers[f"{key}.{name}"] = self.number(each)
            elif key == "mask":
                self.memory.numbers[key] = int(value)
            elif np.ndim(value):
                self.memory.arrays[key] = [self.number(each) for each in np.ravel(value)]
            else:
                self.memory.numbers[key] = self.number(value)
        flags = interpret(self.functions[function], self.type, self.memory)
        return int(sum(Status[flag] for flag in flags))

    def number(self, value: float) -> Any:
        with np.errstate(over="ignore"):
            return self.type.convert(value)

    @property
    def x(self) -> np.ndarray:
        return np.array(self.memory.arrays["kf.x"], dtype=np.float64)

    @property
    def P(self) -> np.ndarray:
        n = len(self.spec.states)
        self.memory.arrays["P"] = [None] * (n * n)
        self.run("get_covariance")
        return np.array(self.memory.arrays["P"], dtype=np.float64).reshape(n, n)
