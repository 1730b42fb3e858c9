"""The text of unscented filters: clean under strict compilers, private functions stay private, and what no option
asks for is not there.

A failure here is the emitter's: names, spelling, layout.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache

import numpy as np
from sigma_cases import CYCLE, HEADING, MULTIPLIED, PENDULUM, TANK, join, points, unscented
from test_emitted_c import COMPILERS, WARNINGS, absent, run, write
from variants import built, generated

from kfgen.generate import Generated, build
from kfgen.ir.names import LIBRARY_NAMES
from kfgen.reference import reference
from kfgen.status import ERROR

# states, parameters and components that are named like what the points need
HOSTILE = """
kfgen: 1
name: cloud
scalar: double
dt: 0.5
parameters: {points: 0.5, kept: 0.25, seen: 1}
states:
  point: {init: 1, std: 0.3}
  x: {init: 0.2, std: 0.2}
  shift_x: {init: 0.2, std: 0.2, bounds: [-3, 3]}
  centre: {init: 0, std: 1, kind: angle}
inputs: {z: {}, step: {}}
noise: {mean_x: {std: 0.1}, wm: {std: 0.1}}
dynamics:
  form: discrete
  f: {point: point*(1 + mean_x)*points + 0.1*x*step, x: 0.9*x*(1 + wm) + 0.1*z, centre: centre + 0.1*shift_x}
  Q: {x: 0.01, centre: 0.01}
measurements:
  cloud:
    z:
      x: {h: "point*x*kept + 0.1*middle*x + t/100", std: 0.3}
      dz: {h: centre + shift_x, std: 0.3, kind: angle}
      seen: {h: "shift_x**2 + x", std: 0.3, residual: "seen*(z - h)*kept"}
    noise: {middle: {std: 0.2}}
    partial: true
    gate: {probability: 0.999}
filter: {type: ukf}
"""
VARIANTS = [
    (CYCLE, "full", join("adaptive: {chi2: 1}, adapt_R: 0.05", points("merwe-0.1", redraw=False))),
    (CYCLE, "sqrt", points("custom-centre", redraw=False)),
    (PENDULUM, "ud", points("cubature")),
    (MULTIPLIED, "sequential", "robust: huber, adaptive: true"),
    (HEADING, "sqrt", points("trivial")),
    (TANK, "ud", join("reject: x < 0.1, variance_floor: 1e-9", points("julier-1"))),
    (HOSTILE, "full", join("adaptive: true", points("merwe"))),
]


@cache
def made() -> dict[tuple[str, str, str, str], Generated]:
    keys = [(*key, "float") for key in VARIANTS] + [(*VARIANTS[1], "double")]
    return generated({key: unscented(*key) for key in keys})


def test_clean(tmp_path):
    """As C with all warnings, in part optimised; the whole of it as C++ too."""
    sources = write({name: text for each in made().values() for name, text in each.files.items()}, tmp_path)
    missing = []
    for compiler, standard in COMPILERS.items():
        if shutil.which(compiler) is None:
            missing.append(compiler)
            continue
        language = ["-x", "c++"] if compiler.endswith("++") else []
        run([compiler, standard, *WARNINGS, "-fsyntax-only", *language, *sources], tmp_path)
        if compiler == "gcc":  # optimising finds more: what may be used uninitialised
            small = [source for source in sources if source.startswith("cycle")]
            run([compiler, standard, *WARNINGS, "-O1", "-c", *small], tmp_path)
    if missing:
        absent(", ".join(missing))


def test_what_is_private(tmp_path):
    """The header tells of no function but the filter's own; the object file shows no other symbols."""
    for each in made().values():
        name = each.code.model.spec.name
        header = re.sub(r"/\*.*?\*/", " ", each.files[f"{name}.h"], flags=re.DOTALL)
        private = [function.name for function in each.code.functions if function.private]
        assert private
        for function in private:
            assert f"{name}_{function}(" not in header, function
            assert re.search(rf"^static \w+ {name}_{function}\(", each.files[f"{name}.c"], re.MULTILINE), function
            assert f"{name}_{function}" not in dict(each.summary.rows)
        assert set(re.findall(rf"\b({name}_\w+)\(", header)) == public_of(each)
        kept = each.code.model.spec.filter.sigma_points
        assert (f"{name}_redraw" in public_of(each)) == (kept is not None and not kept.redraw)
    compiler, nm = shutil.which("gcc") or shutil.which("clang"), shutil.which("nm")
    if compiler is None or nm is None:
        absent("compiler or nm")
    each = next(iter(made().values()))
    name = each.code.model.spec.name
    run([compiler, "-std=c99", "-O0", "-c", *write(each.files, tmp_path)], tmp_path)
    lines = subprocess.run([nm, f"{name}.o"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    for line in lines.splitlines():
        kind, symbol = line.split()[-2:]
        if kind == "U":
            assert symbol in LIBRARY_NAMES, symbol
        elif kind.isupper():
            assert kind in "TR", line
            assert symbol in public_of(each), line
        else:
            assert kind in "tr", line  # no data that is written


def public_of(each: Generated) -> set[str]:
    name = each.code.model.spec.name
    return {f"{name}_{f.name}" for f in each.code.functions if not f.private}


def test_layout():
    """At most 100 columns, no tabs, no blanks at the end; points loop, they are not copied."""
    wrong = []
    for each in made().values():
        for name, text in each.files.items():
            for number, line in enumerate(text.splitlines(), 1):
                if len(line) > 100 or "\t" in line or line != line.rstrip():
                    wrong.append(f"{name}:{number}: {line!r}")
        name = each.code.model.spec.name
        source = each.files[f"{name}.c"]
        assert source.count(f"{name}_f(") <= 3, name  # its definition, at the centre, in the loop
    assert not wrong, "\n".join(wrong)


def test_the_header_tells_of_the_points():
    each = made()[*VARIANTS[0], "float"]
    name = each.code.model.spec.name
    header = each.files[f"{name}.h"]
    assert re.search(rf"{name}_real_t points\[\d+\];", header)
    assert re.search(r"bool kept;", header)
    assert f"{name}_status_t {name}_redraw({name}_t *kf);" in header
    plain = build(unscented(CYCLE, "full", points("merwe-0.1")))
    text = "".join(plain.files.values())
    assert "kept" not in text
    assert "redraw" not in text


def test_names_like_those_of_the_points():
    """Fields, arguments and locals are told apart from states, parameters, noises and components of their names."""
    random = np.random.default_rng(5)
    for form, kf in built({form: unscented(HOSTILE, form, "augment: true") for form in ("ud", "sqrt")}).items():
        ref = reference(unscented(HOSTILE, form, "augment: true"))
        for mask in (7, 3, 5, 6):
            u, z = random.normal(size=2), random.normal(0, 0.3, 3)
            assert kf.predict(u) == ref.predict(u) < ERROR
            assert kf.update("cloud", z, mask=mask) == ref.update("cloud", z, mask=mask) < ERROR
        sigma = np.sqrt(ref.P.diagonal())
        assert np.max(np.abs(kf.x - ref.x) / sigma) < 1e-9, form
        assert np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma)) < 1e-9, form
