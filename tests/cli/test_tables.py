"""What is printed for a person: folded to a terminal, a line a row elsewhere."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest

from kfgen.commands import tables
from kfgen.commands.progress import progress
from kfgen.commands.tables import Notes, Paths, Table, Verdict, aligned, show

ROWS = [
    ("filter", "function", "flash", "operations"),
    ("vehicle", "update_gnss_masked", "~1466", "95 mul, 70 add, 9 div, 15 compare, 20 select, 1 wrap, 3 atan2"),
    ("vehicle", "predict", "~582", "none"),
]
PATH = "a/folder/of/a/very/long/name/in/which/there/is/another/one/of/a/name/that/is/just/as/long/vehicle.h"
PARTS = ("a line", Table(ROWS, right=(2,)), Notes([("vehicle", "word " * 30)]), Paths([PATH]), Verdict("passed", True))


@pytest.fixture
def terminal(monkeypatch):
    """Prints as on a terminal of 60 columns, though without colour."""
    monkeypatch.setattr(tables, "on_terminal", lambda err=False: True)
    monkeypatch.setenv("COLUMNS", "60")


def test_aligned_columns():
    assert aligned([("a", "n"), ("long", "5"), ("b", "12")], right=(1,)) == [
        "a      n",
        "----  --",
        "long   5",
        "b     12",
    ]


def test_a_row_is_a_line_where_there_is_no_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    show(*PARTS)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 4 + 1 + 1 + 1
    assert lines[3].endswith(ROWS[1][3])


def test_a_terminal_gets_folded_tables(capsys, terminal):
    show(*PARTS)
    text = capsys.readouterr().out
    lines = [line.rstrip() for line in text.splitlines()]
    assert PATH in lines
    assert max(len(line) for line in lines if line != PATH) <= 60
    for phrase in ("update_gnss_masked", "~1466", *ROWS[1][3].split(", ")):
        assert any(phrase in line for line in lines), f"{phrase} is broken"
    assert "\u00a0" not in text


def test_a_narrow_terminal_loses_nothing(capsys, terminal, monkeypatch):
    monkeypatch.setenv("COLUMNS", "24")
    show(Table(ROWS, right=(2,)))
    text = capsys.readouterr().out
    assert "…" not in text
    wanted = sorted("".join(cell for row in ROWS for cell in row).replace(" ", ""))
    assert sorted("".join(text.split()).replace("-", "")) == wanted


def test_progress_is_silent_without_a_terminal(capsys):
    with progress(2) as advance:
        advance(1, "half")
    assert capsys.readouterr() == ("", "")


CALL = "from kfgen.commands.tables import Verdict, show; show(Verdict('FAILED', False))"


@pytest.mark.parametrize(("more", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)])
def test_colour_is_for_terminals_that_want_it(more, coloured):
    ours, theirs = pty.openpty()
    environment = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")}
    environment |= {"TERM": "xterm", **more}
    subprocess.run([sys.executable, "-c", CALL], stdout=theirs, env=environment, check=True)
    os.close(theirs)
    assert (b"\x1b[1;31m" in os.read(ours, 1000)) == coloured
    os.close(ours)


def test_help_and_piped_output_import_no_rich(folder):
    for arguments in (["--help"], ["build", "vehicle_small.yaml"]):
        call = f"import sys; from kfgen.cli import cli; cli({arguments!r}, standalone_mode=False); print(*sys.modules)"
        done = subprocess.run([sys.executable, "-c", call], stdout=subprocess.PIPE, text=True, check=True)
        assert "rich" not in done.stdout.splitlines()[-1].split()
