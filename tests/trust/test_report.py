"""The report: its figures against independent ones, what it does without truth, compiler or run, and the page."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from kfgen import report
from kfgen.cli import cli
from kfgen.logs import write
from kfgen.report import made
from kfgen.simulate import simulate
from kfgen.spec import load, loads
from tests.trust.pages import BANK, LINEAR

SPECS = Path(__file__).parents[2] / "specs"


def budget_by_hand(spec, log):
    """Variances of the error at the end by cause, each from a recursion of its own: gains from all of them together."""
    F = np.array([[1, 0.1, 0], [0, 1, 0], [0, 0, 0.95]])
    G = {"noise.w": np.diag([0, 0.3**2, 0]), "Q.b": np.diag([0, 0, 0.01]), "Q.p": np.diag([0.001, 0, 0])}
    sensors = {"fix": ([[1, 0, 1]], [[0.25]]), "slow": ([[0, 1, 0], [0, 0, 1]], [[0.04, 0], [0, 0.09]])}
    parts = {"start": np.diag([4.0, 1.0, 0.25]), **{name: np.zeros((3, 3)) for name in (*G, *sensors)}}
    for row in range(len(log.columns["t"])):
        parts = {name: F @ P @ F.T + G.get(name, 0) for name, P in parts.items()}
        for name, (H, R) in sensors.items():
            H, R = np.array(H), np.array(R)
            column = next(c for c in log.columns if c.startswith(f"{name}."))
            if np.isnan(log.columns[column][row]):
                continue
            P = sum(parts.values())
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            A = np.eye(3) - K @ H
            parts = {k: A @ P @ A.T + (K @ R @ K.T if k == name else 0) for k, P in parts.items()}
    return {name: np.diag(P) for name, P in parts.items()}


def test_the_budget_is_that_of_linear_covariance_analysis(linear):
    spec, log, found = linear
    right = budget_by_hand(spec, log)
    total = sum(right.values())
    for i, state in enumerate(("p", "v", "b")):
        assert found.data["budget_sigma"][state] == pytest.approx(total[i] ** 0.5, rel=1e-9)
        shares = found.data["budget"][state]
        assert abs(sum(shares.values()) - 1) < 1e-12
        for name, variances in right.items():
            assert shares.get(name, 0.0) == pytest.approx(variances[i] / total[i], abs=1e-9)


def test_what_it_says_of_a_filter_that_is_right(linear):
    _, _, found = linear
    for sensor in ("fix", "slow"):
        each = found.data["nis"][sensor]
        assert each["low"] < each["mean"] < each["high"]
        assert each["low"] < 1 < each["high"]
        assert 0.85 < each["inside"] <= 1
        assert each["whiteness_p"] > 0.001
        assert each["normality_p"] > 0.001
    assert found.data["nees"]["low"] < found.data["nees"]["mean"] < found.data["nees"]["high"]
    for each in found.data["rmse"].values():
        assert 0.5 < each["rmse"] / each["sigma"] < 2
    assert found.data["observability"]["rank"] == 3
    assert sum(found.data["observability"]["weakest"].values()) == pytest.approx(1, abs=1e-5)
    assert found.data["observability"]["without"]["fix"]["rank"] == 2
    assert found.data["observability"]["without"]["fix"]["weakest"] == {"p": 1.0}


def test_what_it_says_of_a_filter_that_is_wrong():
    spec = loads(LINEAR.replace("h: p + b, std: 0.5", "h: p + b, std: 0.1").replace("std: 0.3}", "std: 0.02}"))
    log = simulate(loads(LINEAR), 250, 5)
    without = replace(log, columns={n: c for n, c in log.columns.items() if not n.startswith("true.")})
    found = report(spec, without, target="host")
    assert found["nis"]["fix"]["mean"] > found["nis"]["fix"]["high"]
    assert found["nis"]["fix"]["verdict"] == "optimistic"
    assert found["nis"]["slow"]["whiteness_p"] < 0.01
    assert "rmse" not in found
    assert "nees" not in found


def figures(data):
    """All numbers in a report's data."""
    if isinstance(data, dict):
        return [n for each in data.values() for n in figures(each)]
    if isinstance(data, list):
        return [n for each in data for n in figures(each)]
    return [data] if isinstance(data, float) else []


def test_the_page_has_the_same_figures(linear):
    _, _, found = linear
    text = re.sub(r"<svg.*?</svg>", "", found.html, flags=re.DOTALL)
    for each in found.data["nis"].values():
        assert f"{each['mean']:.4g}" in text
        assert f"{100 * each['inside']:.1f} %" in text
    for each in found.data["rmse"].values():
        assert f"{each['rmse']:.4g}" in text
        assert f"{each['sigma']:.4g}" in text
    for shares in found.data["budget"].values():
        assert all(f"{100 * share:.1f} %" in text for share in shares.values() if share > 1e-3)
    assert f"{found.data['nees']['mean']:.4g}" in text


class Page(HTMLParser):
    """Tags that are open, and what would leave the page."""

    VOID = frozenset({"meta", "link", "br", "hr", "img", "input"})

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.leads, self.tags = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "xlink:href", "action", "data", "srcset") and value not in ("data:,",):
                self.leads.append(value)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_whole_and_alone(linear):
    _, _, found = linear
    page = Page()
    page.feed(found.html)
    assert page.open == []
    assert "script" not in page.tags
    assert len(set(page.ids)) == len(page.ids)
    assert all(lead.startswith("#") and lead[1:] in page.ids for lead in page.leads)
    assert page.tags.count("math") > 5
    assert page.tags.count("svg") == page.tags.count("title") - 1 == page.tags.count("desc")
    assert not re.search(r"url\((?!#)|@import|#0[1-9]0[1-9]0[1-9]", found.html)
    assert len(found.html) < 3_000_000
    assert found.html == made(*linear[:1], [linear[1]], target="host").html


def test_a_bank_in_fixed_point_and_what_it_draws():
    spec = loads(BANK)
    found = made(spec, simulate=120, target="host")
    assert {q["name"] for q in found.data["fixed"]["quantities"]} >= {"p", "v"}
    assert found.data["fixed"]["certificate"][0]["proved"] > 0
    assert found.data["cost"]["functions"]["predict"]["mean"] > 0
    assert "Modes, simulated (120 rows)" in found.html
    assert all(abs(sum(shares.values()) - 1) < 1e-12 for shares in found.data["budget"].values())
    assert found.data["logs"][0]["rows"] == 120


EXAMPLES = sorted(path.stem for path in SPECS.glob("*.yaml") if path.stem != "gps")  # whose log is not drawn


@pytest.mark.parametrize(
    "name", ["pendulum", *(pytest.param(each, marks=pytest.mark.long) for each in EXAMPLES if each != "pendulum")]
)
def test_examples(name):
    found = made(load(SPECS / f"{name}.yaml"), simulate=40, target="host")
    assert found.data["nis"]
    assert json.loads(json.dumps(found.data)) == found.data


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("linear.yaml").write_text(LINEAR)
    log = simulate(loads(LINEAR), 60, 1)
    write(Path("log.csv"), log.columns)

    def kfgen(*arguments):
        return CliRunner().invoke(cli, ["report", "linear.yaml", *arguments])

    done = kfgen("--log", "log.csv", "--log", "log.csv", "--target", "host", "-o", "out.html", "--json")
    assert done.exit_code == 0, done.output
    data = json.loads(done.stdout)
    assert len(data["logs"]) == 2
    assert data["nis"]["fix"]["number"] == 120
    assert [each["budget"] for each in data["budgets"]] == [data["budget"]] * 2
    assert Path("out.html").read_text().startswith("\n<!DOCTYPE html>"[1:])
    for wrong in ("--log log.csv", "--no-run --log log.csv --json", "--log log.csv -o log.csv"):
        assert kfgen(*wrong.split()).exit_code == 2
    assert kfgen("--json", "--target", "z80").exit_code == 2


def test_without_compilers(monkeypatch):
    from kfgen import cost
    from kfgen.errors import KfgenError

    def missing(*arguments, **options):
        raise KfgenError("no compiler for cortex-m4f found; install gcc-arm-none-eabi")

    monkeypatch.setattr(cost, "measure", missing)
    found = made(loads(LINEAR), simulate=20)
    assert found.data["cost"] is None
    assert "install gcc-arm-none-eabi" in found.data["cost_missing"]
    assert "install gcc-arm-none-eabi" in found.html
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("PATH", "/nowhere")
    still = made(loads(LINEAR), run=False)
    assert "nis" not in still.data
    assert "Dynamics" in still.html
    assert still.data["operations"]["predict"]
