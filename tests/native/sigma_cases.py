"""What the tests of unscented filters share: the four forms, models that use one feature each, and what they are
told along a run.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
from variants import readings

from kfgen.native import NativeFilter
from kfgen.override import override
from kfgen.spec import loads
from kfgen.spec.types import Spec

FORMS = {
    "full": "covariance: full",
    "ud": "covariance: ud",
    "sequential": "covariance: ud, sequential: true",
    "sqrt": "covariance: sqrt",
}
WHOLE = ("full", "ud", "sqrt")
CODE = "code: {log_likelihood: true, gate_count: true}"

# an oscillator whose limit cycle draws tracks together, so that rounding does not grow
CYCLE = """
kfgen: 1
name: cycle
scalar: double
dt: 0.1
parameters: {limit: 2.25}
states:
  x: {init: 1.5, std: 0.3}
  y: {init: 0.2, std: 0.2}
covariances: [[x, y, 0.02]]
dynamics:
  form: discrete
  f: {x: x + dt*y, y: y + dt*(y*(1 - x**2) - x)}
  Q: {x: 1e-4, y: 0.01}
measurements:
  fix:
    z: {a: {h: x + 0.1*y**2, std: 0.2}, b: {h: x*y/4 + y, std: 0.3}}
    gate: {probability: 0.999, reset_after: 1}
filter: {type: ukf}
"""

# at x beyond the limit there is no root: not on the track, but for some of its points
EDGE = CYCLE.replace("init: 1.5", "init: 1.9").replace("(1 - x**2) - x)}", "(1 - x**2) - x) + 0.01*sqrt(limit - x)}")

# its integrator has four stages; it is damped
PENDULUM = """
kfgen: 1
name: pendulum
scalar: double
dt: 0.05
parameters: {length: 1}
states:
  th: {init: 0.4, std: 0.3, unit: rad}
  om: {init: 0.5, std: 0.4, unit: rad/s}
inputs: {torque: {}}
dynamics:
  form: continuous
  f: {th: om, om: -9.81/length*sin(th) - om + torque}
  integrator: rk4
  Q: {th: 1e-4, om: 1e-3}
measurements:
  tip:
    z:
      x: {h: length*sin(th)}
      y: {h: -length*cos(th)}
    R: [[0.02, 0.005], [0.005, "0.01 + 0.001*om**2"]]
filter: {type: ukf}
"""
STEADY_R = PENDULUM.replace('"0.01 + 0.001*om**2"', "0.01")

# noises that multiply states on both sides, those of the process correlated; masks
MULTIPLIED = PENDULUM.replace("filter:", "    partial: true\nfilter:").replace(
    "dynamics:", "noise: {wd: {}, wl: {}}\nnoise_covariance: [[0.04, 0.01], [0.01, 0.02]]\ndynamics:"
).replace("- om +", "- (1 + wd)*om + 0.3*wl +").replace(
    "length*sin(th)}\n", "length*sin(th)*(1 + e1) + 0.5*e2}\n"
).replace("    partial", "    noise: {e1: {std: 0.1}, e2: {std: 0.05}}\n    partial")  # fmt: skip

# angles that cross pi in the state and in the measurement, a component with a residual of its own
HEADING = """
kfgen: 1
name: heading
scalar: double
dt: 0.1
parameters: {k: 1}
states:
  th: {init: 3.1, std: 0.2, unit: rad, kind: angle}
  om: {init: 0.5, std: 0.3, unit: rad/s}
  d: {init: 179, std: 5, kind: {periodic: 360}}
dynamics:
  form: discrete
  f: {th: "atan2(sin(th + dt*om), cos(th + dt*om))", d: d + 3*om}
  Q: {th: 1e-4, om: 1e-4, d: 0.1}
measurements:
  compass:
    z:
      a: {h: th, std: 0.1, unit: rad, kind: angle}
      b: {h: "atan2(sin(th), cos(th))", std: 0.1, residual: "k*atan2(sin(z - h), cos(z - h))"}
      c: {h: d + 360*floor(th), std: 1, kind: {periodic: 360}}
filter: {type: ukf}
"""

# the roots of points that would be negative
TANK = """
kfgen: 1
name: tank
scalar: double
dt: 0.1
states:
  x: {init: 1, var: 0.5, bounds: [0, 5]}
  y: {init: 0, var: 0.2}
dynamics:
  form: discrete
  f: {x: x - 0.3*sqrt(x) + 0.1*y**2, y: 0.8*y + 0.1*sqrt(x)}
  Q: {x: 0.02, y: 0.02}
measurements:
  level:
    z: {z: {h: sqrt(x) + y, std: 0.1}}
    gate: {probability: 0.99, reset_after: 1}
filter: {type: ukf}
"""

KINDS = {
    "merwe": "",
    "merwe-0.1": "{kind: merwe, alpha: 0.1, beta: 2, kappa: 1}",
    "merwe-1e-3": "{kind: merwe, alpha: 1e-3}",
    "julier": "{kind: julier}",
    "julier-1": "{kind: julier, kappa: 1}",
    "julier-minus": "{kind: julier, kappa: -1}",
    "wiki": "{kind: wiki, alpha: 0.7, beta: 2}",
    "trivial": "{kind: trivial}",
    "cubature": "{kind: cubature}",
}
ROOT = "1.4142135623730951"
_STAR = (
    f"{{kind: custom, points: [[0, 0], [2, 0], [-2, 0], [0, 1], [0, -1], [0, {ROOT}], [0, -{ROOT}]], "
    "wm: [0.5, 0.125, 0.125, -0.25, -0.25, 0.375, 0.375], wc: "
)
CUSTOM = {
    # of two states; second moments are those of the covariance
    "custom-centre": _STAR + "[-0.5, 0.125, 0.125, 0.125, 0.125, 0.1875, 0.1875]}",
    "custom-negative": _STAR + "[0.5, 0.125, 0.125, -0.125, -0.125, 0.3125, 0.3125]}",
    "custom-triangle": f"{{kind: custom, points: [[{ROOT}, 0], [-0.7071067811865476, 1.224744871391589], "
    "[-0.7071067811865476, -1.224744871391589]], wm: [1/3, 1/3, 1/3], wc: [1/3, 1/3, 1/3]}",
}


def points(kind: str, redraw: bool = True) -> str:
    """The option for sigma points of a kind."""
    text = {**KINDS, **CUSTOM}[kind]
    if not redraw:
        text = f"{text[:-1]}, redraw: false}}" if text else "{redraw: false}"
    return f"sigma_points: {text}" if text else ""


def join(*options: str) -> str:
    return ", ".join(option for option in options if option)


@cache
def _loaded(text: str, options: str, code: str) -> Spec:
    changed, count = re.subn(
        r"^filter: .*$", f"filter: {{{join('type: ukf', options)}}}\n{code}", text, flags=re.MULTILINE
    )
    assert count == 1
    return loads(changed)


def unscented(text: str, form: str, options: str = "", scalar: str = "double", code: str = CODE) -> Spec:
    """The spec of a model with an unscented filter in one of FORMS."""
    return override(_loaded(text, join(FORMS[form], options), code), scalar)


@cache
def told(text: str, steps: int, jump: float = 0.0) -> list[tuple[str, dict[str, Any]]]:
    """Calls along a track of the model: (`predict`, arguments), (sensor, arguments); see variants.readings.

    Of nine updates three in a row are off by `jump`, to either side.
    """
    out, count = [], 0
    for name, arguments in readings(text, steps, 1, glitches=0):
        if name != "predict":
            count += 1
            if count % 9 in (5, 6, 7):
                z = arguments["z"]
                arguments = {**arguments, "z": z + jump * np.resize([1, -1], len(z)) * (-1) ** (count // 9)}
        out.append((name, arguments))
    return out


def put_back(kf: NativeFilter, good: NativeFilter) -> None:
    """Every byte of the struct."""
    kf.struct.ffi.memmove(kf.struct.data, good.struct.data, len(bytes(good)))
