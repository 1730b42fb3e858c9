"""Whole runs give the same bits everywhere: interpreted, by two compilers at every level, and on five processors.

What is compared is the filters' self-tests: x, the diagonal of P and the flags after each step, as interpreted.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from shutil import copytree
from subprocess import run

import numpy as np
import pytest
from test_filters import TURN

from kfgen.generate import build
from kfgen.override import override
from kfgen.selftest import selftest
from kfgen.selftest.track import Track
from kfgen.simulate import simulate
from kfgen.spec import load, loads
from kfgen.spec.types import Spec
from tests.boards.machines import BOARDS

SPECS = Path(__file__).parents[2] / "specs"
STEPS = 50
OUTLIERS, EXTREMES = {11: 40.0, 12: -7.0, 30: 1000.0}, {41: 1e12, 47: -1e12}
LEVELS = ("-O0", "-O2", "-O3")


def fixed() -> list[Spec]:
    """Of each way to carry a covariance one, one in which influence functions, inflation and functions meet, and one
    with a table and rounding that is carried on.
    """
    cv4, turn = load(SPECS / "cv4.yaml"), "type: ekf, robust: {influence: chernodarov}, adaptive: true"
    return [
        replace(override(cv4, "q16.16", filter={"covariance": "full", "update": "joseph"}), name="cv4_full"),
        override(cv4, "q16.16"),
        override(load(SPECS / "pendulum.yaml"), "q16.16"),
        loads(TURN.replace("type: ekf", turn)),
        override(load(SPECS / "battery.yaml"), "q16.16"),
    ]


def track(spec: Spec) -> Track:
    """Simulated, with readings that are far off, and some beyond what an integer holds."""
    log = simulate(spec, STEPS, seed=3)
    sigma, z = [], []
    for sensor in spec.measurements:
        for each in sensor.components:
            column = log.columns[f"{sensor.name}.{each.name}"]
            sigma.append(np.std(np.diff(column)))
            z.append(column)
    readings = np.column_stack(z)
    for k, factor in {**OUTLIERS, **EXTREMES}.items():
        readings[k] += factor * np.array(sigma)
    u = np.column_stack([log.columns[each.name] for each in spec.inputs]) if spec.inputs else np.empty((STEPS, 0))
    return Track(u, np.zeros(STEPS), readings)


def called(*names: str) -> str:
    """The function `tests`, with a bit for each self-test that departs."""
    lines = ["int tests(void);", *(f"int {name}_selftest(void);" for name in names)]
    terms = " | ".join(f"({name}_selftest() != 0) << {i}" for i, name in enumerate(names))
    return "\n".join([*lines, f"int tests(void) {{ return {terms}; }}", ""])


def written(folder: Path) -> list[str]:
    """Write the filters, their self-tests and what calls them; the names of the sources but main's."""
    specs, files = fixed(), {}
    for spec in specs:
        made = build(spec)
        files |= {**made.files, **selftest(spec, made, track(spec))}
    files["tests.c"] = called(*(spec.name for spec in specs))
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "main.c").write_text("int tests(void);\nint main(void) { return tests(); }\n")
    return sorted(name for name in files if name.endswith(".c"))


@pytest.fixture(scope="module")
def integers(tmp_path_factory, once):
    folder = tmp_path_factory.mktemp("integers")
    shared, sources = once("integers", written)
    copytree(shared, folder, dirs_exist_ok=True)
    return folder, sources


def answered(folder: Path, sources: list[str], compiler: str, *flags: str) -> tuple[int, str]:
    """What the program returns on this machine, and what it prints."""
    done = run([compiler, "-std=c99", *flags, *sources, "main.c", "-lm", "-o", "tests"], cwd=folder,
               capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[:2000]
    told = run(["./tests"], cwd=folder, capture_output=True, text=True, check=False)
    return told.returncode, told.stderr


@pytest.mark.parametrize("level", [*LEVELS[:2], pytest.param("-O3", marks=pytest.mark.long)])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_on_this_machine(integers, needs, compiler, level):
    needs(compiler)
    assert answered(*integers, compiler, level) == (0, "")


# with -O0 nothing is concluded from an overflow anyway: what is compiled is the same without the flag
@pytest.mark.parametrize("level", ["-O2", pytest.param("-O3", marks=pytest.mark.long)])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_where_signed_overflow_wraps(integers, needs, compiler, level):
    """Two of the filters, which have nearly all routines between them."""
    needs(compiler)
    folder, sources = integers
    chosen = [name for name in sources if name.startswith(("cv4_full", "turn"))]
    (folder / "some.c").write_text(called("cv4_full", "turn"))
    assert answered(folder, [*chosen, "some.c"], compiler, level, "-fwrapv") == (0, "")


def test_nothing_undefined(integers, needs):
    needs("gcc")
    checked = ("-fsanitize=undefined", "-fno-sanitize-recover=all")
    assert answered(*integers, "gcc", "-O1", *checked) == (0, "")


@pytest.mark.parametrize("board", [
    "m0", pytest.param("m3", marks=pytest.mark.long), pytest.param("m4", marks=pytest.mark.long), "rv32", "avr"
])  # fmt: skip
def test_on_boards(integers, needs, board):
    folder, sources = integers
    needs(*BOARDS[board].tools)
    assert BOARDS[board].status(folder, sources if board == "avr" else [*sources, "main.c"]) == 0


def test_the_comparison_notices_a_bit(integers):
    """A state that is off by one in its last place, in the last step of one filter."""
    folder, _ = integers
    head, states, rest = (folder / "cv4_selftest.c").read_text().partition("cv4_states[")
    numbers, end, tail = rest.partition("\n};")
    last = numbers.rsplit(" ", 1)[1]
    (folder / "wrong.c").write_text(f"{head}{states}{numbers.removesuffix(last)}{int(last) + 1}{end}{tail}")
    (folder / "only.c").write_text("int cv4_selftest(void);\nint tests(void);\n"
                                   "int tests(void) { return cv4_selftest(); }\n")  # fmt: skip
    assert answered(folder, ["cv4.c", "wrong.c", "only.c"], "cc", "-O0") == (STEPS, "")
