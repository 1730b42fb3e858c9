"""Filters in loops: the same numbers as in straight-line code and as the reference, the same bits as their program,
nothing changed after an error.

A failure here is that of a rolled layout or of a private function of its loops.
"""

from __future__ import annotations

import itertools
import math
import re
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from calling import Calls, refused
from emitted import RUN_TIME, SEMIDEFINITE, problems
from test_emitted_c import COMPILERS, WARNINGS, absent, run, write
from test_option_bits import MODEL, follow
from twin import Twin
from variants import FORMS, TURN, call, compiled, readings, spec_with

from kfgen.generate import Generated, build
from kfgen.ir.program import For, walk
from kfgen.native import NativeFilter
from kfgen.override import override
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status

LEARNING = "robust: chernodarov, adaptive: {chi2: 1}, adapt_R: 0.05, adapt_Q: 0.02"
OPTIONS = [
    ("ud-bierman", LEARNING),
    ("ud-bierman", "type: ekf2, variance_floor: {x: 0.01}, variance_ceiling: 0.4, adapt_R: 0.02"),
    ("ud-joseph", "robust: huber, consider: [y], gain_limit: 0.4, innovation_floor: 0.5"),
    ("full-joseph", "adaptive: {chi2: 1}, adapt_R: 0.05, adapt_Q: 0.02, variance_ceiling: {y: 0.4}"),
    ("full-joseph", "type: iekf, iterations: 2, consider: [x], gain_limit: 0.3"),
    ("full-standard", "robust: {psi: k*tanh(e/k)}, innovation_floor: 0.5, variance_floor: 0.01"),
    ("full-standard", "type: ekf2, adaptive: {chi2: 1}"),
    ("sqrt", LEARNING),
    ("sqrt", "type: iekf, iterations: 3, variance_floor: {x: 0.1}, variance_ceiling: 0.5"),
]
# without tanh, whose last bits are the platform's
EXACT = [(form, options.replace("tanh(e/k)", "e/(k + abs(e))")) for form, options in OPTIONS if "ekf2" not in options]
# five states, two of them measured together with others; exact components, correlated ones, a full Q, no Q at all
MIXED = """
kfgen: 1
name: mixed
parameters: {q: 0.01}
states:
  a: {init: 1, std: 2}
  b: {init: 0, std: 1}
  c: {init: 0.5, std: 0.5}
  d: {init: 0, std: 3}
  f: {init: 0, std: 0}
noise: {w: {}, n: {}}
noise_covariance: [[0.04, 0.01], [0.01, 0.02]]
dynamics:
  form: discrete
  f: {a: a + 0.1*b + w, b: 0.9*b + 0.1*c*d, c: c + 0.05*a + 0.5*n, d: 0.8*d + 0.1*f, f: f + 0.1*w}
  Q: [[0.1, 0.02, 0, 0, 0], [0.02, 0.1, 0, 0, 0], [0, 0, "q", 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]]
measurements:
  first:
    z:
      x: {h: a, std: 0.1}
      y: {h: a + 2*d, std: 0.2}
      again: {h: 3*a, std: 0.001}
      exact: {h: c, std: 0}
      sum: {h: b + c + d, std: 0}
      last: {h: d*b, std: 0.3}
  second:
    z: {u: {h: b - f}, v: {h: f}}
    R: [[0.01, 0.005], [0.005, 0.16]]
filter: {type: ekf}
"""
TIGHT = """
kfgen: 1
name: tight
states: {a: {init: 0, std: 1000}, b: {init: 0, std: 1000}, c: {init: 0, std: 1}}
dynamics: {form: discrete, f: {a: a + 0.1*b, b: b + 0.1*c}, Q: {a: 1e-6, b: 1e-6, c: 1e-6}}
measurements:
  s:
    z:
      x: {h: a, std: 0.1}
      y: {h: b, std: 0.1}
      again: {h: a, std: 0.1}
      sum: {h: a + b, std: 0.1}
      less: {h: b - c, std: 0.2}
filter: {type: kf}
"""
MODELS = {"mixed": MIXED, "run_time": RUN_TIME, "semidefinite": SEMIDEFINITE}
PAIRS = [(form, "mixed") for form in FORMS]
PAIRS += [("ud-bierman", "run_time"), ("sqrt", "run_time")]
PAIRS += [("ud-joseph", "semidefinite"), ("full-standard", "semidefinite")]


def rolled(spec: Spec, unroll: str = "none") -> Spec:
    return replace(spec, code=replace(spec.code, unroll=unroll))


def in_form(text: str, form: str, scalar: str = "double") -> Spec:
    covariance, _, update = form.partition("-")
    return override(loads(text), scalar, filter={"covariance": covariance, "update": update or None})


def named(specs: Mapping[Any, Spec]) -> dict[Any, Generated]:
    return {key: build(replace(spec, name=f"{spec.name}_{k}")) for k, (key, spec) in enumerate(specs.items())}


@cache
def filters() -> tuple[dict[Any, Generated], dict[Any, NativeFilter]]:
    """All that is compared with the reference, by one call of the compiler."""
    specs = {(form, options): rolled(spec_with(TURN, options, form)) for form, options in OPTIONS}
    specs |= {(form, name): rolled(in_form(MODELS[name], form)) for form, name in PAIRS}
    specs |= {(form, "chain12", u): rolled(in_form(problems.chain(12), form), u)
              for form, u in itertools.product(("ud-bierman", "full-standard"), ("none", "full"))}  # fmt: skip
    made = named(specs)
    return made, compiled(made)


def calls(text: str, steps: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """A plausible track; readings of exact components repeat what is known."""
    spec = loads(text)
    log = simulate(spec, steps, 3)
    random = np.random.default_rng(4)
    run_time = spec.dt is not None and spec.dt.run_time
    for row in range(1, steps):
        u = {"u": random.normal(0, 0.3, len(spec.inputs))} if spec.inputs else {}
        yield "predict", {**u, **({"dt": 0.1 + 0.05 * (row % 3)} if run_time else {})}
        for sensor in spec.measurements:
            yield sensor.name, {"z": [log.columns[f"{sensor.name}.{c.name}"][row] for c in sensor.components]}


def apart(kf: Any, other: Any) -> float:
    """The largest difference of x, P and nis, relative to their size."""
    pairs = [(kf.x, other.x), (kf.P, other.P), (np.array([kf.nis]), np.array([other.nis]))]
    return max(float(np.max(np.abs(a - b))) / (1 + float(np.max(np.abs(b)))) for a, b in pairs)


def compare(kf: Any, other: Any, track: Iterator[tuple[str, dict[str, Any]]], most: float) -> set[int]:
    met = set()
    for count, (name, arguments) in enumerate(track):
        ours, theirs = call(kf, name, arguments), call(other, name, arguments)
        assert ours == theirs, f"call {count}, {name}: {ours:#x} for {theirs:#x}"
        assert apart(kf, other) < most, f"call {count}, {name}"
        met.add(ours)
    return met


@pytest.mark.parametrize(("form", "options"), OPTIONS)
def test_options_are_those_of_the_reference(form, options):
    made, natives = filters()
    kf = natives[form, options]
    kf.init()
    # in the long run the track with glitches and inflations magnifies every last bit
    track = itertools.islice(readings(TURN, 30, 5), 36)
    met = compare(kf, reference(made[form, options].code.model.spec), track, 1e-8)
    assert Status.OK in met or len(met) > 1


@pytest.mark.parametrize(("form", "name"), PAIRS)
def test_models_are_those_of_the_reference(form, name):
    """Sparse and full Q, noise inputs, exact, repeated and correlated components, an odd number of states."""
    made, natives = filters()
    kf = natives[form, name]
    kf.init()
    compare(kf, reference(made[form, name].code.model.spec), calls(MODELS[name], 12), 1e-9)


@pytest.mark.parametrize("form", ["ud-bierman", "full-standard"])
def test_loops_give_what_straight_line_code_gives(form):
    natives = filters()[1]
    looped, straight = natives[form, "chain12", "none"], natives[form, "chain12", "full"]
    looped.init()
    straight.init()
    compare(looped, straight, calls(problems.chain(12), 40), 1e-11)


def test_functions_are_loops():
    """What grows with the square of the states is not written out: the text hardly grows with them."""
    for form in FORMS:
        lengths = []
        for n in (8, 12):
            made = build(rolled(in_form(problems.chain(n), form)))
            functions = {f.name: f for f in made.code.functions}
            for name in ("predict", "update_position"):
                assert any(isinstance(s, For) for s in walk(functions[name].body)), (form, name)
            lengths.append(made.files[f"chain{n}.c"].count(";"))
        assert lengths[1] < 1.5 * lengths[0], form


def test_precise_measurements_of_what_is_hardly_known():
    """A variance of 1e6 measured with 0.01, in float: no digits are lost to differences of nearly equal numbers."""
    specs = {form: rolled(in_form(TIGHT, form, "float")) for form in FORMS}
    random = np.random.default_rng(1)
    ref = reference(in_form(TIGHT, "full-joseph"))
    natives = compiled(named(specs))
    for _ in range(12):
        z = random.normal(0, 1, 5)
        assert ref.predict() == ref.update("s", z) == 0
        deviations = np.sqrt(np.diag(ref.P))
        for form, kf in natives.items():
            assert kf.predict() == kf.update("s", z) == 0
            assert np.max(np.abs(kf.P - ref.P) / np.outer(deviations, deviations)) < 1e-4, form
            assert np.max(np.abs(kf.x - ref.x) / deviations) < 1e-4, form


@cache
def in_float() -> list[tuple[Generated, NativeFilter]]:
    specs = {key: rolled(spec_with(MODEL, key[1], key[0], "float", "code: {gate_count: true}")) for key in EXACT}
    for form in ("ud-bierman", "full-standard"):
        specs[form, "chain8"] = rolled(in_form(problems.chain(8), form, "float"))
    made = named(specs)
    natives = compiled(made, ("-O0", "-ffp-contract=off"))
    return [(made[key], natives[key]) for key in specs]


def test_c_is_the_program():
    seen = Status.OK
    for made, kf in in_float():
        kf.init()
        twin = Twin(made, kf)
        if "bits" in kf.name:
            seen |= follow(twin)
            continue
        for name, arguments in calls(problems.chain(8), 4):
            function = name if name == "predict" else f"update_{name}"
            assert twin.run(function, **arguments) == call(kf, name, arguments)
            assert not twin.differences(), f"{kf}: {function}"
    flags = Status.GLITCH_SMALL | Status.GLITCH_LARGE | Status.ANOMALY | Status.GATED | Status.REGULARIZED
    assert seen & flags == flags


def test_an_error_changes_nothing():
    """NaN and infinity in every argument, and in what the filter keeps; readings at the end of a float's range."""
    for _, kf in in_float():
        kf.init()
        each = Calls(kf)
        for name in ("predict", *each.updates):
            assert each(name) < ERROR
        good = kf.copy()
        for name in ("predict", *each.updates):
            refused(each, Status.NULL_ARGUMENT, name, kf=None)
            for key, vector in each.vectors[name].items():
                for i, bad in itertools.product(range(len(vector)), (math.nan, -math.inf)):
                    if key != "mask":
                        wrong = vector.copy()
                        wrong[i] = bad
                        refused(each, Status.NOT_FINITE, name, **{key: wrong})
        covariance = sorted(kf.struct.fields & {"U", "D", "P", "S"})
        for field, name in itertools.product(["x", *covariance], ("predict", *each.updates)):
            for index in {0, len(kf.raw[field]) // 2, len(kf.raw[field]) - 1}:
                kf.struct.ffi.memmove(kf.struct.data, good.struct.data, len(bytes(good)))
                getattr(kf.struct.data, field)[index] = math.nan
                before = bytes(kf)
                if each(name) >= ERROR:
                    assert bytes(kf) == before, f"{kf}: {field}[{index}], {name}"
        for name, size in itertools.product(each.updates, (1e18, 1e30, 3e38)):
            kf.struct.ffi.memmove(kf.struct.data, good.struct.data, len(bytes(good)))
            before = bytes(kf)
            if each(name, z=np.full_like(each.vectors[name]["z"], size)) >= ERROR:
                assert bytes(kf) == before, f"{kf}: {name}({size})"
            else:
                assert np.isfinite(kf.x).all()


@pytest.mark.parametrize("compiler", ["gcc", "clang", "g++"])
def test_clean(compiler, tmp_path):
    if shutil.which(compiler) is None:
        absent(compiler)
    floats, doubles = [made for made, _ in in_float()], list(filters()[0].values())
    files: dict[str, str] = {}
    for made in {"gcc": [*floats, *doubles], "clang": doubles[:9], "g++": floats}[compiler]:
        files |= made.files
    language = ["-x", "c++"] if compiler.endswith("++") else []
    run([compiler, COMPILERS[compiler], *WARNINGS, "-fsyntax-only", *language, *write(files, tmp_path)], tmp_path)
    for name, text in files.items():
        lines = text.splitlines()
        assert not [line for line in lines if len(line) > 100 or line != line.rstrip()], name
        if name.endswith(".c"):
            private = set(re.findall(r"^static void (\w+)\(", text, re.MULTILINE))
            assert all(text.count(f"{function}(") > 1 for function in private), "a private function is not called"
