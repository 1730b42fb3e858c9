"""The JSON Schema of the language says of a spec's structure what its reader says."""

from __future__ import annotations

import json
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from kfgen.errors import SpecError
from kfgen.spec import loads
from kfgen.spec.json_schema import json_schema, text
from kfgen.spec.schema import RECORDS, TOP
from tests.errors.test_bad_specs import CASES, VALID

ROOT = Path(__file__).parents[2]
SPECS = sorted([*(ROOT / "specs").glob("*.yaml"), *Path(__file__).parent.glob("*/*.yaml")])
# how a mistake of the structure alone begins
STRUCTURE = ("unknown key", "the key `", "there is no value", "is wanted here", "is not used by")
VALIDATOR = Draft202012Validator(json_schema())


def plain(source: str) -> Any:
    yaml = YAML(typ="safe", pure=True)
    yaml.version = (1, 2)
    return yaml.load(StringIO(source))


def wrong(source: str) -> list[str]:
    return [f"{list(error.absolute_path)}: {error.message}" for error in VALIDATOR.iter_errors(plain(source))]


def test_is_a_schema() -> None:
    Draft202012Validator.check_schema(json_schema())
    assert json.loads(text()) == json_schema()
    assert text() == text()


@pytest.mark.parametrize("path", SPECS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_valid_specs_pass(path: Path) -> None:
    assert wrong(path.read_text()) == []


def test_structural_mistakes_fail() -> None:
    """Each case of the bad specs whose only mistake is one of the structure."""
    passed, seen = [], 0
    for spec, old, new, *_ in CASES:
        changed = VALID[spec].replace(old, new, 1)
        with pytest.raises(SpecError) as caught:
            loads(changed)
        (mistake,) = caught.value.mistakes
        if not any(word in mistake.message for word in STRUCTURE) or "`residual`" in mistake.message:
            continue
        try:
            found = wrong(changed)
        except YAMLError:
            continue
        seen += 1
        if not found:
            passed.append(f"{mistake}")
    assert seen > 10
    assert passed == []


@pytest.mark.parametrize(("old", "new"), [
    ("states:", "state:"), ("kfgen: 1", "kfgen: 2"), ("type: ekf", "type: efk"), ("covariance: ud", "covariance: [ud]"),
    ("partial: true", "partial: 1"), ("range: [-5000, 5000]", "range: [-5000, 5000, 1]"), ("kfgen: 1\n", ""),
    ("name: vehicle", "name: [vehicle]"), ("type: ekf", "type: ekf\n  iterations: 3"),
    ("form: discrete", "form: dscrete"),
])  # fmt: skip
def test_what_an_editor_should_underline(old: str, new: str) -> None:
    assert old in VALID["vehicle"]
    assert wrong(VALID["vehicle"].replace(old, new, 1)) != []


def test_every_key_is_described() -> None:
    """For hovering: the texts of the reference, with the defaults."""
    schema = json_schema()
    for key in TOP.keys:
        described = schema["properties"][key.name]["description"]
        assert key.doc in described
        assert not key.default or f"Default: {key.default}." in described
    filters = schema["$defs"]["filter"]["properties"]
    assert "u d u^t" in filters["covariance"]["description"].lower()
    assert filters["covariance"]["enum"] == ["ud", "full", "sqrt"]
    names = {record.name for record in RECORDS} - {"spec", "imm"}
    assert {name for name in names if name not in schema["$defs"]} == set()


def test_a_shape_without_schema_is_told() -> None:
    class Odd:
        pass

    from kfgen.spec.json_schema import _Writer

    with pytest.raises(TypeError, match="Odd has no JSON Schema"):
        _Writer().schema(Odd())  # type: ignore[arg-type]
