"""The examples' C before analyzers: MISRA C:2012 by cppcheck's addon, gcc -fanalyzer, clang's static analyzer.

DEVIATIONS is the README's table: rules that the emitted C breaks on purpose, all of them advisory. Any other finding
is a failure.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "generated").glob("*/*.c"))
DEVIATIONS = {"2.4", "2.5", "8.9", "12.1", "15.5", "17.8", "19.2"}
LARGE = 20_000  # bytes from which on cppcheck takes its time
FLAGS = ["-std=c99", "-Wall", "-Wextra"]


def report(*call: str | Path) -> str:
    done = subprocess.run([str(part) for part in call], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.mark.parametrize("source", [
    pytest.param(path, marks=[pytest.mark.long] if path.stat().st_size > LARGE else []) for path in SOURCES
], ids=lambda path: path.stem)  # fmt: skip
def test_misra(needs, source, tmp_path):
    needs("cppcheck")
    copy = shutil.copytree(source.parent, tmp_path / source.stem) / source.name  # its dumps lie beside it
    # -U: these are other translation units, which the compilers of those targets see
    elsewhere = ["-U__AVR__", "-U__FAST_MATH__", "-U__cplusplus"]
    options = ["--quiet", "--std=c99", "--addon=misra", "--enable=warning,portability", *elsewhere]
    text = report("cppcheck", *options, copy)
    rules = set(re.findall(r"\[misra-c2012-([\d.]+)\]", text))
    assert rules - DEVIATIONS == set(), text
    others = [line for line in text.splitlines() if re.search(r": (error|warning|portability): .*\[\w+\]$", line)]
    assert others == []


def test_the_deviations_are_those_of_the_readme():
    table = re.findall(r"^\| (\d+\.\d+) \|", (ROOT / "README.md").read_text(), flags=re.MULTILINE)
    assert set(table) == DEVIATIONS


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_gcc_analyzer(needs, source):
    needs("gcc")
    assert report("gcc", *FLAGS, "-O1", "-fanalyzer", "-c", "-o", "/dev/null", source) == ""


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_clang_analyzer(needs, source):
    needs("clang")
    assert report("clang", *FLAGS, "--analyze", "--analyzer-output", "text", "-o", "/dev/null", source) == ""
