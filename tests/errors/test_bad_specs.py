"""Every mistake has its place and its cure: one change to a valid spec gives one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from kfgen.errors import SpecError
from kfgen.spec import loads

VALID = {path.stem: path.read_text() for path in sorted(Path(__file__).with_name("valid").glob("*.yaml"))}


def mistakes(text: str | bytes) -> list[str]:
    with pytest.raises(SpecError) as caught:
        loads(text, "f")
    return str(caught.value).splitlines()


# spec, old text, new text, what the column points at (in the new text, from where the change begins),
# key path, fragments of the message
CASES = [
    # the top
    ("vehicle", "kfgen: 1", "kfgen: 2", "2",
     "kfgen", "version 2 of the language is not known; write `kfgen: 1`"),
    ("vehicle", "name: vehicle", "name: math", "math", "name", "standard header (math.h)"),
    ("vehicle", "name: vehicle", "name: 1x", "1x", "name", "not a C identifier"),
    ("vehicle", "name: vehicle", "name: _x", "_x", "name", "underscore"),
    ("vehicle", "scalar: float", "scalar: q16.17", "q16", "scalar", "there is no scalar `q16.17`"),
    ("vehicle", "scalar: float", "scalar: q28.4", "q28", "scalar", "8 <= n <= 24"),
    ("vehicle", "dynamics:", "dynamic:", "dynamic",
     "dynamic", "unknown key `dynamic`; did you mean `dynamics`?"),
    ("vehicle", "description: planar", "description: true #", "true", "description", "quote it"),
    ("vehicle", "planar vehicle", "2020-01-01", "2020", "description", "is a date"),
    # types
    ("vehicle", "std: stdx,", "std: true,", "true", "states.px.std", "booleans are not numbers"),
    ("vehicle", "std: stdx,", "std: [1],", "[1]",
     "states.px.std", "`std` of `px` is a number, not a 1-vector"),
    ("vehicle", "std: stdx,", "sdt: stdx,", "sdt", "states.px.sdt", "did you mean `std`?"),
    ("vehicle", "std: stdx,", "std: stdx, angle: true,", "angle", "states.px.angle",
     "unknown key `angle`; write `kind: angle`"),
    ("vehicle", "std: stdx,", "std: stdx, period: 360,", "period", "states.px.period", "write `kind: {periodic: 360}`"),
    ("vehicle", "std: stdx,", "std: stdx, periodic: true,", "periodic", "states.px.periodic", "`kind: {periodic: P}`"),
    ("vehicle", "std: stdx,", "std: stdx, wrap: 2*pi,", "wrap", "states.px.wrap", "write `kind: {periodic: 2*pi}`"),
    ("vehicle", "{h: px,", "{h: px, wrapped: yes,", "wrapped", "measurements.gnss.z.x.wrapped", "write `kind: angle`"),
    ("vehicle", "{h: px,", "{h: px, period: true,", "period", "measurements.gnss.z.x.period", "`kind: {periodic: P}`"),
    ("vehicle", "std: stdx,", "std: .nan,", ".nan", "states.px.std", "not finite"),
    ("vehicle", "std: stdx,", "std: 1_0,", "1_0", "states.px.std", "underscores; write 10"),
    ("vehicle", "std: stdx,", "std: 0x10,", "0x10", "states.px.std", "decimal"),
    ("vehicle", "std: stdx,", "std: 2020-01-01,", "2020", "states.px.std", "date"),
    ("vehicle", "std: stdx,", "std: 1e999999,", "1e9", "states.px.std", "out of range"),
    ("vehicle", "partial: true", "partial: yes", "yes", "measurements.gnss.partial", "write true"),
    ("vehicle", "range: [-5000, 5000], doc: east", "range: [1], doc: east", "[1]",
     "states.px.range", "2 entries are wanted"),
    ("vehicle", "  b: {init", "  <<: {a: 1}\n  b: {init", "<<", "states.<<", "merge keys"),
    ("vehicle", "  b: {init", "  v: {init: 0, std: 1}\n  b: {init", "v:",
     "states.v", "twice (first at line 20, column 3)"),
    ("vehicle", "type: ekf", "type: !x ekf", "!x", "filter.type", "tag `!x` is not allowed"),
    ("vehicle", "type: ekf", "type: *x", "*x", "filter.type", "no anchor"),
    ("vehicle", "  c: cos(th)", "  c:", "c:", "let.c", "there is no value"),
    ("vehicle", "  c: cos(th)", "  c: {a: 1}", "{a", "let.c", "not a mapping"),
    ("vehicle", "flash: 16k", "flash: 16M", "16M", "code.flash", "write bytes, or k"),
    ("vehicle", "flash: 16k", "flash: 0", "0", "code.flash", "at least 1"),
    ("vehicle", "reset_after: 5", "reset_after: 2.5", "2.5",
     "measurements.gnss.gate.reset_after", "whole number"),
    ("vehicle", "unroll: none", "unroll: {predict: nnoe}", "nnoe", "code.unroll.predict", "did you mean `none`?"),
    ("vehicle", "unroll: none", "unroll: {predct: none}", "predct", "code.unroll.predct", "did you mean `predict`?"),
    ("vehicle", "unroll: none", "unroll: {update_gps: none}", "update_gps",
     "code.unroll.update_gps", "there is no function `update_gps`"),
    ("vehicle", "rate: 1/20", "rate: 0", "0", "measurements.gnss.rate", "the rate is 0; write a number greater than 0"),
    ("vehicle", "advice: [unobservable", "advice: [unobserved", "unobserved",
     "advice[0]", "did you mean `unobservable`?"),
    ("vehicle", "unroll: none", "unroll: nnoe", "nnoe", "code.unroll", "did you mean `none`?"),
    # expressions
    ("vehicle", "px: px + dt*v*c", "px: px + dt*v^c", "^c", "dynamics.f.px", "write `**`"),
    ("vehicle", "px: px + dt*v*c", "px: px + ddt*v*c", "ddt", "dynamics.f.px", "the name `ddt` is not known"),
    ("vehicle", "px: px + dt*v*c", "px: px + sigma_w*v*c", "sigma_w",
     "dynamics.f.px", "did you mean `sigma_v`?"),
    ("vehicle", "px: px + dt*v*c", "px: 'px + ln(v)'", "ln", "dynamics.f.px", "did you mean `log`?"),
    ("vehicle", "px: px + dt*v*c", 'px: "px + (v"', "(v", "dynamics.f.px", "`(` is not closed"),
    ("vehicle", "px: px + dt*v*c", "px: px + v > 3", "px +", "dynamics.f.px", "a condition is not a number"),
    ("vehicle", "px: px + dt*v*c", "px: px + v**65", "65", "dynamics.f.px", "at most 64"),
    ("vehicle", "px: px + dt*v*c", "px: px + 1/(stdx - 1.394)", "px +", "dynamics.f.px", "divides by zero"),
    ("vehicle", "stdx**2", "stdx^2", "^2", "constants.varx", "write `**` for a power"),
    ("vehicle", "stdx**2", "2**64**64", "2**64", "constants.varx", "at most 64"),
    ("vehicle", "stdx**2", "e2 + 1", "e2",
     "constants.varx", "the sensor noise `e2` may not stand in `constants`"),
    ("vehicle", "varx: stdx**2", "varx: vary\n  vary: 1", "vary",
     "constants.varx", "used above its definition"),
    ("vehicle", "varx: stdx**2", "varx: varx", "varx\n", "constants.varx", "by itself"),
    ("vehicle", "std: stdx,", "std: sqrt(-1),", "sqrt", "states.px.std", "square root of a negative number"),
    ("vehicle", "[0, 10, 20]", "[0, 20, 10]", None, "measurements.compass.z.odd.h", "does not increase"),
    # names and where they stand
    ("vehicle", "  spare:", "  sin:", "sin", "inputs.sin", "function of the language"),
    ("vehicle", "  spare:", "  PI:", "PI", "inputs.PI", "macro of Arduino"),
    ("vehicle", "  spare:", "  B01:", "B01", "inputs.B01", "macro of Arduino"),
    ("vehicle", "  spare:", "  INT32_MAX:", "INT32", "inputs.INT32_MAX", "macro of C's headers"),
    ("vehicle", "  spare:", "  lambda:", "lambda", "inputs.lambda", "keyword of Python"),
    ("vehicle", "  spare:", "  class:", "class", "inputs.class", "keyword of C++"),
    ("vehicle", "  spare:", "  px:", "px", "inputs.px", "already that of a state (line 18)"),
    ("vehicle", "  spare:", "  a-b:", "a-b", "inputs.a-b", "not a C identifier"),
    ("vehicle", "  spare:", f"  {'a' * 41}:", "a", f"inputs.{'a' * 41}", "longer than 40"),
    ("vehicle", "  b: {init", "  V: {init: 0, std: 1}\n  b: {init", "V:",
     "states.V", "`VEHICLE_V` (the index of the state `V`) and"),
    ("vehicle", "  b: {init", "  nx: {init: 0, std: 1}\n  b: {init", "nx:",
     "states.nx", "`VEHICLE_NX` (a size)"),
    ("vehicle", "h: px, std", "h: px*dt, std", "dt",
     "measurements.gnss.z.x.h", "argument of predict may not stand in `h`"),
    ("vehicle", "h: px, std", "h: px*wv, std", "wv",
     "measurements.gnss.z.x.h", "the noise `wv` may not stand in `h`"),
    ("vehicle", "h: px*a1", "h: px*e1", "e1", "measurements.pair.z.p.h", "noise of another sensor `e1`"),
    ("vehicle", "v: 25*dt", "v: 25*dt*wv", "wv", "dynamics.Q.v", "the noise `wv` may not stand in `Q`"),
    ("vehicle", "std: stdx", "std: px", "px", "states.px.std", "the state `px` may not stand"),
    ("vehicle", "value: 0.1", "value: sigma_v", "sigma_v",
     "parameters.drift.value", "the parameter `sigma_v` may not"),
    ("vehicle", "d: c", "d: s", None, "let.s", "in a circle: s -> d -> s"),
    ("vehicle", "px, th, 0.5", "px, tx, 0.5", "tx", "covariances[0][1]", "there is no state `tx`"),
    ("vehicle", "from: gnss", "from: gns", "gns", "initialize.from", "did you mean `gnss`?"),
    ("vehicle", "{px: x, py: y}", "{px: x, py: q}", "q", "initialize.states.py", "component of gnss `q`"),
    ("vehicle", "v: v + wv", "vv: v + wv", "vv", "dynamics.f.vv", "there is no state `vv`"),
    # values
    ("vehicle", "nominal: 0.1", "nominal: 100", "100", "dt.nominal", "larger than `max`"),
    ("vehicle", "min: 0.001", "min: 0", "0,", "dt.min", "greater than 0"),
    ("vehicle", "probability: 0.999, reset", "probability: 1, reset", "1,",
     "measurements.gnss.gate.probability", "between 0 and 1"),
    ("vehicle", "range: [0, 50]", "range: [50, 0]", "50", "parameters.drift.range[0]", "not in order"),
    ("vehicle", "b: {init: 0", "b: {init: 1", "1", "states.b.init", "outside the bounds [-0.5, 0.5]"),
    ("vehicle", "v: 25*dt", "v: -25", "-25", "dynamics.Q.v", "the variance -25 is negative"),
    ("vehicle", "std: stdx", "std: -stdx", "-stdx",
     "states.px.std", "the standard deviation -1.394 is negative; write 1.394"),
    ("vehicle", "std: stdx", "std: 1, var: 1", "var", "states.px.var", "given both"),
    ("vehicle", ", std: stdx", "", None, "states.px", "one of `std`, `var` is missing"),
    ("vehicle", "px, th, 0.5", "px, th, 50", None, "covariances", "its smallest eigenvalue is -47"),
    ("vehicle", "px, th, 0.5", "px, th, 50", None,
     "covariances", "the covariance of `px` and `th` is 50; it may be at most 2.47"),
    ("vehicle", "h: px, std", "h: 5, std", "5", "measurements.gnss.z.x.h", "depends on no state"),
    ("vehicle", "px: 64", "px: 63", "63", "fixed.scale.px", "not a power of two"),
    ("vehicle", "unit: rad, kind: angle}\n  course", "unit: deg, kind: angle}\n  course", "deg",
     "states.th.unit", "has the unit rad"),
    ("vehicle", "[v*0.1, 2", "[v*0.2, 2", "v*0.2", "measurements.pair.R[1][0]", "not symmetric"),
    ("vehicle", "[[1, 0.5], [0.5, 1]]", "[[1, 5], [5, 1]]", None,
     "measurements.pair.noise_covariance", "eigenvalue is -4"),
    ("vehicle", "[[1, 0.5], [0.5, 1]]", "[[1, 0.5], [1]]", "[1]]",
     "measurements.pair.noise_covariance[1]", "row 2 has 1 entries"),
    ("vehicle", "[[1, 0.5], [0.5, 1]]", "[[1]]", None,
     "measurements.pair.noise_covariance", "is 1 x 1, but there are 2 noises"),
    ("vehicle", "wv: {std: 5*sqrt(dt)", "wv: {density: 5", "density",
     "noise.wv.density", "continuous form only"),
    ("vehicle", "form: discrete", "form: discrete\n  integrator: rk4", "integrator",
     "dynamics.integrator", "not used by dynamics of form `discrete`"),
    # filters
    ("vehicle", "type: ekf", "type: ekf\n  iterations: 3", "iterations",
     "filter.iterations", "not used by filter type `ekf`"),
    ("vehicle", "type: ekf", "type: ekf\n  sequential: false", "sequential",
     "filter.sequential", "not used by filter type `ekf`"),
    ("vehicle", "consider: [b]", "consider: [b, b]", "consider", "filter.consider", "twice"),
    ("vehicle", "probability: 0.999}\n  variance", "chi2: -1}\n  variance", "-1",
     "filter.adaptive.chi2", "greater than 0"),
    ("vehicle", "px: 1e6, py", "px: 1e-13, py", "1e-13",
     "filter.variance_ceiling.px", "does not lie above the floor"),
    ("steady_kf", "x + dt*y + offset*pump", "x*offset + dt*y + pump", "x*offset",
     "dynamics.f.x", "vary with parameters"),
    ("steady_kf", "x + dt*y + offset*pump", "x + dt*y*x", "x + dt", "dynamics.f.x", "not linear"),
    ("steady_kf", "y: .5e-2", "y: offset", "offset", "dynamics.Q.y", "varies with parameters"),
    ("steady_kf", "gain: steady", "gain: steady, adapt_R: 0.1", "adapt_R",
     "filter.adapt_R", "makes the gain vary"),
    ("continuous_ukf", "kappa: 1", "kappa: -2", "-2",
     "filter.sigma_points.kappa", "n + kappa must be positive"),
    ("continuous_ukf", "alpha: 0.1", "alpha: 0", "0,", "filter.sigma_points.alpha", "greater than 0"),
    ("continuous_ukf", "kind: merwe, alpha: 0.1, beta: 2, kappa: 1", "kind: cubature", None,
     "filter.reject", "no centre point"),
    ("continuous_ukf", "redraw: true", "redraw: false", "redraw",
     "filter.sigma_points.redraw", "augmented noise"),
    ("continuous_ukf", "  sequential: true\n", "", None, "filter.robust", "defined per scalar measurement"),
    ("continuous_ukf", "adapt_R: 1e-4", "adapt_Q: 1e-4", "adapt_Q",
     "filter.adapt_Q", "not used by filter type `ukf`"),
    ("continuous_ukf", "w: {init: 0}", "w: {init: 0, std: 1}", None,
     "P0", "`P0` is given, and `std` of `w` too"),
    ("continuous_ukf", "[0.01, dt]", "[0.01, -dt]", None, "P0", "not positive semidefinite"),
    ("continuous_ukf", "substeps: 2", "substeps: 0", "0", "dynamics.substeps", "between 1 and 1000"),
    ("continuous_ukf", "dt: 0.01\n", "", None, "P0[1][1]", "the spec has no key `dt`"),
    ("continuous_ukf", "form: continuous", "form: contnuous", "contnuous",
     "dynamics.form", "did you mean `continuous`?"),
    # imm
    ("imm", "[0, 1, 0, 0, 0]", "[0, 0.9, 0, 0, 0]", "[0, 0.9", "imm.transition[1]", "sums to 0.9, not to 1"),
    ("imm", "[0, 1, 0, 0, 0]", "[0, 1.1, -0.1, 0, 0]", "1.1", "imm.transition[1][1]", "not between 0 and 1"),
    ("imm", "[0, 1, 0, 0, 0]", "[0, 1]", "[0, 1]", "imm.transition[1]", "5 modes"),
    ("imm", "[0, 1, 0, 0, 0]", '["0*t", 1, 0, 0, 0]', None, "imm.transition[1][0]", "use constants, parameters and dt"),
    ("imm", "{x: {init: 1, std: 1}, ", "{", None, "imm.modes.iterated.states", "all modes share `states`"),
    ("imm", "    cv: {}", "    cv: {filter: {type: kf, gain: steady}}", "gain",
     "imm.modes.cv.filter.gain", "mixing the modes changes their covariances"),
    ("imm", "mu0: [0.2, ", "mu0: [", None, "imm.mu0", "`mu0` has 4 entries, but there are 5 modes"),
    ("imm", "mu_floor: 1e-9", "mu_floor: 1", "1", "imm.mu_floor", "less than 1/5"),
    ("imm", "    cv: {}", "    int: {}", "int", "imm.modes.int", "keyword of C"),
    ("imm", "range: {h: d", "rng: {h: d", None,
     "imm.modes.iterated.measurements", "other sensors or components"),
    ("imm", "x: {init: 1, std: 1}", "x: {init: 1, std: 1, unit: m}", "unit",
     "imm.modes.iterated.states.x.unit", "unknown key `unit`"),
    ("imm", "wm: [0.1,", "wm: [0.2,", None, "imm.modes.ca.filter.sigma_points.wm", "sum to 1.1, not to 1"),
    ("imm", "iterations: 2", "iterations: 21", "21",
     "imm.modes.iterated.filter.iterations", "between 1 and 20"),
    ("imm", "redraw: false", "redraw: false, alpha: 1", "alpha",
     "imm.modes.cubature.filter.sigma_points.alpha", "kind `cubature`"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("spec", "old", "new", "at", "path", "text"),
    CASES,
    ids=lambda value: value if isinstance(value, str) and len(value) < 40 else "",
)
def test_one_mistake_one_line(spec: str, old: str, new: str, at: str | None, path: str, text: str) -> None:
    base = VALID[spec]
    assert old in base
    start = base.index(old)
    changed = base[:start] + new + base[start + len(old) :]
    lines = mistakes(changed)
    assert len(lines) == 1, lines
    assert f": {path}: " in lines[0]
    assert text in lines[0]
    if at is not None:
        where = start + new.rindex(at) if at == "0" else changed.index(at, start)
        before = changed[:where]
        assert lines[0].startswith(f"f:{before.count(chr(10)) + 1}:{where - before.rfind(chr(10))}: ")


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("{x: x + dt*v, v: v + a*dt}", "{x: atan2(x, v), v: v + a*dt}", '"atan2(x, v)"'),
        ("v: v + a*dt}", "v: where(v > 1, min(v, 2), a*dt)}", '"where(v > 1, min(v, 2), a*dt)"'),
        ("{h: x, std: r}", "{h: hypot(x, v), std: r}", '"hypot(x, v)"'),
        ("mu0: [0.2,", "mu0: [max(0.2, 0.1),", '"max(0.2, 0.1)"'),
        ("{h: x, std: r}", "{h: x, std: }", "if a comma"),
        ("{h: x, std: r}", "{h: x, std: r, f(x)}", "if a comma"),
    ],
)  # fmt: skip
def test_a_comma_in_a_flow_mapping(old: str, new: str, text: str) -> None:
    lines = mistakes(VALID["imm"].replace(old, new, 1))
    assert len(lines) == 1, lines
    assert "quote the expression" in lines[0]
    assert text in lines[0]


def test_all_mistakes_in_one_run() -> None:
    text = VALID["vehicle"]
    for old, new in (
        ("scalar: float", "scalar: flot"),
        ("stdx**2", "stdx^2"),
        ("std: 1}", "std: true}"),
        ("form: discrete", "from: discrete"),
        ("py: py + dt*v*s", "py: py + dt*v*unheard"),
        ("probability: 0.999, r", "probability: 2, r"),
        ("covariance: ud", "covariance: du"),
        ("overflow: saturate", "overflow: wrap"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    lines = mistakes(text)
    paths = [line.split(": ")[1] for line in lines]
    assert paths == [
        "scalar",
        "constants.varx",
        "states.v.std",
        "dynamics.from",
        "dynamics.f.py",
        "measurements.gnss.gate.probability",
        "filter.covariance",
        "fixed.overflow",
    ]
    numbers = [int(line.split(":")[1]) for line in lines]
    assert numbers == sorted(numbers)


def test_one_root_cause_one_line() -> None:
    text = VALID["vehicle"]
    assert len(mistakes(text.replace("states:\n", "state:\n", 1))) == 1
    assert len(mistakes(text.replace("parameters:\n", "params:\n", 1))) == 1
    assert len(mistakes(text.replace("dt: {nominal: 0.1, min: 0.001, max: 10}\n", "", 1))) == 1
    assert len(mistakes(text.replace("  spare:", "  spare: 5", 1))) == 1
    lines = mistakes(text.replace("dt*v*c", "dt*qqq*c").replace("dt*v*s", "dt*qqq*s"))
    assert len(lines) == 1
    assert "also in line" in lines[0]


def test_missing_keys_are_listed() -> None:
    lines = mistakes("kfgen: 1\n")
    assert [line.split(": ")[1] for line in lines] == ["dynamics", "measurements", "name", "states"]
    assert all("is missing" in line for line in lines)
