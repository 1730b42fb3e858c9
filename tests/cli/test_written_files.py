"""What `build` writes, leaves alone, and refuses to write over; the rate of a log under a fixed dt."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from kfgen.seal import is_edited, is_same, sealed

SPEC = """kfgen: 1
name: level
dt: 0.1
states: {x: {init: 0, std: 1}}
dynamics: {f: {x: x}, Q: {x: 0.01}}
measurements: {gauge: {z: {h: {h: x, std: 0.3}}}}
filter: {type: kf}
"""


@pytest.fixture
def kfgen(kfgen, monkeypatch):
    """The real generator at work."""
    monkeypatch.delitem(sys.modules, "kfgen.generate", raising=False)
    Path("level.yaml").write_text(SPEC)
    return kfgen


def written() -> list[Path]:
    return sorted(path for path in Path("generated").rglob("*") if path.is_file())


@pytest.mark.parametrize("layout", ["plain", "cmake", "arduino", "platformio", "zephyr"])
def test_what_is_as_it_should_be_is_left_untouched(kfgen, layout):
    call = ["build", "level.yaml", "--selftest", "--layout", layout]
    assert kfgen(*call).exit_code == 0
    before = {path: path.stat() for path in written()}
    assert len(before) >= 3
    assert not any(is_edited(path.read_text()) for path in before)
    assert kfgen(*call).exit_code == 0
    after = {path: path.stat() for path in written()}
    assert {p: (s.st_mtime_ns, s.st_ino) for p, s in after.items()} == {
        p: (s.st_mtime_ns, s.st_ino) for p, s in before.items()
    }
    for path in before:  # each is guarded
        text = path.read_text()
        path.write_text(text.replace("level", "levl", 1))
        result = kfgen(*call)
        assert result.exit_code == 2, path
        assert str(path) in result.stderr
        path.write_text(text)


def test_what_was_edited_is_refused_unless_forced(kfgen):
    kfgen("build", "level.yaml")
    header, source = (Path(f"generated/level/level.{suffix}") for suffix in "hc")
    text = source.read_text()
    Path("level.yaml").write_text(SPEC.replace("0.01", "0.02"))
    source.write_text(text.replace("kf->x", "kf->x /* mine */", 1))
    before = header.read_bytes(), source.read_bytes()
    result = kfgen("build", "level.yaml")
    assert result.exit_code == 2
    assert "edited by hand" in result.stderr
    assert str(source) in result.stderr
    assert str(header) not in result.stderr
    assert (header.read_bytes(), source.read_bytes()) == before  # all or nothing
    assert kfgen("build", "level.yaml", "--force").exit_code == 0
    assert "mine" not in source.read_text()
    assert kfgen("build", "--check", "level.yaml").exit_code == 0


def test_a_spec_that_changes_writes_anew(kfgen):
    kfgen("build", "level.yaml")
    Path("level.yaml").write_text(SPEC.replace("0.01", "0.02"))
    assert kfgen("build", "level.yaml").exit_code == 0
    assert kfgen("build", "--check", "level.yaml").exit_code == 0


def test_older_files_are_overwritten_and_others_are_not(kfgen):
    kfgen("build", "level.yaml")
    source = Path("generated/level/level.c")
    source.write_text("".join(source.read_text().splitlines(keepends=True)[:-1]))  # from before files had a hash
    assert kfgen("build", "level.yaml").exit_code == 0
    assert source.read_text().splitlines()[-1].startswith("/* kfgen: body ")
    source.write_text("int mine;\n")
    assert kfgen("build", "level.yaml").exit_code == 2
    assert source.read_text() == "int mine;\n"
    source.write_text("")
    assert kfgen("build", "level.yaml").exit_code == 0


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("kfgen 0.", "kfgen 7."),
        lambda text: text.replace("SymPy 1.", "SymPy 3."),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("kfgen 0.", "kfgen 7.").replace("\n", "\r\n"),
    ],
)
def test_a_stamp_is_no_difference(kfgen, change):
    kfgen("build", "level.yaml")
    header = Path("generated/level/level.h")
    header.write_bytes(change(header.read_text()).encode())
    result = kfgen("build", "--check", "level.yaml")
    assert (result.exit_code, result.stdout) == (0, "")
    assert f"{header} differs in its stamp or line ends alone" in result.stderr
    assert kfgen("build", "level.yaml").exit_code == 0
    assert kfgen("build", "--check", "level.yaml").stderr == ""


def test_a_comment_in_the_spec_is_no_difference(kfgen):
    kfgen("build", "level.yaml")
    Path("level.yaml").write_text(SPEC + "# another hash\n")
    assert kfgen("build", "--check", "level.yaml").exit_code == 0


@pytest.mark.parametrize("name", ["a.c", "a.h", "a.ino", "CMakeLists.txt", "x.yml", "library.json", "l.properties"])
def test_a_seal_holds(name):
    text = "a 1\nb\n"
    if name.endswith(".json"):
        text = '{\n  "a": 1,\n  "description": "b (kfgen build c.yaml --layout d)",\n  "e": 2\n}\n'
    elif name.endswith(".properties"):
        text = "a=1\nparagraph=Emitted by: kfgen build c.yaml --layout d\n"
    found = sealed(name, text)
    assert sealed(name, found) == found != text
    assert not is_edited(found)
    assert not is_edited(found.replace("\n", "\r\n"))
    assert is_same(found, found.replace("\n", "\r\n"))
    assert is_edited(found.replace("1", "2", 1).replace("body 2", "body 1"))
    assert is_edited(found + "more\n")
    assert is_edited("more\n" + found)


def test_the_rate_of_a_log_and_a_fixed_step(kfgen):
    Path("slow.csv").write_text("t,gauge.h\n" + "".join(f"{k},1\n" for k in range(50)))
    refused = kfgen("run", "level.yaml", "slow.csv", "-o", "out.csv")
    assert refused.exit_code == 2
    assert "--any-rate" in refused.stderr
    assert not Path("out.csv").exists()
    assert kfgen("run", "level.yaml", "slow.csv", "-o", "out.csv", "--any-rate").exit_code == 0
    assert len(Path("out.csv").read_text().splitlines()) == 51
    Path("twice.csv").write_text("t,gauge.h\n" + "".join(f"{k // 2 / 10},1\n" for k in range(50)))
    Path("once.csv").write_text("t,gauge.h\n" + "".join(f"{k / 10},\n" for k in range(25)))
    assert kfgen("run", "level.yaml", "twice.csv", "-o", "out.csv").exit_code == 0
    assert kfgen("run", "level.yaml", "once.csv", "-o", "none.csv").exit_code == 0
    variances = [float(line.split(",")[2]) for line in Path("none.csv").read_text().splitlines()[1:]]
    assert variances[-1] == pytest.approx(1 + 25 * 0.01)
