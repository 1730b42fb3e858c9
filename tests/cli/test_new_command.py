"""`kfgen new`, `schema`, `doctor`: the first minutes."""

from __future__ import annotations

import json

import pytest
from jsonschema import Draft202012Validator

from kfgen.examples import MODELINE, description, examples, like
from kfgen.spec import load, loads
from kfgen.tools import survey

WANTED = ["scalar", "tracker", "vehicle", "ahrs", "battery", "motor"]


def test_a_new_spec_is_the_example_by_another_name(kfgen, folder):
    result = kfgen("new", "pump", "--like", "battery")
    assert result.exit_code == 0, result.output
    assert "pump.yaml" in result.output
    assert load(folder / "pump.yaml").name == "pump"
    text = (folder / "pump.yaml").read_text()
    original = examples()["battery"]
    assert text.startswith(MODELINE)
    assert text.removeprefix(MODELINE) == original.replace("\nname: battery\n", "\nname: pump\n")
    schema = json.loads((folder / "kfgen.schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    assert kfgen("schema").output == (folder / "kfgen.schema.json").read_text()


@pytest.mark.parametrize("example", [*WANTED, *sorted(set(examples()) - set(WANTED))])
def test_each_example_can_be_started_from(example):
    spec = loads(like(example, "mine"), "mine.yaml")
    assert spec.name == "mine"
    assert spec.states == loads(examples()[example], "mine.yaml").states or spec.places != {}
    assert description(examples()[example]) == spec.description != ""


def test_the_list_says_what_each_shows(kfgen):
    output = kfgen("new", "--list").output
    for name, text in examples().items():
        assert any(line.split() == [name, *description(text).split()] for line in output.splitlines())


@pytest.mark.parametrize(("arguments", "text"), [
    (("new", "pump", "--like", "bettery"), "there is no example `bettery`; did you mean `battery`?"),
    (("new", "pump", "--like", "zzz"), "there are ahrs, "),
    (("new", "vehicle_small"), "vehicle_small.yaml exists; choose another name"),
    (("new", "int"), "is a keyword of C"),
    (("new", "../up"), "not a C identifier"),
    (("new",), "Missing argument 'NAME'"),
])  # fmt: skip
def test_what_cannot_be_made(kfgen, folder, arguments, text):
    before = sorted(folder.parent.rglob("*.yaml"))
    result = kfgen(*arguments)
    assert result.exit_code == 2
    assert text in result.output
    assert sorted(folder.parent.rglob("*.yaml")) == before
    assert not (folder / "kfgen.schema.json").exists()


def test_a_schema_of_ones_own_is_left_alone(kfgen, folder):
    (folder / "kfgen.schema.json").write_text("{}")
    assert kfgen("new", "pump").exit_code == 0
    assert (folder / "kfgen.schema.json").read_text() == "{}"


def test_doctor(kfgen, monkeypatch):
    output = kfgen("doctor").output
    assert "C compiler" in output
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setenv("CC", "no-such-compiler")
    result = kfgen("doctor", "--json")
    assert result.exit_code == 0
    found = {each["name"]: each for each in json.loads(result.output)}
    assert found["kfgen"]["present"]
    for name in ("C compiler", "arm-none-eabi-gcc", "simavr"):
        assert not found[name]["present"]
        assert found[name]["install"]
    assert all(each.purpose for each in survey())
    output = kfgen("doctor").output
    assert "missing" in output
    assert "Debian: gcc-arm-none-eabi" in output
