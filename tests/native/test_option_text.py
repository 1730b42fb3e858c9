"""The text that options make: what is declared, what is not there, clean under strict compilers.

A failure here is the emitter's: names, spelling, what is printed although nothing asks for it.
"""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from emitted import SCALARS, problems
from test_emitted_c import COMPILERS, WARNINGS, absent, run, write
from test_steady_c import TRACK
from variants import CODE, FORMS, JOSEPH, TURN, compiled, spec_with

from kfgen.errors import SpecError
from kfgen.generate import Generated, build, generate
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import ERROR

# states, parameters and components named like what options keep and compute
HOSTILE = """
kfgen: 1
name: kept
dt: 0.5
parameters: {k: 2, glitch_a: 1, e_a: 0.5}
states:
  mask: {init: 1, var: 1}
  R: {init: 0.5, var: 1}
  Q: {init: 0.5, var: 1}
  residual_a: {init: 0, var: 1}
  threshold: {init: 0.25, var: 1}
  excess_a: {init: 0, var: 1, kind: angle}
dynamics:
  form: discrete
  f: {mask: 0.9*mask + 0.1*R*Q*e_a, R: 0.9*R + 0.1*Q, threshold: 0.5*threshold + glitch_a*residual_a}
  Q: {R: 0.1, Q: 0.1, residual_a: 0.1}
measurements:
  a:
    z:
      a: {h: mask + Q*R}
      mask: {h: R + threshold + residual_a}
      u: {h: Q + excess_a}
    R: [[1, 0.25, 0], [0.25, 1, 0], [0, 0, 1]]
    partial: true
    gate: {probability: 0.999, reset_after: 2}
  fix:
    z: {z: {h: excess_a, std: 0.5, kind: angle}, kf: {h: Q, std: 0.5}}
    partial: true
filter: {type: ekf}
"""
LEARNING = "adaptive: {chi2: 1}, adapt_R: 0.05, adapt_Q: 0.02"
OPTIONS = {
    "ud-bierman": f"robust: chernodarov, {LEARNING}",
    "ud-joseph": f"type: ekf2, robust: {{psi: k*e/(k + abs(e))}}, {LEARNING}, consider: [HELD], gain_limit: 0.5",
    "full-joseph": "type: iekf, variance_ceiling: 2, gain_limit: 0.5",
    "full-standard": "robust: huber, adapt_R: 0.05, innovation_floor: 0.1",
    "sqrt": f"type: ekf2, {LEARNING}, variance_floor: 1e-6",
}


@cache
def made() -> dict[tuple[str, str, str], Generated]:
    """Text, form, options -> what is generated: TURN in float, HOSTILE in double."""
    out = {}
    for text, scalar, held in ((TURN, "float", "th"), (HOSTILE, "double", "R")):
        for form, options in OPTIONS.items():
            spec = spec_with(text, options.replace("HELD", held), form, scalar)
            out[text, form, options] = build(replace(spec, name=f"{spec.name}_{form.replace('-', '_')}"))
    steady = loads(TRACK.replace("type: kf", "type: kf, gain: steady") + CODE)
    for scalar in SCALARS:
        out[TRACK, "", scalar] = build(replace(steady, name=f"steady_{scalar}", scalar=scalar))
    return out


def test_clean(tmp_path):
    """As C with all warnings, and as C++: one of its compilers is enough to tell that it is."""
    sources = write({name: text for each in made().values() for name, text in each.files.items()}, tmp_path)
    missing = []
    for compiler in ("gcc", "clang", "g++"):
        if shutil.which(compiler) is None:
            missing.append(compiler)
            continue
        language = ["-x", "c++"] if compiler.endswith("++") else []
        run([compiler, COMPILERS[compiler], *WARNINGS, "-fsyntax-only", *language, *sources], tmp_path)
    if missing:
        absent(", ".join(missing))


def test_names_like_those_of_the_options():
    """Fields, arguments and locals are told apart from states, parameters and components of their names."""
    kept = {key: each for key, each in made().items() if key[0] == HOSTILE}
    random = np.random.default_rng(5)
    for key, kf in compiled(kept).items():
        ref = reference(kf.spec)
        for k in range(8):
            z = random.normal(0, 2, 3)
            for name, arguments in (("a", {"z": z, "mask": k}), ("a", {"z": z}), ("fix", {"z": z[:2], "mask": 1})):
                assert kf.predict() == ref.predict()
                assert kf.update(name, **arguments) == ref.update(name, **arguments) < ERROR
            sigma = np.sqrt(ref.P.diagonal())
            assert np.max(np.abs(kf.x - ref.x) / sigma) < 1e-9, key
            assert np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma)) < 1e-9, key


def test_sensors_that_would_share_a_name():
    """update_gnss_masked: the masked update of one sensor, and the update of another."""
    text = problems.CV4.replace("filter:", "  gnss_masked:\n    z: {x: {h: vx, var: 1}}\nfilter:")
    assert generate(loads(text))
    with pytest.raises(SpecError, match="update_gnss_masked"):
        generate(loads(text.replace("  gnss:\n", "  gnss:\n    partial: true\n")))


def declared(header: str) -> dict[str, tuple[str, str]]:
    """Function -> its declaration in one line, its documentation."""
    found = re.findall(r"/\*\*\n(.*?)\*/\n([^;{}]*?\b(\w+)\([^;]*\);)", header, re.DOTALL)
    return {name: (" ".join(text.split()).replace("( ", "("), " ".join(doc.split())) for doc, text, name in found}


def test_declarations():
    for (text, form, options), each in made().items():
        name = each.code.model.spec.name
        functions = declared(each.files[f"{name}.h"])
        wanted = {}
        if text == TURN:
            wanted["update_fix_masked"] = (
                f"{name}_status_t {name}_update_fix_masked({name}_t *kf, const {name}_fix_t *z, uint32_t mask);"
            )
            assert f"{name}_update_course_masked" not in functions
            doc = functions[f"{name}_update_fix_masked"][1]
            assert "@param mask" in doc
            assert re.search(r"bit i: .*component i", doc)
            assert "chosen" in doc
        if "adapt_R" in options and text == TURN:
            wanted["get_R_fix"] = f"void {name}_get_R_fix(const {name}_t *kf, {name}_real_t R[9]);"
            wanted["get_R_course"] = f"void {name}_get_R_course(const {name}_t *kf, {name}_real_t R[4]);"
        if "adapt_Q" in options and text == TURN:
            wanted["get_Q"] = f"void {name}_get_Q(const {name}_t *kf, {name}_real_t Q[9]);"
        if form == "sqrt":
            n = len(each.code.model.states)
            S = f"{name}_real_t S[{n * n}]);"
            wanted["set_sqrt_covariance"] = f"{name}_status_t {name}_set_sqrt_covariance({name}_t *kf, const {S}"
            wanted["get_sqrt_covariance"] = f"void {name}_get_sqrt_covariance(const {name}_t *kf, {S}"
        for function, declaration in wanted.items():
            assert functions[f"{name}_{function}"][0] == declaration
        for function, there in {
            "get_R_": "adapt_R" in options, "get_Q": "adapt_Q" in options, "sqrt_covariance": form == "sqrt",
            "set_covariance": text != TRACK, "masked": text != TRACK,
        }.items():  # fmt: skip
            assert any(function in each for each in functions) == there, (name, function)


def bodies(each: Generated) -> dict[str, str]:
    """Function -> its text."""
    source = each.files[f"{each.code.model.spec.name}.c"]
    found = re.findall(r"^(?:static )?\w+ (\w+)\((.*?)^}", source, re.MULTILINE | re.DOTALL)
    return {name.partition("_")[2]: text for name, text in found}


@pytest.mark.parametrize("form", FORMS)
def test_nothing_is_there_that_nothing_asks_for(form):
    """cv4: no branch, no absolute value, no flag, but for what mends a full P; options change the functions that they
    are about, and no other."""
    plain = build(spec_with(problems.CV4, "type: ekf", form, code=""))
    text = plain.files["cv4.c"]
    mends = form.startswith("full")
    assert not re.search(r"GLITCH|ANOMALY|GATED" if mends else r"fabs|flags|GLITCH|ANOMALY|GATED|REGULARIZED", text)
    update = bodies(plain)["update_gnss"]
    if form != "ud-joseph":  # whose Gram-Schmidt may meet a zero
        assert "?" not in update
        assert dict(plain.summary.rows)["update_gnss"]["compare"] == 2
    assert update.count("if (") == (5 if mends else 3)  # NULL, NOT_FINITE, NOT_POSITIVE; what rounding has spoilt
    changed = {
        "type: kf": set(),
        "type: ekf2": set(),
        "type: iekf, iterations: 1": set(),
        "robust: huber": {"update_gnss"},
        "adaptive: true": {"update_gnss"},
        "innovation_floor: 1e-6": {"update_gnss"},
        "adapt_R: 1e-3": {"update_gnss", "init", "get_R_gnss"},
        "adapt_Q: 1e-3": {"update_gnss", "init", "get_Q", "predict"},
        "variance_ceiling: 1e3": {"update_gnss", "predict"},
    }
    if form in JOSEPH:
        changed |= {"gain_limit: 0.9": {"update_gnss"}, "consider: [vx]": {"update_gnss"}}
    if form.startswith("ud"):
        del changed["variance_ceiling: 1e3"]  # keeps the states' order
    for options, functions in changed.items():
        other = bodies(build(spec_with(problems.CV4, options, form, code="")))
        mine = bodies(plain)
        differ = {name for name in mine.keys() | other.keys() if mine.get(name) != other.get(name)}
        assert differ == functions, options
    partial = problems.CV4.replace("  gnss:\n", "  gnss:\n    partial: true\n")
    other = bodies(build(spec_with(partial, "type: ekf", form, code="code: {gate_count: true}")))
    assert other.pop("update_gnss_masked")
    assert other == bodies(plain)
    gated = problems.CV4.replace("  gnss:\n", "  gnss:\n    gate: {probability: 0.99}\n")
    other = bodies(build(spec_with(gated, "type: ekf", form, code="")))
    assert {name for name, text in other.items() if text != bodies(plain)[name]} == {"update_gnss"}
