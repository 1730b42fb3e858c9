"""The emitted self-tests: they pass on the host and on emulated boards, and they notice what is wrong."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path
from shutil import copytree, which

import pytest

from kfgen.errors import KfgenError
from kfgen.generate import build
from kfgen.override import override
from kfgen.selftest import selftest
from kfgen.selftest.record import record
from kfgen.selftest.track import track_of
from kfgen.spec import load, loads
from tests.boards.machines import BOARDS
from tests.oracle import problems

ROOT = Path(__file__).parents[2]
SPECS = sorted((ROOT / "specs").glob("*.yaml"))
STRICT = [
    "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wshadow",
    "-Wfloat-equal", "-Wundef", "-Werror",
]  # fmt: skip


def files_of(spec) -> dict[str, str]:
    generated = build(spec)
    return {**generated.files, **selftest(spec, generated)}


@pytest.fixture(scope="module")
def everything(tmp_path_factory, once):
    """scalar -> a folder with every spec of the repository and a function `tests` that runs their self-tests."""

    def write(folder: Path, scalar: str) -> None:
        names = []
        for path in SPECS:
            spec = load(path)
            spec = spec if scalar == "own" else override(spec, scalar)
            names.append(spec.name)
            for name, text in files_of(spec).items():
                (folder / name).write_text(text)
        _write_tests(folder, names)

    @cache
    def folder_of(scalar: str) -> Path:
        shared, _ = once(f"everything-{scalar}", lambda folder: write(folder, scalar))
        return Path(copytree(shared, tmp_path_factory.mktemp(scalar), dirs_exist_ok=True))

    return folder_of


def _write_tests(folder: Path, names: list[str]) -> None:
    """tests(): a bit for each filter that departs, in the order of the names."""
    lines = [f"int {name}_selftest(void);" for name in names]
    lines += ["int tests(void);", "int tests(void)", "{", "    int failed = 0;"]
    lines += [f"    if ({name}_selftest() != 0) {{ failed |= {1 << i}; }}" for i, name in enumerate(names)]
    (folder / "tests.c").write_text("\n".join([*lines, "    return failed;", "}", ""]))
    (folder / "main.c").write_text("int tests(void);\nint main(void) { return tests(); }\n")


def run(folder: Path, *command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(part) for part in command], cwd=folder, capture_output=True, text=True, errors="replace", timeout=120
    )


def compiled(folder: Path, *command: str | Path) -> None:
    done = run(folder, *command)
    assert done.returncode == 0, done.stderr[:3000]


def sources(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.c") if path.name != "main.c")


@pytest.mark.parametrize("scalar", ["own", pytest.param("double", marks=pytest.mark.long)])
def test_every_spec_passes_on_the_host(everything, scalar):
    folder = everything(scalar)
    level = "-O1" if scalar == "own" else "-O0"
    compiled(folder, "cc", level, "-std=c99", *STRICT, *sources(folder), "main.c", "-lm", "-o", "tests")
    assert run(folder, "./tests").returncode == 0


def test_banks_are_followed_for_many_steps():
    """A state that is rounded stays that of its mode."""
    spec = loads(problems.IMM3)
    assert len(record(override(spec, "float"), track_of(spec)).x) > 6


@pytest.mark.parametrize("board", ["m4f", *(pytest.param(each, marks=pytest.mark.long) for each in ("m3", "rv32"))])
def test_every_spec_passes_on_an_emulated_board(everything, needs, board):
    needs(*BOARDS[board].tools)
    folder = everything("own")
    assert BOARDS[board].status(folder, [*sources(folder), "main.c"]) == 0


def test_every_spec_passes_on_an_emulated_avr(everything, needs):
    """Constants stay in flash. A double has four bytes there, with which a receiver's position cannot be told."""
    needs(*BOARDS["avr"].tools)
    folder = everything("own")
    too_much = ("ins", "px4")  # for its flash; for an emulator's patience
    names = [path.stem for path in SPECS if path.stem not in too_much]
    for part in (names[k::4] for k in range(4)):  # which does not hold all of them
        _write_tests(folder, part)
        files = [f"{name}{end}.c" for name in part for end in ("", "_selftest")]
        failed = sum(1 << part.index(name) for name in ("gps", "gnss") if name in part)
        assert BOARDS["avr"].status(folder, [*files, "tests.c"], "-Os") == failed
    data = run(folder, "avr-size", "-A", "program.elf").stdout
    used = sum(int(size) for name, size in re.findall(r"^\.(data|bss)\s+(\d+)", data, re.MULTILINE))
    assert used < 64


VARIETY = """
kfgen: 1
name: variety
dt: {nominal: 0.1, min: 0.01, max: 1}
parameters: {gain: 2}
states:
  a: {init: 3.1, std: 0.1, unit: rad, kind: angle}
  b: {init: 1, std: 0.5}
  c: {init: 5, var: 0}
inputs: {push: {range: [-1, 1]}}
dynamics: {form: discrete, f: {a: a + dt*b, b: b + dt*push*c}, Q: {b: 0.1*dt}}
measurements:
  turn: {z: {a: {h: a, std: 0.05, unit: rad, kind: angle}}}
  speed: {partial: true, z: {b: {h: gain*b, std: 0.5}, d: {h: "b*push", std: 0.5}}, gate: {probability: 0.99}}
filter: {type: ekf}
"""
STEADY = """
kfgen: 1
name: steady
dt: 0.1
states: {p: {init: 1, std: 1}, v: {init: 0, std: 1}}
dynamics: {form: discrete, f: {p: p + dt*v, v: v}, Q: {v: 0.1}}
measurements: {gnss: {z: {p: {h: p, std: 1}}}}
filter: {type: kf, gain: steady}
"""


def built(folder: Path, files: dict[str, str], name: str, *options: str) -> Path:
    folder.mkdir(exist_ok=True)
    for file, text in files.items():
        (folder / file).write_text(text)
    (folder / "main.c").write_text(f"int {name}_selftest(void);\nint main(void) {{ return {name}_selftest(); }}\n")
    compiled(folder, "cc", *options, *sources(folder), "main.c", "-lm", "-o", "tests")
    return folder


@pytest.mark.parametrize(("text", "name"), [(VARIETY, "variety"), (STEADY, "steady")])
def test_angles_exact_states_run_time_steps_and_steady_gains(tmp_path, text, name):
    for scalar in ("float", "double", "q16.16"):
        files = files_of(override(loads(text), scalar))
        assert run(built(tmp_path / scalar, files, name, "-O1", "-std=c99", *STRICT), "./tests").returncode == 0


@pytest.mark.parametrize("scalar", ["float", "q16.16"])
def test_it_compiles_as_cplusplus(tmp_path, scalar):
    files = files_of(override(loads(VARIETY), scalar))
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    (tmp_path / "main.cpp").write_text(
        'extern "C" int variety_selftest(void);\nint main() { return variety_selftest(); }'
    )
    compiled(tmp_path, "g++", "-O1", "-Wall", "-Wextra", "-Werror", "-x", "c++", *sources(tmp_path), "main.cpp",
             "-o", "tests")  # fmt: skip
    assert run(tmp_path, "./tests").returncode == 0


def numbers_of(text: str, array: str) -> list[str]:
    return re.findall(rf"{array}\[\d+\][^{{]*{{(.*?)}};", text, re.DOTALL)[0].replace("\n", " ").split(",")


@pytest.mark.parametrize("array", ["states", "variances"])
def test_it_names_the_first_step_that_departs(tmp_path, array):
    files = files_of(loads(VARIETY))
    text = files["variety_selftest.c"]
    numbers = numbers_of(text, f"variety_{array}")
    at = 6 * 3 + 1  # b after the seventh step
    wrong = [*numbers[:at], f" {float(numbers[at].strip().rstrip('f')) * 1.05 + 0.05:.8f}f", *numbers[at + 1 :]]
    old, new = (re.sub(r"\s+", " ", ",".join(part)) for part in (numbers, wrong))
    files["variety_selftest.c"] = re.sub(r"\s+(?=-?[\d.])", " ", text).replace(old.strip(), new.strip())
    assert files["variety_selftest.c"].count(wrong[at].strip()) == 1
    assert run(built(tmp_path, files, "variety", "-O1"), "./tests").returncode == 7


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("kf->x[VARIETY_B] = ", "kf->x[VARIETY_B] = 0.98f * "),  # a wrong prediction or update
        ("kf->D[0] = ", "kf->D[0] = 1.05f * "),
        ("return VARIETY_OK;", "return VARIETY_NOT_FINITE;"),
    ],
)
def test_it_notices_a_wrong_filter(tmp_path, old, new):
    files = files_of(loads(VARIETY))
    assert old in files["variety.c"]
    head, predict, rest = files["variety.c"].partition("variety_predict(")
    files["variety.c"] = head + predict + rest.replace(old, new)
    assert 1 <= run(built(tmp_path, files, "variety", "-O1"), "./tests").returncode <= 3


@pytest.mark.parametrize("scalar", ["float", "double"])
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("return (view.bits & exponent) != exponent;", "return view.bits != 1u;"),  # as if the tests had been removed
        ("if (!variety_finite(dt)) { return VARIETY_NOT_FINITE; }", ""),
        ("return VARIETY_NOT_FINITE;", "{ kf->nis = 7; return VARIETY_NOT_FINITE; }"),
    ],
)
def test_it_notices_what_is_not_refused(tmp_path, scalar, old, new):
    spec = override(loads(VARIETY), scalar)
    files = files_of(spec)
    assert old in files["variety.c"]
    head, found, rest = files["variety.c"].partition("variety_predict(")
    files["variety.c"] = head.replace(old, new) + found + rest.replace(old, new)
    steps = len(record(spec, track_of(spec)).x)
    assert run(built(tmp_path, files, "variety", "-O1"), "./tests").returncode == steps + 1


@pytest.mark.skipif(which("clang") is None, reason="no clang")
@pytest.mark.parametrize("flag", ["-fno-honor-nans", "-fno-honor-infinities"])
def test_tests_by_bits_last(tmp_path, flag):
    """Where no macro tells that a compiler takes numbers for finite."""
    files = files_of(loads(VARIETY))
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    (tmp_path / "main.c").write_text("int variety_selftest(void);\nint main(void) { return variety_selftest(); }\n")
    compiled(tmp_path, "clang", "-O2", flag, *sources(tmp_path), "main.c", "-lm", "-o", "tests")
    assert run(tmp_path, "./tests").returncode == 0


def test_it_is_the_same_text_every_time_and_leaves_the_filter_alone():
    spec = loads(VARIETY)
    assert selftest(spec, build(spec)) == selftest(spec, build(spec))


def test_what_cannot_be_recorded():
    spec = loads(VARIETY.replace("b: b + dt*push*c", "b: b + log(push - 5)"))
    with pytest.raises(KfgenError, match="variety"):
        selftest(spec, build(spec))
