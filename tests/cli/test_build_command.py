from __future__ import annotations

from pathlib import Path

import pytest

SPEC = "vehicle_small.yaml"

TABLE = """\
filter         scalar  size                                     RAM
-------------  ------  --------------------------------------  ----
vehicle_small  float   3 states, 1 input, gnss: 2, compass: 1  48 B

filter         function     flash  stack  operations
-------------  -----------  -----  -----  ---------------------
vehicle_small  predict       ~400    ~40  31 mul, 27 add, 1 sin
vehicle_small  update_gnss   ~700    ~64  2 div

vehicle_small: states are kept in the order px, py, th
vehicle_small: about 1160 bytes of flash, about 64 bytes of stack on a Cortex-M4F, as predicted; `kfgen cost` measures

generated/vehicle_small/vehicle_small.h
generated/vehicle_small/vehicle_small.c
"""


def test_writes_the_files_and_prints_a_table(kfgen, folder):
    result = kfgen("build", SPEC)
    assert result.exit_code == 0
    assert result.stderr == ""
    written = folder / "generated" / "vehicle_small"
    assert sorted(path.name for path in written.iterdir()) == ["vehicle_small.c", "vehicle_small.h"]
    assert result.stdout == TABLE


def test_elsewhere_and_with_another_scalar(kfgen, folder):
    assert kfgen("build", SPEC, "-o", "src/kf", "--scalar", "double").exit_code == 0
    assert "typedef double" in (folder / "src/kf/vehicle_small/vehicle_small.h").read_text()


def test_check_tells_what_differs(kfgen, folder):
    missing = kfgen("build", "--check", SPEC)
    assert missing.exit_code == 1
    assert "--- /dev/null" in missing.stdout
    assert not (folder / "generated").exists()
    kfgen("build", SPEC)
    clean = kfgen("build", "--check", SPEC)
    assert (clean.exit_code, clean.output) == (0, "")
    path = folder / "generated/vehicle_small/vehicle_small.c"
    path.write_text(path.read_text().replace("0.64f", "0.65f"))
    before = path.read_bytes()
    changed = kfgen("build", "--check", SPEC)
    assert changed.exit_code == 1
    assert "0.65f" in [line for line in changed.stdout.splitlines() if line.startswith("-")][1]
    assert "0.64f" in [line for line in changed.stdout.splitlines() if line.startswith("+")][1]
    assert "1 file differs" in changed.stderr
    assert path.read_bytes() == before


def test_check_tells_line_ends(kfgen, folder):
    kfgen("build", SPEC)
    path = folder / "generated/vehicle_small/vehicle_small.h"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    result = kfgen("build", "--check", SPEC)
    assert (result.exit_code, result.stdout) == (0, "")
    assert "differs in its stamp or line ends alone" in result.stderr


def test_all_specs_are_checked_before_anything_is_written(kfgen, folder):
    text = Path(SPEC).read_text()
    Path("a.yaml").write_text(text.replace("name: vehicle_small", "name: a").replace("std: 0.1", "std: -1"))
    Path("b.yaml").write_text(text.replace("name: vehicle_small", "name: b").replace("inputs:", "input:"))
    result = kfgen("build", SPEC, "a.yaml", "b.yaml")
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "a.yaml:" in result.stderr
    assert "b.yaml:" in result.stderr
    assert not (folder / "generated").exists()


def test_two_of_one_name(kfgen, folder):
    Path("twin.yaml").write_text(Path(SPEC).read_text())
    result = kfgen("build", SPEC, "twin.yaml")
    assert result.exit_code == 2
    assert "twin.yaml are both named `vehicle_small`" in result.stderr
    assert not (folder / "generated").exists()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["build"], "Missing argument"),
        (["build", "nowhere.yaml"], "nowhere.yaml"),
        (["build", SPEC, "--scalar", "half"], "scalar `half` is unknown"),
        (["build", SPEC, "--layout", "x"], "'x' is not one of 'arduino', 'cmake', 'plain', 'platformio', 'zephyr'"),
        (["build", SPEC, "-o", "file/below"], "file"),
        (["build", SPEC, "--nothing"], "No such option"),
        (["nothing"], "No such command"),
        (["cost", SPEC, "--target", "z80"], "target `z80` is unknown; write one of avr, cortex-m4f"),
    ],
)
def test_wrong_calls_exit_2(kfgen, folder, arguments, text):
    (folder / "file").write_text("")
    result = kfgen(*arguments)
    assert result.exit_code == 2
    assert text in result.stderr
    assert result.stdout == ""


def test_advice_is_told_but_not_fatal(kfgen):
    told = "vehicle_small.yaml:4:20: warning: constants.spare: nothing uses the constant `spare`; use it, or remove it "
    Path(SPEC).write_text(Path(SPEC).read_text().replace("{speed: 5}", "{spare: 1, speed: 5}"))
    for call in (["build"], ["build", "--check"], ["check"]):
        result = kfgen(*call, SPEC)
        assert (result.exit_code, result.stderr) == (0, f"{told}[unused]\n")
        assert kfgen(*call, SPEC, "--quiet").stderr == ""
    Path(SPEC).write_text(Path(SPEC).read_text() + "advice: [unused]\n")
    assert kfgen("build", SPEC).stderr == ""


def test_the_language_page(kfgen):
    result = kfgen("language")
    assert result.exit_code == 0
    assert result.stdout.startswith("# ")
    assert "measurements" in result.stdout
