"""`kfgen diff`: interface, behaviour and cost of two filters."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from kfgen.cli import cli
from kfgen.difference.interface import changes, items
from kfgen.generate import generate
from kfgen.spec import load

OLD = """kfgen: 1
name: cart
dt: 0.1
states:
  p: {init: 0, std: 1, unit: m, range: [-50, 50]}
  v: {init: 0, std: 1, unit: m/s, range: [-5, 5]}
parameters: {r: 0.2}
dynamics: {form: discrete, f: {p: p + dt*v}, Q: {v: 0.01}}
measurements:
  tape: {z: {d: {h: p, std: r, unit: m}}}
filter: {type: kf}
"""
NOISIER = OLD.replace("r: 0.2", "r: 0.4")
WIDER = OLD.replace("name: cart", "name: trolley").replace(
    "  v: {", "  b: {init: 0, std: 0.1, unit: m}\n  v: {").replace("h: p,", "h: p + b,")  # fmt: skip


@pytest.fixture
def diff(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("old", OLD), ("noisier", NOISIER), ("wider", WIDER)):
        Path(f"{name}.yaml").write_text(text)
    for name, text in generate(load("old.yaml")).items():
        Path("lib").mkdir(exist_ok=True)
        Path("lib", name).write_text(text)

    def call(*arguments: str) -> Result:
        result = CliRunner().invoke(cli, ["diff", *arguments], prog_name="kfgen")
        assert "Traceback" not in result.output
        return result

    return call


def plain(result: Result) -> dict:
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.mark.parametrize("old", ["old.yaml", "lib", "lib/cart.h"])
def test_nothing_changed(diff, old):
    found = plain(diff(old, "old.yaml", "--json", "--no-cost"))
    assert found["interface"] == []
    assert found["behaviour"]["rows"] == 500
    assert found["behaviour"]["status"] == {}
    assert {name: set(each.values()) for name, each in found["behaviour"]["states"].items()} == {"p": {0.0}, "v": {0.0}}
    assert found["cost"] is None


def test_another_noise_is_another_estimate(diff):
    text = diff("lib", "noisier.yaml", "--no-cost").output
    assert "the same" in text  # of the interface
    found = plain(diff("lib", "noisier.yaml", "--json", "--no-cost"))["behaviour"]["states"]
    assert found["p"]["sigma"] > 0.3
    assert 0.5 < found["p"]["variance"] < 5


def test_another_state_is_another_interface(diff):
    found = plain(diff("old.yaml", "wider.yaml", "--json", "--no-cost"))
    kinds = {each["item"]: each["kind"] for each in found["interface"]}
    assert kinds["TROLLEY_NX"] == "changed"
    assert kinds["TROLLEY_B"] == "added"
    assert kinds["TROLLEY_V"] == "changed"  # index 2 now
    assert "trolley_predict" not in kinds
    assert set(found["behaviour"]["states"]) == {"p", "v"}
    assert "name: cart is trolley now" in diff("old.yaml", "wider.yaml", "--no-cost").output


ATTITUDE = """kfgen: 1
name: attitude
dt: 0.1
states: {q: {kind: quaternion, init: [1, 0, 0, 0], std: 0.1}, b: {vector: 2, init: 0, std: 1}}
dynamics: {form: discrete, Q: {q: 1e-4, b: 0.01}}
measurements: {star: {z: {q: {h: q, std: 0.05}, b: {h: b, std: 0.3}}}}
filter: {type: ekf}
"""


def test_rotations_differ_by_their_errors(diff):
    Path("a.yaml").write_text(ATTITUDE)
    # the same rotation, and another noise of b alone
    Path("b.yaml").write_text(ATTITUDE.replace("[1, 0, 0, 0]", "[-1, 0, 0, 0]").replace("b: 0.01", "b: 0.02"))
    found = plain(diff("a.yaml", "b.yaml", "--json", "--no-cost"))["behaviour"]["states"]
    assert list(found) == ["q_rx", "q_ry", "q_rz", "b_x", "b_y"]
    assert all(found[name]["x"] < 1e-6 and found[name]["variance"] < 1e-6 for name in ("q_rx", "q_ry", "q_rz"))
    assert found["b_x"]["sigma"] > 0.1


def test_costs_are_told_side_by_side(diff, needs):
    needs("arm-none-eabi-gcc")
    found = plain(diff("old.yaml", "wider.yaml", "--json"))["cost"]
    assert 0 < found["old"]["functions"]["predict"]["mean"] < found["new"]["functions"]["predict"]["mean"]
    assert found["old"]["ram"] < found["new"]["ram"]


@pytest.mark.parametrize(("arguments", "text"), [
    (("lib", "lib"), "one of the two must be a spec"),
    (("lib", "wider.yaml"), "lib has no trolley.h and no trolley.c"),
    (("old.yaml", "none.yaml"), "none.yaml"),
    (("old.yaml", "old.yaml", "--log", "none.csv"), "none.csv"),
])  # fmt: skip
def test_what_cannot_be_compared(diff, arguments, text):
    result = diff(*arguments)
    assert result.exit_code == 2
    assert text in result.output


def test_files_that_are_called_otherwise_are_not_run(diff):
    Path("renamed.yaml").write_text(OLD.replace("tape:", "laser:"))
    found = plain(diff("lib", "renamed.yaml", "--json", "--no-cost"))
    assert "is called otherwise: cart_tape_t.d" in found["behaviour"]["not_compared"]


def test_headers_item_by_item():
    before = """/* old */
#define A_NX 2
enum { A_X, /* [m] */ A_Y };
typedef struct { a_real_t x[2]; uint32_t count; } a_t;
a_status_t a_init(a_t *kf);
"""
    after = before.replace("A_X, /* [m] */ A_Y", "A_Y, A_X").replace("uint32_t count;", "").replace("old", "new")
    assert items(before)["a_t.count"] == "a_t: uint32_t count [1]"
    assert [(each.item, each.kind) for each in changes(before, after)] == [
        ("A_X", "changed"), ("A_Y", "changed"), ("a_t.count", "removed"),
    ]  # fmt: skip
    assert changes(before, before.replace("  ", " ")) == []
