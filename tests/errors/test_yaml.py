"""Files that are not quite YAML, or too much of it, end in a SpecError with line and column."""

from __future__ import annotations

import re
import time

import pytest

from kfgen.errors import SpecError
from kfgen.spec import loads

BOMB = "\n".join(
    ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
)

CASES: list[tuple[str | bytes, str]] = [
    ("", "1:1: the spec is empty"),
    ("# a comment\n", "1:1: the spec is empty"),
    ("[1, 2]", "1:1: a spec is a mapping of keys, not a list"),
    ("text", "1:1: a spec is a mapping of keys, not text"),
    ("kfgen: 1\n---\nname: a\n", "2:1: a second document begins"),
    ("a: b: c", "1:5: not valid YAML: mapping values are not allowed here; check the indentation"),
    ("kfgen: 1\n\tname: x", "2:1: not valid YAML"),
    ("name: {", "not valid YAML"),
    ("name: 'x", "not valid YAML"),
    ('name: "\\xzz"', "not valid YAML"),
    ("%YAML 3.0\n---\na: 1", "1:1: not valid YAML"),
    ("{" * 100, "1:41: nested deeper than 40 levels"),
    ("[" * 500_000, "1:41: nested deeper"),
    ("- " * 5000, "nested deeper"),
    (BOMB, "more than 50000 values; use fewer anchors and aliases"),
    ("a: [" + "1, " * 60_000 + "1]", "more than 50000 values"),
    ("a: &a [*a]", "the alias *a stands inside what it names"),
    (b"kfgen: 1\nname: \x00", "2:7: the character U+0000 may not stand in a spec"),
    (b"kfgen: 1 # \x07", "1:12: the character U+0007"),
    ("k\u0085: 1", "1:2: the character U+0085"),
    (b"kfgen: \xff", "1:8: the byte 0xff is not UTF-8"),
    ("x" * 1_000_001, "1:1: the spec is larger than 1000000 bytes"),
    ("\ud800", "not UTF-8"),
]


@pytest.mark.parametrize(("text", "wanted"), CASES, ids=range(len(CASES)))
def test_unreadable(text: str | bytes, wanted: str) -> None:
    start = time.perf_counter()
    with pytest.raises(SpecError) as caught:
        loads(text, "f")
    assert time.perf_counter() - start < 20
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    assert wanted in lines[0]
    assert re.match(r"f:\d+:\d+: ", lines[0])


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("? [a, b]\n: 1", "a key must be a name"),
        ("1: 2", "the key `1` is not a name; keys are strings"),
        ("true: 2", "the key `true` is not a name"),
        ("~: 2", "the key `~` is not a name"),
        ("2020-01-01: 2", "the key `2020-01-01` is not a name"),
        ("<<: {a: 1}", "merge keys"),
        ("code: !!python/object:os.system {}", "tag"),
        ("code: ! x", "tag"),
        ("description: *missing", "no anchor"),
        ("description: .INF", "not finite"),
        ('description: "a\\u202eb"', "U+202E cannot be seen"),
        ("description: a\u2066b", "U+2066 cannot be seen"),
        ('description: "a\\ud800"', "U+D800 cannot be seen"),
        ('parameters: {a: {value: 1, unit: "m\\u200f"}}', "U+200F cannot be seen"),
        ('inputs: {a: {doc: "\\x07"}}', "U+0007 cannot be seen"),
        ("parameters: {a: 0o17}", "not a decimal number"),
        ("parameters: {a: 0b11}", "not a decimal number"),
        ("parameters: {a: 1:30}", "may not stand in an expression"),
        ("parameters: {a: '0x1F'}", "not a decimal number"),
        ("parameters: {a: 2j}", "complex"),
        ("parameters: {a: null}", "quote the expression"),
        ("parameters:\n  a:", "there is no value"),
        ("parameters: {a: inf}", "numbers are finite"),
        ("parameters: {a: True}", "booleans are not numbers"),
    ],
)
def test_what_yaml_allows_and_a_spec_does_not(line: str, wanted: str) -> None:
    base = "kfgen: 1\nname: a\nstates: {x: {init: 0, std: 1}}\ndynamics: {}\n"
    base += "measurements: {m: {z: {c: {h: x, std: 1}}}}\n"
    loads(base)
    with pytest.raises(SpecError) as caught:
        loads(base + line, "f")
    lines = str(caught.value).splitlines()
    assert len(lines) == 1, lines
    assert wanted in lines[0]
    assert lines[0].startswith(("f:6:", "f:7:"))


def test_many_mistakes_are_cut_short() -> None:
    text = "kfgen: 1\nname: a\nconstants:\n" + "".join(f"  a{i}: b{i}*\n" for i in range(1000))
    with pytest.raises(SpecError) as caught:
        loads(text)
    lines = str(caught.value).splitlines()
    assert len(lines) == 201
    assert "more mistakes" in lines[-1]


def test_a_message_is_one_line() -> None:
    with pytest.raises(SpecError) as caught:
        loads('kfgen: 1\n"na\\nme": 1\n"\\u202e": 1\n')
    assert all(re.match(r"<spec>:\d+:\d+: ", line) for line in str(caught.value).splitlines())


def test_aliases_may_be_used() -> None:
    text = "kfgen: 1\nname: a\nstates: {x: &s {init: 0, std: 1}, y: *s}\ndynamics: {}\n"
    spec = loads(text + "measurements: {m: {z: {c: {h: x + y, std: 1}}}}\n")
    assert spec.states[1].init.tree == spec.states[0].init.tree
