from __future__ import annotations

import csv
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

SPEC = "vehicle_small.yaml"


def rows_of(text):
    return list(csv.DictReader(text.splitlines()))


@pytest.fixture
def log(kfgen):
    assert kfgen("simulate", SPEC, "-o", "log.csv", "--steps", "40", "--every", "gnss=2").exit_code == 0
    return "log.csv"


def test_simulate_says_where_the_truth_leaves_a_range(kfgen, tmp_path):
    text = """
kfgen: 1
name: wander
scalar: q16.16
dt: 0.1
states: {p: {init: 0, std: 5, range: [-20, 20]}, v: {init: 0, std: 2}}
dynamics: {f: {p: p + dt*v}, Q: {v: 0.5}}
measurements: {m: {z: {p: {h: p, std: 0.5}}}}
filter: {type: kf}
"""
    (tmp_path / "wander.yaml").write_text(text)
    done = kfgen("simulate", "wander.yaml", "-o", "wander.csv", "--steps", "300")
    assert done.exit_code == 0
    assert "warning: states.p: the simulated `p` goes from" in done.stderr
    assert "outside of its range [-20, 20] in 80.7% of the rows" in done.stderr
    assert "`v`" not in done.stderr
    (tmp_path / "wander.yaml").write_text(text.replace("20, 20", "2000, 2000"))
    assert kfgen("simulate", "wander.yaml", "-o", "wander.csv").stderr == ""


def test_simulate_writes_the_same_log_for_a_seed(kfgen, log):
    first = Path(log).read_bytes()
    rows = rows_of(first.decode())
    assert len(rows) == 40
    assert list(rows[0]) == [
        "t", "gyro", "gnss.x", "gnss.y", "compass.heading", "true.px", "true.py", "true.th",
    ]  # fmt: skip
    assert rows[0]["gnss.x"] != ""
    assert rows[1]["gnss.x"] == ""
    kfgen("simulate", SPEC, "-o", "again.csv", "--steps", "40", "--every", "gnss=2", "--seed", "0")
    assert Path("again.csv").read_bytes() == first
    kfgen("simulate", SPEC, "-o", "other.csv", "--steps", "40", "--every", "gnss=2", "--seed", "1")
    assert Path("other.csv").read_bytes() != first


def test_run_writes_the_estimates(kfgen, log):
    result = kfgen("run", SPEC, log, "-o", "out.csv")
    assert (result.exit_code, result.output) == (0, "")
    rows = rows_of(Path("out.csv").read_text())
    assert list(rows[0]) == [
        "t", "x.px", "x.py", "x.th", "var.px", "var.py", "var.th", "nis.gnss", "nis.compass", "status",
    ]  # fmt: skip
    assert len(rows) == 40
    assert rows[0]["nis.gnss"] != ""
    assert rows[1]["nis.gnss"] == ""
    truth = rows_of(Path(log).read_text())
    error = [float(row["x.px"]) - float(true["true.px"]) for row, true in zip(rows, truth, strict=True)]
    assert np.std(error) < 1
    # printed in the filter's own precision
    assert np.float32(rows[5]["x.px"]) == float(np.float32(rows[5]["x.px"]))
    assert len(rows[5]["x.px"]) < 14


def test_run_without_a_file_prints(kfgen, log):
    result = kfgen("run", SPEC, log)
    assert result.exit_code == 0
    assert len(rows_of(result.stdout)) == 40


def test_run_in_double(kfgen, log):
    single, double = (rows_of(kfgen("run", SPEC, log, "--scalar", s).stdout) for s in ("float", "double"))
    assert float(single[-1]["x.px"]) != float(double[-1]["x.px"])
    assert float(single[-1]["x.px"]) == pytest.approx(float(double[-1]["x.px"]), abs=1e-3)


def test_errors_of_the_filter_are_counted_on_stderr(kfgen, log):
    Path("bad.csv").write_text(
        "t,gyro,gnss.x,gnss.y,compass.heading,note\n1,0,0,0,0,a\n0.5,0,inf,0,0,b\n0.6,0,900,0,,\n"
    )
    result = kfgen("run", SPEC, "bad.csv")
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [
        "kfgen: ignored columns of bad.csv: note",
        "kfgen: predict: error NOT_POSITIVE 1x in 3 rows",
        "kfgen: update_gnss: error NOT_FINITE 1x in 3 rows",
        "kfgen: update_gnss: warning GATED 1x in 3 rows",
    ]
    assert [row["status"] for row in rows_of(result.stdout)] == ["0", str(0x600), "16"]


@pytest.mark.parametrize("path", ["log.csv", "./log.csv", "link.csv", "hard.csv", SPEC])
def test_nothing_is_written_over_what_is_read(kfgen, log, path):
    Path("link.csv").symlink_to("log.csv")
    os.link("log.csv", "hard.csv")
    before = Path(log).read_bytes(), Path(SPEC).read_bytes()
    for option in ("-o", "--plot"):
        result = kfgen("run", SPEC, log, option, path)
        assert result.exit_code == 2
        assert "would overwrite" in result.stderr
    assert kfgen("run", SPEC, log, "-o", "a", "--plot", "./a").exit_code == 2
    assert kfgen("simulate", SPEC, "-o", SPEC).exit_code == 2
    assert (Path(log).read_bytes(), Path(SPEC).read_bytes()) == before
    assert kfgen("run", SPEC, log, "-o", "/dev/null").exit_code == 0


def test_a_log_of_another_rate_than_a_fixed_dt(kfgen, log):
    fixed = Path(SPEC).read_text()
    start = fixed.index("dt: ")
    fixed = fixed[:start] + "dt: 0.1" + fixed[fixed.index("\n", start) :]
    Path("fixed.yaml").write_text(fixed)
    text = Path(log).read_text().splitlines()
    slow = [text[0], *(f"{5 * k}," + row.partition(",")[2] for k, row in enumerate(text[1:]))]
    Path("slow.csv").write_text("\n".join(slow) + "\n")
    assert kfgen("run", SPEC, "slow.csv").exit_code == 0  # dt is an argument
    result = kfgen("run", "fixed.yaml", "slow.csv", "-o", "out.csv")
    assert result.exit_code == 2
    assert "usual step of t is 5 s, but dt is 0.1 s" in result.stderr
    assert not Path("out.csv").exists()


def test_every_update_failed(kfgen, log):
    Path("bad.csv").write_text("t,gyro,gnss.x,gnss.y,compass.heading\n1,0,inf,0,\n2,0,,,inf\n")
    result = kfgen("run", SPEC, "bad.csv", "-o", "out.csv")
    assert result.exit_code == 1
    assert result.stderr.splitlines()[-1] == "kfgen: every update failed"
    assert Path("out.csv").exists()
    Path("none.csv").write_text("t,gyro,gnss.x,gnss.y,compass.heading\n1,0,,,\n2,0,,,\n")
    assert kfgen("run", SPEC, "none.csv").exit_code == 0


def test_a_plot(kfgen, log):
    pytest.importorskip("matplotlib")
    result = kfgen("run", SPEC, log, "--plot", "out.png")
    assert (result.exit_code, result.output) == (0, "")
    assert Path("out.png").read_bytes().startswith(b"\x89PNG")
    assert kfgen("run", SPEC, log, "--plot", "out.doc").exit_code == 2
    assert not Path("out.doc").exists()


def test_a_plot_without_matplotlib(kfgen, log, monkeypatch):
    monkeypatch.setattr("kfgen.plot.find_spec", lambda name: None)
    result = kfgen("run", SPEC, log, "--plot", "out.png")
    assert result.exit_code == 2
    assert "kfgen[plot]" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["run", SPEC, "nowhere.csv"], "nowhere.csv: No such file"),
        (["run", SPEC, "."], "Is a directory"),
        (["run", SPEC, SPEC], "2 cells, but the header has 1"),
        (["run", SPEC, "other.csv"], "other.csv: column `t`, `gyro`"),
        (["run", SPEC, "text.csv"], "text.csv:2: column `gyro`: 'fast' is not a number"),
        (["run", SPEC, "log.csv", "-o", "text.csv/below.csv"], "text.csv"),
        (["run", SPEC], "Missing argument"),
        (["simulate", SPEC], "Missing option '-o'"),
        (["simulate", SPEC, "-o", "x.csv", "--steps", "0"], "--steps"),
        (["simulate", SPEC, "-o", "x.csv", "--every", "gnss"], "SENSOR=N"),
        (["simulate", SPEC, "-o", "x.csv", "--every", "gps=2"], "unknown sensor `gps`"),
        (["simulate", "nowhere.yaml", "-o", "x.csv"], "nowhere.yaml"),
        (["check", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_wrong_surroundings_exit_2(kfgen, log, arguments, text):
    Path("other.csv").write_text("time,speed\n0,1\n")
    Path("text.csv").write_text("t,gyro,gnss.x,gnss.y,compass.heading\n0,fast,0,0,0\n")
    result = kfgen(*arguments)
    assert result.exit_code == 2
    assert text in result.stderr
    assert not Path("x.csv").exists()


def test_no_compiler(kfgen, log, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    for call in (["run", SPEC, log], ["check", SPEC]):
        result = kfgen(*call)
        assert result.exit_code == 2
        assert "no-such-compiler" in result.stderr


def test_check_passes(kfgen):
    result = kfgen("check", SPEC)
    assert result.exit_code == 0
    assert "vehicle_small (float): 400 steps" in result.stdout
    assert "tolerance 2e-03: passed" in result.stdout


def test_check_fails(kfgen, monkeypatch):
    module = sys.modules["kfgen.generate"]
    right = module.build

    def wrong(spec):
        made = right(spec)
        return replace(made, files={name: text.replace("0.64f", "0.7f") for name, text in made.files.items()})

    monkeypatch.setattr(module, "build", wrong)
    result = kfgen("check", SPEC)
    assert result.exit_code == 1
    assert "FAILED" in result.stdout


@pytest.mark.parametrize("command", [[], ["build"], ["check"], ["run"], ["simulate"], ["cost"], ["language"]])
def test_help_shows_an_example(kfgen, command):
    result = kfgen(*command, "--help")
    assert result.exit_code == 0
    assert "Example:" in result.stdout
    assert "kfgen " + " ".join(command) in result.stdout.split("Example:")[1]


def test_an_interrupt_has_no_traceback(kfgen, log, monkeypatch):
    def interrupted(*arguments, **keywords):
        raise KeyboardInterrupt

    monkeypatch.setattr("kfgen.logs.read", interrupted)
    result = kfgen("run", SPEC, log)
    assert result.exit_code == 130
    assert "interrupted" in result.stderr


def test_a_bug_is_one_line_and_asks_for_a_report(kfgen, log, monkeypatch):
    def broken(*arguments, **keywords):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr("kfgen.logs.read", broken)
    result = kfgen("run", SPEC, log)
    assert result.exit_code == 2
    assert "internal error: ZeroDivisionError: oops" in result.stderr
    monkeypatch.setenv("KFGEN_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        kfgen("run", SPEC, log)


@pytest.mark.parametrize("command", ["language", "--help"])
def test_a_reader_that_has_gone_away(folder, command):
    reader, writer = os.pipe()
    os.close(reader)
    call = [sys.executable, "-m", "kfgen", command]
    done = subprocess.run(call, stdout=writer, stderr=subprocess.PIPE, check=False)
    os.close(writer)
    assert done.returncode != 0
    assert done.stderr == b""


def test_a_foreign_log(kfgen, log):
    text = Path(log).read_text().splitlines()
    head = text[0].replace("t,", "time;", 1).replace(",", ";")
    rows = [";".join(f"{float(c) * 1000:.17g}".replace(".", ",") if i == 0 else c.replace(".", ",") for i, c in
                     enumerate(row.split(","))) for row in text[1:]]  # fmt: skip
    Path("foreign.csv").write_text("\n".join([head, *rows]))
    Path("names.yaml").write_text("t: {from: time, scale: 1e-3}\n")
    mine = kfgen("run", SPEC, log)
    theirs = kfgen("run", SPEC, "foreign.csv", "--columns", "names.yaml")
    assert theirs.exit_code == 0
    assert "semicolons, numbers to have decimal commas" in theirs.stderr
    columns = [np.genfromtxt(result.stdout.splitlines(), delimiter=",", skip_header=1) for result in (mine, theirs)]
    assert np.allclose(*columns, equal_nan=True, rtol=1e-4, atol=1e-6)
    assert kfgen("run", SPEC, "foreign.csv", "--columns", "none.yaml").exit_code == 2
