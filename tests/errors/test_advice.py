"""Advice: each kind where it is due, and silence on models that are as they should be."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import kfgen
from kfgen.advice import advise
from kfgen.generate import build
from kfgen.override import override
from kfgen.spec import load, loads
from kfgen.spec.schema import ADVICE
from kfgen.spec.types import Spec
from tests.oracle import problems

BASE = """kfgen: 1
name: cart
dt: 0.1
states:
  p: {init: 0, std: 1, unit: m}
  v: {init: 0, std: 1, unit: m/s}
dynamics: {f: {p: p + dt*v, v: 0.98*v}, Q: {v: 0.01}}
measurements: {pos: {z: {p: {h: p, std: 0.3}}}}
filter: {type: ekf}
"""


def told(spec: Spec) -> list[str]:
    return [str(each) for each in advise(spec)]


def changed(*pairs: tuple[str, str], base: str = BASE) -> Spec:
    for old, new in pairs:
        assert old in base, old
        base = base.replace(old, new, 1)
    return loads(base, "f")


ANGLE = BASE.replace("v: {init: 0, std: 1, unit: m/s}", "v: {init: 0, std: 1}\n  a: {init: 0, std: 0.2, kind: angle}")
ANGLE = ANGLE.replace("v: 0.01}", "v: 0.01, a: 1e-4}")
ANGLE = ANGLE.replace("std: 0.3}", "std: 0.3}, a: {h: a, std: 0.02, kind: angle}")
UKF = ANGLE.replace("type: ekf", "type: ukf, sigma_points: {kind: merwe, alpha: 0.9}")
BENT = ("0.98*v}", "0.98*v, a: a + 0.1*sin(a)}")
INPUT = ("dynamics:", "inputs: {u: {unit: m/s^2}}\ndynamics:")
BIAS = [("m/s}\n", "m/s}\n  b: {init: 0, std: 1}\n"), ("h: p,", "h: p + b,")]

DUE = [
    # names
    ([("dt: 0.1", "constants: {c: 1}\ndt: 0.1")], "unused", "constants.c: nothing uses the constant `c`"),
    ([("dt: 0.1", "constants: {c: 1, d: c}\ndt: 0.1")], "unused", "constants.d: nothing uses the constant `d`"),
    ([("dt: 0.1", "parameters: {c: {value: 1}}\ndt: 0.1")], "unused", "nothing uses the parameter `c`"),
    ([INPUT], "unused", "inputs.u: nothing uses the input `u`"),
    ([("dynamics:", "let: {w2: v*v}\ndynamics:")], "unused", "nothing uses the definition `w2`"),
    ([("dynamics:", "noise: {w: {std: 1}}\ndynamics:")], "unused_noise", "noise.w: the noise `w` does not stand in"),
    ([("z: {p:", "noise: {e1: {std: 1}}, z: {p:")], "unused_noise", "stands in no h of `pos`"),
    # noise
    ([(", Q: {v: 0.01}", "")], "no_process_noise", "dynamics: no process noise acts"),
    ([("Q: {v: 0.01}", "Q: {v: 0*dt}")], "no_process_noise", "no process noise acts"),
    ([(", Q: {v: 0.01}}", "}\nnoise: {w: {std: 0}}"), ("0.98*v", "0.98*v + w")], "no_process_noise",
     "no process noise"),
    # what no sensor sees
    (BIAS, "unobservable", "no sensor tells `p`, `b` apart"),
    ([BIAS[0], ("v: 0.01}", "v: 0.01, b: 1}")], "unobservable", "no sensor sees `b`"),
    ([("h: p,", "h: v,")], "unobservable", "states.p: no sensor sees `p`"),
    ([*BIAS, ("type: ekf", "type: ukf")], "unobservable", "no sensor tells `p`, `b` apart"),
    ([*BIAS, ("{f:", "{form: continuous, integrator: exact, f:"), ("p + dt*v", "v")], "unobservable", "`p`, `b`"),
    # values
    ([("init: 0, std: 1, unit: m}", "init: 9, std: 1, range: [-5, 5]}")], "init_range", "states.p.init: init 9 lies"),
    ([("dt: 0.1", "parameters: {c: {value: 3, range: [0, 1]}}\ndt: 0.1"), ("0.98*v", "c*v/4")], "init_range",
     "the value 3 lies outside its range [0, 1]"),
    ([("std: 0.3", "std: 0.3**2")], "std_variance", "measurements.pos.z.p.std: `0.3**2` looks like a variance"),
    ([("dt: 0.1", "constants: {varp: 2}\ndt: 0.1"), ("std: 0.3", "std: varp")], "std_variance", "write `var`"),
    ([("dt: 0.1", "constants: {s: 2}\ndt: 0.1"), ("std: 1, unit: m}", "std: s*s}")], "std_variance", "states.p.std"),
    ([("dt: 0.1", "constants: {sigma_p: 2}\ndt: 0.1"), ("std: 0.3", "var: sigma_p")], "std_variance", "write `std`"),
    # degrees
    ([INPUT, ("m/s^2", "deg"), ("0.98*v", "0.98*v + sin(u)")], "degrees", "`sin` of `u`, whose unit is degrees"),
    ([INPUT, ("m/s^2", "deg/s"), ("dynamics:", "let: {c: cos(dt*u)}\ndynamics:"), ("0.98*v", "0.98*v*c")], "degrees",
     "let.c: `cos` of `u`"),
    ([("h: p, std: 0.3", 'h: "atan2(p, v + 9)", std: 0.3, unit: deg')], "degrees", "`atan2` gives rad"),
    # float
    ([("init: 0, std: 1, unit: m}", "init: 6.4e6, std: 1, unit: m}")], "far_origin",
     "states.p: float resolves `p` to 0.5"),
    ([("std: 0.3", "std: 1e-5"), ("type: ekf", "type: ekf, covariance: full")], "precision",
     "`covariance: full` keeps"),
    # a wide start, which robust updates take for a glitch
    ([("std: 0.3", "std: 0.1"), ("type: ekf", "type: ekf, robust: huber")], "robust_start",
     "measurements.pos.z.p.std: the first innovation is expected at 10 deviations of R"),
]  # fmt: skip


@pytest.mark.parametrize(("pairs", "name", "text"), DUE)
def test_advice_that_is_due(pairs: list[tuple[str, str]], name: str, text: str) -> None:
    spec = changed(*pairs)
    lines = [line for line in told(spec) if line.endswith(f"[{name}]")]
    assert len(lines) == 1, told(spec)
    assert text in lines[0]
    assert re.match(r"f:\d+:\d+: warning: [\w.]+: .+; .+ \[\w+\]\Z", lines[0])
    others = [line for line in told(spec) if not line.endswith(f"[{name}]")]
    assert others == []
    silent = changed(*pairs, ("kfgen: 1\n", f"kfgen: 1\nadvice: [{name}]\n"))
    assert told(silent) == []


@pytest.mark.parametrize(
    ("base", "pairs", "name", "text"),
    [
        (ANGLE, [("init: 0, std: 0.2", "init: 90, std: 0.2")], "degrees", "states.a.init: the angle 90 rad is"),
        (ANGLE, [("init: 0, std: 0.2", "init: 0, std: 15")], "degrees", "the standard deviation 15 rad"),
        (ANGLE, [("std: 0.02", "std: 5")], "degrees", "more than half a turn: degrees?"),
        (ANGLE, [("kind: angle}\n", "kind: angle, range: [-180, 180]}\n")], "degrees", "[-180, 180]"),
        (UKF, [("init: 0, std: 0.2", "init: 0, std: 2.5"), BENT], "sigma_angle",
         "states.a.std: the sigma points of `a` lie 4.1 from"),
        (UKF, [("0.98*v}", "0.98*v, a: \"5*p + atan2(v, 3)\"}")], "sigma_angle", "dynamics.f.a: the sigma points"),
        (UKF, [("{h: a,", "{h: a + 5*p + 0.1*sin(a),")], "sigma_angle",
         "measurements.pos.z.a.h: the sigma points seen as `a` lie"),
        (UKF.replace("kind: angle", "kind: {periodic: 1}"), [("init: 0, std: 0.2", "init: 0, std: 0.3"), BENT],
         "sigma_angle", "more than half a turn (0.5)"),
        (UKF, [("alpha: 0.9", "alpha: 0.01")], "alpha", "filter.sigma_points.alpha: alpha below 0.05"),
    ],
)
def test_advice_on_angles(base: str, pairs: list[tuple[str, str]], name: str, text: str) -> None:
    lines = told(changed(*pairs, base=base))
    assert len(lines) == 1, lines
    assert text in lines[0]
    assert lines[0].endswith(f"[{name}]")
    assert told(changed(*pairs, ("kfgen: 1\n", f"kfgen: 1\nadvice: [{name}]\n"), base=base)) == []


SENSIBLE = {
    "cart": [],
    "ukf": [("type: ekf", "type: ukf")],
    "double, far": [("init: 0, std: 1, unit: m}", "init: 6.4e6, std: 1}"), ("name:", "scalar: double\nname:")],
    "ud, wide": [("std: 0.3", "std: 1e-2"), ("std: 1, unit: m}", "std: 1e2}")],
    "constant with noise": [("p: p + dt*v, v: 0.98*v", "v: v"), ("Q: {v", "Q: {p: 1e-4, v"), ("h: p,", "h: p + v*t,")],
    "slow bias": [*BIAS, ("0.98*v", "0.98*v, b: 0.999*b"), ("v: 0.01}", "v: 0.01, b: 1e-4}")],
    "a bias that is not estimated": [*BIAS, ("type: ekf", "type: ekf, update: joseph, consider: [b]")],
    "a bias that is known": [*BIAS, ("b: {init: 0, std: 1}", "b: {init: 2, std: 0}")],
    "two sensors": [*BIAS, ("measurements: {", "measurements: {cal: {z: {b: {h: b, std: 1}}}, ")],
    "degrees that are converted": [INPUT, ("m/s^2", "deg"), ("0.98*v", "0.98*v + sin(u*pi/180)")],
    "degrees by a number": [INPUT, ("m/s^2", "deg"), ("0.98*v", "0.98*v + sin(0.0174533*u)")],
    "degrees by a constant": [INPUT, ("m/s^2", "deg"), ("0.98*v", "0.98*v + sin(u*d2r)"),
                              ("dt: 0.1", "constants: {d2r: pi/180}\ndt: 0.1")],
    "a product": [("dt: 0.1", "constants: {a: 2, b: 3}\ndt: 0.1"), ("std: 0.3", "std: a*b/20")],
    "a range": [("std: 1, unit: m}", "std: 1, range: [0, 10]}")],
    "floor": [(", Q: {v: 0.01}", ""), ("type: ekf", "type: ekf, variance_floor: 1e-3")],
    "parameter noise": [("dt: 0.1", "parameters: {q: 0}\ndt: 0.1"), ("v: 0.01", "v: q")],
    "let in noise": [("dynamics:", "let: {s: w*2}\nnoise: {w: {std: 1}}\ndynamics:"), ("0.98*v", "0.98*v + s")],
    "gate, partial": [("z: {p:", "partial: true, gate: {probability: 0.99}, z: {p:")],
    "robust, known": [("type: ekf", "type: ekf, robust: huber")],
    "robust, initialized": [("std: 0.3", "std: 0.1"), ("type: ekf", "type: ekf, robust: chernodarov"),
                            ("dt: 0.1", "initialize: {from: pos, states: {p: p}}\ndt: 0.1")],
    "robust elsewhere": [("type: ekf", "type: ekf, robust: huber"), ("z: {p:", "robust: none, z: {p:"),
                         ("std: 0.3", "std: 0.1")],
    "run-time dt": [("dt: 0.1", "dt: {nominal: 0.1, min: 0.01, max: 1}")],
}  # fmt: skip


@pytest.mark.parametrize("name", SENSIBLE)
def test_no_advice_on_sensible_models(name: str) -> None:
    assert told(changed(*SENSIBLE[name])) == []


CHAIN = """kfgen: 1
name: chain
dt: {dt}
states: {{{states}}}
dynamics: {{f: {{{f}}}, Q: {{x{last}: 1e-4}}}}
measurements: {{m: {{z: {{z: {{h: x0, std: 0.1}}}}}}}}
filter: {{type: kf}}
"""


@pytest.mark.parametrize("n", [2, 4, 6, 8])
@pytest.mark.parametrize("dt", [0.001, 0.1, 2])
def test_a_chain_of_integrators_is_seen(n: int, dt: float) -> None:
    states = ", ".join(f"x{i}: {{init: 0, std: 1}}" for i in range(n))
    f = ", ".join(f"x{i}: x{i} + dt*x{i + 1}" for i in range(n - 1))
    lines = told(loads(CHAIN.format(dt=dt, states=states, f=f, last=n - 1)))
    assert [line for line in lines if "unobservable" in line] == []


@pytest.mark.parametrize("path", sorted(Path("specs").glob("*.yaml")), ids=lambda path: path.stem)
def test_no_advice_on_the_examples(path: Path) -> None:
    assert told(load(path)) == []


@pytest.mark.parametrize("text", [problems.cv4() if callable(getattr(problems, "cv4", None)) else problems.CV4,
                                  problems.VEHICLE4, problems.IMM3, problems.ATT, problems.RADAR,
                                  problems.NOISE_INPUTS, problems.chain(8), problems.chain(16)],
                         ids=lambda text: re.search(r"name: (\w+)", text)[1])  # fmt: skip
def test_no_advice_on_the_problems(text: str) -> None:
    assert told(loads(text)) == []


SENSIBLE_FILES = sorted(Path(__file__).with_name("sensible").glob("*.yaml"))


@pytest.mark.parametrize("path", SENSIBLE_FILES, ids=lambda path: path.stem)
def test_no_advice_on_what_engineers_write(path: Path) -> None:
    assert told(load(path)) == []


def test_modes_see_together() -> None:
    """What one mode does not use, another does."""
    bank = BASE.split("dynamics:")[0] + "measurements: {pos: {z: {p: {h: p, std: 0.3}}}}\nimm:\n  modes:\n"
    bank += "    still: {dynamics: {f: {}, Q: {p: 1e-4}}, filter: {type: kf}}\n"
    moving = "    moving: {dynamics: {f: {p: p + dt*v}, Q: {v: 0.1}}, filter: {type: kf}}\n"
    rest = "  transition: [[0.9, 0.1], [0.1, 0.9]]\n"
    assert told(loads(bank + moving + rest)) == []
    blind = moving.replace("p: p + dt*v", "p: 0.9*p")
    assert [line.rpartition("[")[2] for line in told(loads(bank + blind + rest))] == ["unobservable]"]


def test_what_full_costs_is_told_where_it_is_a_third() -> None:
    """All figures, and only where it is so."""
    spec = load("tests/benchmarks/ins24.yaml")
    spec = override(spec, filter={"covariance": "ud"})
    lines = [str(each) for each in advise(spec, build(spec)) if each.name == "ud_cost"]
    assert len(lines) == 1
    found = re.search(r"`covariance: ud` takes (\d+) operations, with `full` (\d+); with .* (\d+) and (\d+);", lines[0])
    assert found is not None
    assert int(found[1]) >= 3 * int(found[2]) > 1000
    assert int(found[3]) >= 2 * int(found[4]) > 1000
    assert lines[0].endswith("[ud_cost]")
    full = override(spec, filter={"covariance": "full"})
    assert [each for each in advise(full, build(full)) if each.name == "ud_cost"] == []
    for text in (problems.chain(8), problems.ATT):
        spec = override(loads(text), filter={"covariance": "ud"})
        assert advise(spec, build(spec)) == []


@pytest.mark.long
def test_loops_are_told_where_they_take_a_tenth() -> None:
    spec = override(loads(problems.chain(24)), filter={"covariance": "ud"})
    lines = [str(each) for each in advise(spec, build(spec)) if each.name == "loops"]
    assert len(lines) == 1
    found = re.search(r"about (\d+) bytes of straight-line code, of which loops need about (\d+)", lines[0])
    assert found is not None
    assert int(found[1]) > 32768
    assert int(found[1]) > 10 * int(found[2])
    assert lines[0].endswith("[loops]")
    for code in ({"unroll": "full"}, {"unroll": "none"}, {"flash": 1 << 20}):
        decided = override(spec, code=code)
        assert [str(each) for each in advise(decided, build(decided)) if each.name == "loops"] == []


def test_an_angle_that_is_passed_on_linearly_may_spread_beyond_a_turn() -> None:
    wide = ("init: 0, std: 0.2", "init: 0, std: 2.5")
    assert told(changed(wide, base=UKF)) == []
    assert told(changed(wide, ("0.98*v}", "0.98*v + 0.1*sin(a), a: a + dt*v}"), base=UKF)) == []
    assert told(changed(wide, BENT, base=UKF.replace("type: ukf", "type: ukf, covariance: sqrt"))) != []
    assert told(changed(wide, BENT, base=ANGLE)) == []


def test_every_name_is_one_of_the_languages() -> None:
    names = {name for _, name, _ in DUE} | {"degrees", "sigma_angle", "alpha", "loops", "ud_cost", "per_step"}
    assert names == set(ADVICE)


def test_generate_is_pure(capsys: pytest.CaptureFixture[str]) -> None:
    kfgen.generate(changed((", Q: {v: 0.01}", "")))
    assert capsys.readouterr() == ("", "")


def test_a_model_that_leaves_the_numbers_is_no_error() -> None:
    assert told(changed(("0.98*v", "exp(exp(9*v)) + v"))) == []
