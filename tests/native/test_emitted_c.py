"""The emitted text: clean under strict compilers, as C and as C++, self-contained, the same on every run.

A failure here is the emitter's: names, spelling, layout.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest
from emitted import ALL, EXACT, FORMS, LIBM, SCALARS, generated

from kfgen.generate import build, generate
from kfgen.ir.names import LIBRARY_NAMES
from kfgen.native import load_filters
from kfgen.override import override
from kfgen.reference import reference
from kfgen.spec import loads

WARNINGS = ["-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wshadow"]
WARNINGS += ["-Wfloat-equal", "-Wundef", "-Werror"]
COMPILERS = {"gcc": "-std=c99", "clang": "-std=c99", "g++": "-std=c++11", "clang++": "-std=c++11"}

# names that the emitted code, libm or the C library use for something else
HOSTILE = r"""
kfgen: 1
name: y0
dt: {nominal: 0.1, min: 0.01}
description: |
  Ends no comment */ and opens none /* , starts no trigraph ??/ nor ???/ , 100 % of a path C:\dir\
  in µT at 20 °C. WORD
  https://example.org/a/rather/long/address/that/stands/in/the/second/line/and/goes/on/and/on/beyond/the/hundredth/column
parameters:
  px_next: {value: 0.5, unit: "m*/s", doc: "what ??/ and \\ do"}
  q: {value: 0.25, unit: "°/√h", doc: "%s %d %n"}
  flags: 0.5
  d_h: 1
states:
  y1: {init: 0, std: 1, unit: "µm", doc: "*/ int main(void) { return 1; } /*"}
  j0: {init: 0, std: 1, unit: "°C", doc: "ends in a question????/"}
  gamma: {init: 0, std: 1, doc: "LONG_DOC"}
  t0: {init: 0, std: 1}
  nis: {init: 0, std: 1}
  flags2: {init: 0, std: 1, kind: {periodic: 9}, unit: "\\", doc: "ends in a backslash \\"}
  h: {init: 0, std: 1}
  s: {init: 0, std: 1, bounds: [-9, 9]}
  s_x: {init: 0, std: 1}
inputs: {z: {unit: "*/"}, kf: {}, dt_: {}}
let: {sin_h: sin(h), t2: gamma + t0}
dynamics:
  form: discrete
  f:
    y1: y1 + dt*j0 + 0.1*where(y1 > 0, sin_h, t2)
    j0: 0.9*j0 + dt*gamma + t/100
    gamma: 0.9*gamma + dt*t0*px_next + 0.1*sin_h
    h: 0.9*h + 0.01*s_x*s + z + d_h*0.01
    s: 0.9*s + 0.01*h**2 + 0.01*kf
  Q: {y1: q, j0: flags**2, s: 0.1}
measurements:
  z:
    z: {z: {h: y1 + nis}, x: {h: y1 + flags2, kind: {periodic: 9}}, nis: {h: h*s + t0}, y1: {h: s_x}}
    R: [[1, 0.1, 0, 0], [0.1, 1, 0, 0], [0, 0, 1, "0.1*q"], [0, 0, "0.1*q", 1]]
    gate: {probability: 0.9999}
  kf:
    z: {s: {h: s_x + kf*y1, std: 1}, flags: {h: t2 + nis, std: 1}}
filter: {type: ekf}
""".replace("WORD", "a_word_that_no_line_could_hold_and_that_can_not_be_broken_anywhere_" * 2).replace(
    "LONG_DOC", "a documentation that goes on for longer than the line that it has to fit into " * 2
)
HOSTILE_TOO = """
kfgen: 1
name: gamma
dt: 0.1
states:
  step: {init: 0, std: 1}
  p: {init: 0, std: 1}
  w: {init: 0, std: 1}
  sum: {init: 0, std: 1}
  u1: {init: 0, std: 1}
  t1: {init: 0, std: 1}
  x: {init: 0, std: 1}
  x_1: {init: 0, std: 1}
  D: {init: 0, std: 1}
  u: {init: 0, std: 1}
parameters: {order: 0.25, f_p_w: 1, round_off: 0.1}
let: {value: p + 0.1*w, total: sum - u, d: t1*u1}
dynamics:
  form: discrete
  f:
    p: 0.5*p + 0.1*w*u1 + round_off
    w: 0.5*w + 0.1*tanh(p)
    x: 0.5*x + 0.1*x_1 + 0.01*d
    x_1: 0.5*x_1 + 0.1*D*f_p_w
    D: 0.5*D + 0.1*u
  Q: {x: 0.1, D: order, step: 0.1}
measurements:
  order:
    z: {k: {h: value + x, std: 1}, j: {h: total + step*D, std: 1}, i: {h: t1 + u1, std: 1}}
filter: {type: ekf}
"""

LONG = "a_name_of_some_thirty_letters"
LONGER = f"""
kfgen: 1
name: {LONG}
dt: {{nominal: 0.1, min: 0.01, max: 2}}
description: A title that is about as long as a line may be when it is to be filled with words to the very end
parameters: {{{LONG.replace("name", "parm")}: 1}}
states:
  {LONG}: {{init: 0, std: 1, kind: angle}}
  {LONG.replace("name", "rate")}: {{init: 0, std: 1, bounds: [-1e6, 1e6]}}
inputs: {{{LONG.replace("name", "push")}: {{unit: a unit that is longer than it is useful and has words}}}}
dynamics:
  form: discrete
  f:
    {LONG}: "{LONG} + dt*{LONG.replace("name", "rate")} + table({LONG.replace("name", "push")}, [0, 1], [0, 1])"
    {LONG.replace("name", "rate")}: "max(min({LONG.replace("name", "rate")}, 5), -5)*sign({LONG})"
  Q: {{{LONG}: {LONG.replace("name", "parm")}}}
measurements:
  {LONG.replace("name", "sens")}:
    z: {{{LONG.replace("name", "comp")}: {{h: "{LONG} + table({LONG}, [0, 1], [0, 1])", std: 1, kind: angle}}}}
    gate: {{probability: 0.999}}
filter: {{type: ekf, variance_ceiling: 1e6}}
"""

TYPES = ["uint8", "int32", "size", "ptrdiff", "wchar", "uintmax", "intptr", "max_align"]
TINY = """
kfgen: 1
name: {name}
states: {{x: {{init: 1, var: 1}}}}
dynamics: {{form: discrete, f: {{x: 0.5*x}}, Q: {{x: 1}}}}
measurements: {{s: {{z: {{z: {{h: x, std: 1}}}}}}}}
filter: {{type: ekf}}
"""


@cache
def hostile(form: str) -> dict[str, str]:
    files: dict[str, str] = {}
    for text in (HOSTILE, HOSTILE_TOO, LONGER):
        files |= generate(override(loads(text), "float", filter=FORMS[form]))
    return files


def everything(form: str) -> dict[str, str]:
    files = hostile(form)
    for scalar in SCALARS:
        for name in (*EXACT, *LIBM) if scalar == "float" else ("switches", "run_time", "functions"):
            files |= generated(name, form, scalar).files
    return files


def write(files: Mapping[str, str], folder: Path) -> list[str]:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return sorted(name for name in files if name.endswith(".c"))


def run(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:1500]


def absent(tool: str) -> None:
    """Skip where a tool is missing, but in CI, which has to bring it."""
    pytest.fail(f"no {tool}") if os.environ.get("CI") else pytest.skip(f"no {tool}")


# by other compilers than gcc in one form: the others spell nothing new
@pytest.mark.parametrize(
    ("form", "compiler"),
    [*((form, "gcc") for form in FORMS), ("ud-bierman", "g++"), ("full-joseph", "clang"), ("ud-bierman", "clang++")],
)
def test_clean(form, compiler, tmp_path):
    if shutil.which(compiler) is None:
        absent(compiler)
    sources = write(everything(form), tmp_path)
    language = ["-x", "c++"] if compiler.endswith("++") else []
    # optimising finds more (what may be used uninitialised), parsing costs less
    level = ["-O1", "-c"] if compiler == "gcc" and form == "ud-bierman" else ["-fsyntax-only"]
    run([compiler, COMPILERS[compiler], *WARNINGS, *level, *language, *sources], tmp_path)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_fast_math_is_refused(compiler, tmp_path):
    if shutil.which(compiler) is None:
        absent(compiler)
    source = write(generated("cv4", "ud-bierman", "float").files, tmp_path)[0]
    done = subprocess.run(
        [compiler, "-std=c99", "-ffast-math", "-fsyntax-only", source], cwd=tmp_path, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode != 0
    assert "ffast-math" in done.stderr


def test_symbols_and_macros(tmp_path):
    """Every external symbol and every macro carries the filter's name; nothing is needed but libm."""
    compiler = shutil.which("gcc") or shutil.which("clang")
    nm = shutil.which("nm")
    if compiler is None or nm is None:
        absent("compiler or nm")
    for form in ("ud-bierman",):
        files = everything(form)
        sources = write(files, tmp_path)
        run([compiler, "-std=c99", "-O0", "-c", *sources], tmp_path)
        for source in sources:
            name = source.removesuffix(".c")
            out = subprocess.run([nm, f"{name}.o"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
            for line in out.splitlines():
                kind, symbol = line.split()[-2:]
                if kind == "U":
                    assert symbol in LIBRARY_NAMES | {"sincos", "sincosf"}, f"{name}.o needs {symbol}"
                elif kind.isupper():
                    assert kind in "TR", f"{name}.o: {line}"
                    assert symbol.startswith(f"{name}_")
                else:
                    assert kind in "tr", f"{name}.o holds data: {line}"
                    assert symbol.startswith((f"{name}_", ".")), f"{name}.o: {line}"
            text = files[f"{name}.h"] + files[source]
            for macro in re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+)", text, re.MULTILINE):
                assert macro.startswith(f"{name.upper()}_")


@pytest.mark.parametrize("form", FORMS)
def test_layout(form):
    """At most 100 columns, no tabs, no blanks at the end, one newline at the end, no trace of the machine."""
    wrong = []
    for name, text in everything(form).items():
        assert text.endswith("\n"), name
        assert not text.endswith("\n\n"), name
        assert "\r" not in text, name
        assert str(Path.cwd()) not in text, name
        assert not re.search(r"\b(19|20)\d\d-\d\d-\d\d\b|\b\d\d:\d\d:\d\d\b|/home/|/tmp/", text), name
        for number, line in enumerate(text.splitlines(), 1):
            words = [word for word in line.split() if len(word) > 60]  # what cannot be broken may stick out
            if len(line) > 100 and not words:
                wrong.append(f"{name}:{number}: {len(line)} columns: {line}")
            if "\t" in line or line != line.rstrip():
                wrong.append(f"{name}:{number}: blanks: {line!r}")
    assert not wrong, "\n".join(wrong)


def test_free_text_cannot_leave_its_comment():
    """Units and documentation are text: outside of comments nothing of it is left."""
    spec = loads(HOSTILE)
    for name, text in generate(spec).items():
        code = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL)
        assert "main" not in code, name
        assert "%" not in code, name
        assert "\\" not in code, name
        assert "??" not in text, name
        text.encode("utf-8")


@pytest.mark.parametrize("form", FORMS)
def test_hostile_names_compute_the_right_thing(form):
    """Locals, fields and arguments that share a name with a state are still told apart."""
    specs = [override(loads(text), "double", filter=FORMS[form]) for text in (HOSTILE, HOSTILE_TOO)]
    filters = load_filters([build(spec) for spec in specs], flags=["-O0"])
    for spec, kf in zip(specs, filters, strict=True):
        ref = reference(spec)
        for k in range(20):
            u = [0.1 * (k % 3), -0.05 * k, 0.1]
            if spec.inputs:
                assert kf.predict(u, 0.1) == ref.predict(u, 0.1)
                assert kf.update("z", [0.1 * k, 1, 0.2, 0.1]) == ref.update("z", [0.1 * k, 1, 0.2, 0.1])
                assert kf.update("kf", [0.3, 0.1 * k], u) == ref.update("kf", [0.3, 0.1 * k], u)
            else:
                assert kf.predict() == ref.predict()
                assert kf.update("order", [0.1 * k, 0.2, -0.1]) == ref.update("order", [0.1 * k, 0.2, -0.1])
        assert abs(kf.x - ref.x).max() < 1e-9
        assert abs(kf.P - ref.P).max() < 1e-9
        assert abs(kf.nis - ref.nis) < 1e-9


@pytest.mark.parametrize("name", TYPES)
def test_a_filter_named_like_a_standard_type(name, tmp_path):
    """`uint8` would make uint8_t: either the spec is refused, or what it makes compiles."""
    from kfgen.errors import SpecError

    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        absent("compiler")
    try:
        files = generate(loads(TINY.format(name=name)))
    except SpecError:
        return
    run([compiler, "-std=c99", *WARNINGS, "-fsyntax-only", *write(files, tmp_path)], tmp_path)


def test_numbers_too_large_for_the_scalar_are_the_specs_mistake():
    """1e39 is no float: a SpecError with its place, not a crash; as a double it is a number."""
    from kfgen.errors import KfgenError

    text = TINY.format(name="large").replace("x: 0.5*x", "x: 0.5*x + 1e39")
    assert "1e39" in "".join(generate(loads(text), "double").values()).replace("1.0e39", "1e39")
    with pytest.raises(KfgenError):
        generate(loads(text), "float")


def test_the_same_bytes_under_every_hash_seed(tmp_path):
    """Also from another folder and with another clock and locale."""
    script = (
        "import sys; from kfgen.spec import loads; from kfgen.generate import generate\n"
        "for name in sys.argv[1:]:\n"
        "    text = open(name, encoding='utf-8').read()\n"
        "    for scalar in ('float', 'double'):\n"
        "        print(repr(sorted(generate(loads(text), scalar).items())))\n"
    )
    root = str(Path(generate.__code__.co_filename).parents[1])
    texts = {"switches": ALL["switches"], "run_time": ALL["run_time"], "hostile": HOSTILE}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    seed = "4242" if os.environ.get("PYTHONHASHSEED") != "4242" else "0"  # another one than this process has
    environment = {**os.environ, "PYTHONHASHSEED": seed, "TZ": "Asia/Tokyo", "PYTHONPATH": root, "USER": f"u{seed}"}
    environment["PYTHONIOENCODING"] = "utf-8"
    command = [sys.executable, "-c", script, *texts]
    done = subprocess.run(command, cwd=tmp_path, env=environment, encoding="utf-8", capture_output=True, check=True)
    own = [generate(loads(text), scalar) for text in texts.values() for scalar in ("float", "double")]
    assert done.stdout.splitlines() == [repr(sorted(files.items())) for files in own]
