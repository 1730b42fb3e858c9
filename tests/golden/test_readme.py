"""What the README shows is what kfgen does. `pytest --update` rewrites its piece of C."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from kfgen.generate import generate
from kfgen.spec import loads

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    return generate(loads(blocks("yaml")[0]))


def test_the_c_is_what_is_emitted(files, request):
    shown = blocks("c")[0]
    text = files["altitude.c"].partition("altitude_predict(")[2]
    emitted = "    /* model */" + text.partition("    /* model */")[2].partition("    return ALTITUDE_OK")[0]
    if request.config.getoption("--update"):
        (ROOT / "README.md").write_text(README.replace(shown, emitted))
        return
    assert shown == emitted, "run `pytest --update`"


def test_the_call_compiles(files, tmp_path):
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    assert compiler, "no C compiler"
    for name, text in {**files, "main.c": blocks("c")[1]}.items():
        (tmp_path / name).write_text(text)
    command = [
        compiler,
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Wno-missing-prototypes",
        "-fsyntax-only",
        "main.c",
    ]
    subprocess.run(command, cwd=tmp_path, check=True)


def test_the_python_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    Path("altitude.yaml").write_text(blocks("yaml")[0])
    names = {}
    exec(blocks("python")[0], names)
    assert list(names["result"].status) == [0, 0]
    assert abs(names["ref"].x[0]) < 1.1


def test_commands_and_files_exist():
    from kfgen.cli import cli

    assert set(re.findall(r"^\| `kfgen (\w+)", README, re.MULTILINE)) <= set(cli.commands)
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"\bmake (demo|test|lint|bench|golden)\b", README)) <= targets
    for path in re.findall(r"`((?:tests|specs|kfgen|templates|\.ci)/[\w./]*)`", README):
        assert (ROOT / path).exists(), path
