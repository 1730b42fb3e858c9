"""The emitted text of banks: clean under strict compilers whatever modes, states and sensors are called; what modes
share stands there once, and nothing that none needs.
"""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from functools import cache

import pytest
from banks import DYNAMICS, TOP
from test_emitted_c import COMPILERS, WARNINGS, absent, run, write

from kfgen.generate import generate
from kfgen.native import compile_many
from kfgen.override import override
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.spec.types import Spec
from tests.oracle.imm_banks import bank

# names that other names of modes, sensors and states make, or that the emitted code has for something else
HOSTILE = """
kfgen: 1
name: b
dt: {nominal: 0.1, min: 0.05, max: 0.2}
parameters: {mu: 0.5, modes: 1, D: 0.1}
states:
  x: {init: 0.1, std: 1}
  a: {init: 0.2, std: 1}
  a_b: {init: 0.3, std: 1}
  b_f_c: {init: 0.4, std: 1, kind: angle}
inputs: {P: {}, S: {}}
let: {points: x + 0.1*a, b_finite: sin(b_f_c)}
measurements:
  x: {z: {z: {h: x + 0.1*a_b*x, std: 1}, x: {h: b_f_c, std: 1, kind: angle}}, gate: {probability: 0.9}, partial: true}
  x_x: {z: {a: {h: points + 0.2*a_b, std: 1}}}
  x_c: {z: {a: {h: a + b_finite, std: 0.5}}}
"""
OWN = (
    "measurements:\n"
    "  x: {z: {z: {h: x + a_b*x**2/90, std: 1}, x: {h: b_f_c, std: 1, kind: angle}}, gate: {probability: 0.9}, "
    "partial: true}\n"
    "  x_x: {z: {a: {h: points + 0.2*a_b*a, std: 1}}}\n  x_c: {z: {a: {h: a*cos(x), std: 0.5}}}\n"
)
Q = "Q: {x: mu*0.1, a: 0.1, a_b: 0.2, b_f_c: 0.1}}\n"
MODES = {
    "x": "dynamics: {f: {x: 0.9*x + dt*a, a: 0.9*a + b_finite*0.1}, " + Q + OWN
    + "filter: {type: ukf, covariance: full}",
    "c": "dynamics: {f: {x: 0.8*x - dt*a, a: 0.8*a + D*sin(a)}, " + Q + "filter: {type: ukf}",
    # of the inputs and the step only a noise that the points do not carry knows
    "b_c": "noise: {n: {std: 1}}\ndynamics: {f: {x: 0.9*x + dt*P*modes*n, a: a_b*sin(x)*0.1}, " + Q
    + "filter: {type: ukf, covariance: sqrt}",
    "mu": "dynamics: {f: {x: 0.7*x*modes, a: a_b*0.1 + S/9}, " + Q + "filter: {type: ekf}",
    "modes": "dynamics: {f: {x: 0.7*x, a: 0.1*a_b + P/9}, " + Q.replace("mu*0.1", "0.1")
    + "filter: {type: ekf, covariance: full, adapt_R: 0.1, adapt_Q: 0.1}",
}  # fmt: skip

ROOT = "1.4142135623730951"
STAR = (
    "filter: {type: ukf, covariance: full, sigma_points: {kind: custom, points: [[0, 0], [2, 0], [-2, 0], [0, 1], "
    f"[0, -1], [0, {ROOT}], [0, -{ROOT}]], wm: [0.5, 0.125, 0.125, -0.25, -0.25, 0.375, 0.375], wc: "
)
STARS = """
kfgen: 1
name: b_s
states: {wm: {init: 0, std: 1}, b_s_wm: {init: 1, std: 1}}
measurements: {s: {z: {z: {h: wm*b_s_wm + wm, std: 1}}}}
"""
WEIGHTS = [
    "[0.5, 0.125, 0.125, -0.125, -0.125, 0.3125, 0.3125]}}", "[-0.5, 0.125, 0.125, 0.125, 0.125, 0.1875, 0.1875]}}",
]  # fmt: skip

LONG = "a_name_of_some_thirty_letters"


def long(word: str) -> str:
    return LONG.replace("name", word)


def uniform(size: int) -> list[list[float]]:
    return [[1 / size if size & (size - 1) == 0 else 0.6 if i == j else 0.4 / (size - 1) for j in range(size)]
            for i in range(size)]  # fmt: skip


def specs() -> list[Spec]:
    stars = {name: f"dynamics: {{f: {{wm: 0.9*wm + sin(b_s_wm)/{9 + k}}}, Q: {{wm: 0.1}}}}\n{STAR}{WEIGHTS[k]}"
             for k, name in enumerate("ab")}  # fmt: skip
    longer = f"""
kfgen: 1
name: {LONG}
dt: 0.1
parameters: {{{long("parm")}: 0.1}}
states: {{{long("angl")}: {{init: 0, std: 1, kind: angle}}, {long("rate")}: {{init: 0, std: 1, bounds: [-9, 9]}}}}
measurements:
  {long("sens")}:
    z: {{{long("comp")}: {{h: {long("angl")} + sin({long("rate")}), std: 1, kind: angle}}}}
    gate: {{probability: 0.99, reset_after: 2}}
    partial: true
"""
    f = f'{{{long("angl")}: "{long("angl")} + 0.1*{long("rate")}*cos({long("rate")})"}}'
    every = f"Q: {{{long('angl')}: {long('parm')}, {long('rate')}: 0.1}}"
    modes = {
        long(f"mod{k}"): f"dynamics: {{f: {f}, {every}}}\nfilter: {{{each}}}"
        for k, each in enumerate((
            "type: ukf, sigma_points: {kind: julier, kappa: 1, redraw: false}", "type: ekf, variance_ceiling: 100",
            "type: iekf, covariance: full",
        ))
    }  # fmt: skip
    return [
        loads(bank(HOSTILE, MODES, uniform(5))), loads(bank(STARS, stars, uniform(2))),
        loads(bank(longer, modes, uniform(3))),
        loads(bank(HOSTILE.replace("name: ", "name: looped_", 1) + "code: {unroll: none}\n", MODES, uniform(5))),
    ]  # fmt: skip


def large() -> Spec:
    """Rolled prediction, a prediction without points beside it: no array that nothing reads."""
    states = ", ".join(f"x{i}: {{init: 0, std: 1}}" for i in range(9))
    Q = ", ".join(f"x{i}: 1" for i in range(9))
    top = f"kfgen: 1\nname: large\nstates: {{{states}}}\nmeasurements: {{s: {{z: {{z: {{h: x0 + x5, std: 1}}}}}}}}\n"
    f = ("x0: sin(x1)/2, x3: x4/2", "x0: x1/2")
    forms = ("full", "ud")
    modes = {
        name: f"dynamics: {{f: {{{f[k]}}}, Q: {{{Q}}}}}\nfilter: {{type: ukf, covariance: {forms[k]}}}"
        for k, name in enumerate("ab")
    }
    return loads(bank(top, modes, [[0.9, 0.1], [0.1, 0.9]]))


@cache
def emitted(scalar: str) -> dict[str, str]:
    return {name: text for spec in specs() for name, text in generate(override(spec, scalar)).items()}


@pytest.mark.parametrize("compiler", ["gcc", "clang", "g++"])
def test_clean(compiler, tmp_path):
    if shutil.which(compiler) is None:
        absent(compiler)
    command = [compiler, COMPILERS[compiler], *WARNINGS]
    if compiler == "gcc":  # optimising finds more (what may be used uninitialised), parsing costs less
        run([*command, "-O1", "-c", *write(generate(large()), tmp_path)], tmp_path)
    files = emitted("double" if compiler == "clang" else "float")
    language = ["-x", "c++"] if compiler.endswith("++") else []
    run([*command, "-fsyntax-only", *language, *write(files, tmp_path)], tmp_path)


def test_layout():
    """At most 100 columns, but for words that cannot be broken."""
    wrong = []
    for name, text in emitted("float").items():
        for number, line in enumerate(text.splitlines(), 1):
            if (len(line) > 100 and max(map(len, line.split())) <= 60) or line != line.rstrip():
                wrong.append(f"{name}:{number}: {line}")
    assert not wrong, "\n".join(wrong)


def test_hostile_names_compute_the_right_thing():
    for spec, kf in zip(specs()[:2], compile_many(specs()[:2], "double", flags=["-O0"]), strict=True):
        ref = reference(spec)
        for k in range(12):
            u = {"u": [0.1, -0.1 * k]} if spec.inputs else {}
            dt = {"dt": 0.1} if spec.dt else {}
            assert kf.predict(**u, **dt) == ref.predict(**u, **dt) == 0
            for sensor in spec.measurements:
                z = [0.1 * k, 0.2][: len(sensor.components)]
                assert kf.update(sensor.name, z) == ref.update(sensor.name, z), sensor.name
        assert abs(kf.x - ref.x).max() < 1e-9
        assert abs(kf.P - ref.P).max() < 1e-9
        assert abs(kf.mu - ref.mu).max() < 1e-9


def functions(text: str, kind: str) -> list[str]:
    return re.findall(rf"^static void \w+?_({kind}\w*)\(", text, re.MULTILINE)


def test_modes_share_what_is_the_same():
    """One f for modes of the same dynamics, one h for a common sensor; what differs is called by its mode."""
    modes = {
        "a": DYNAMICS[0], "b": f"{DYNAMICS[0]}\nfilter: {{type: ukf, covariance: full}}", "c": DYNAMICS[2],
    }  # fmt: skip
    text = bank(TOP + "filter: {type: ukf}\n", modes, uniform(3))
    source = generate(replace(loads(text), name="same"))["same.c"]
    assert sorted(functions(source, "f")) == ["f_a", "f_c"]
    assert functions(source, "h_place") == ["h_place"]
    assert functions(source, "see_place") == ["see_place"]
    assert generate(replace(loads(text), name="same"))["same.c"] == source


def test_what_folds_away():
    """A chain that never switches needs no mixing: each mode reads its own estimate and no other's."""
    text = bank(TOP, {"a": f"{DYNAMICS[0]}\nfilter: {{type: ekf}}", "b": f"{DYNAMICS[1]}\nfilter: {{type: ekf}}"},
                [[1, 0], [0, 1]])  # fmt: skip
    source = generate(replace(loads(text), name="apart"))["apart.c"]
    predict = source[source.index("apart_predict(") : source.index("apart_update_place(")]
    assert "where it starts from" not in predict
    assert "exp" not in predict
    # mu stays what it is but for its sum
    assert len(re.findall(r"kf->mu\[APART_MODE_A\] =", predict)) <= 1
