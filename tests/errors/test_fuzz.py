"""Whatever is done to a spec, reading it ends in a Spec or a SpecError, soon."""

from __future__ import annotations

import random
import re
import time
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kfgen.errors import SpecError
from kfgen.spec import Spec, loads

SPECS = [path.read_text() for path in sorted(Path(__file__).with_name("valid").glob("*.yaml"))]
TOKENS = sorted({token for text in SPECS for token in re.findall(r"[\w.]+|[^\w\s]", text)})
NASTY = [
    "", "null", "~", "true", "[]", "{}", "''", "1e999", "-1", "0", "1/0", "2**64**64", "sqrt(-1)",
    "x" * 50, "[[1]]", "*a", "&a", "!t", "<<", "? ", "- ", ": ", "|", ">", "%", "@", "`", "\t",
    "\u0000", "\u2028", "é", "^", "**", "(", ")", "[[]]", "{a}", "{a: }", "[1, [2]]", "-0", ".inf",
    "1_0", "0x1", "2020-01-01", "log(0)", "where(1<2, 1, 2)",
]  # fmt: skip

fuzz = settings(
    max_examples=80,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)


def read(text: str | bytes) -> None:
    start = time.perf_counter()
    try:
        spec = loads(text, "f")
        assert isinstance(spec, Spec)
    except SpecError as error:
        assert error.mistakes  # noqa: PT017 - not raising is a pass, too
        for line in str(error).split("\n"):
            assert re.match(r"f:\d+:\d+: .", line), line
    assert time.perf_counter() - start < 10


@fuzz
@given(st.sampled_from(SPECS), st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=6))
def test_bytes(text: str, changes: list[tuple[float, int]]) -> None:
    data = bytearray(text.encode())
    for where, byte in changes:
        data[int(where * (len(data) - 1))] = byte
    read(bytes(data))


@fuzz
@given(st.sampled_from(SPECS), st.randoms(use_true_random=False))
def test_lines(text: str, draw: random.Random) -> None:
    lines = text.split("\n")
    for _ in range(draw.randint(1, 4)):
        i, j = draw.randrange(len(lines)), draw.randrange(len(lines))
        what = draw.randrange(5)
        if what == 0:
            del lines[i]
        elif what == 1:
            lines[i], lines[j] = lines[j], lines[i]
        elif what == 2:
            lines.insert(i, lines[j])
        elif what == 3:
            lines[i] = " " * draw.randint(0, 6) + lines[i].lstrip()
        else:
            lines[i] = lines[i][: draw.randint(0, len(lines[i]))]
        lines = lines or [""]
    read("\n".join(lines))


@fuzz
@given(st.sampled_from(SPECS), st.randoms(use_true_random=False))
def test_tokens(text: str, draw: random.Random) -> None:
    parts = re.split(r"([\w.]+|[^\w\s])", text)
    for _ in range(draw.randint(1, 4)):
        i = draw.randrange(len(parts))
        parts[i] = draw.choice([*TOKENS, *NASTY, parts[draw.randrange(len(parts))]])
    read("".join(parts))


@fuzz
@given(st.sampled_from(SPECS), st.randoms(use_true_random=False))
def test_values(text: str, draw: random.Random) -> None:
    """Values of keys are replaced by something of another kind."""
    found = list(re.finditer(r"(?<=: )(?:\"[^\"]*\"|[^,{}\[\]\n]+)", text))
    for match in sorted(draw.sample(found, draw.randint(1, 3)), key=lambda m: -m.start()):
        text = text[: match.start()] + draw.choice(NASTY) + text[match.end() :]
    read(text)


@fuzz
@given(st.sampled_from(SPECS), st.randoms(use_true_random=False))
def test_sections(text: str, draw: random.Random) -> None:
    """Top-level sections of several specs, mixed."""
    other = draw.choice(SPECS)
    sections = re.split(r"\n(?=\w)", text) + re.split(r"\n(?=\w)", other)
    draw.shuffle(sections)
    seen: dict[str, str] = {section.split(":")[0]: section for section in sections}
    read("\n".join(seen.values()))


@fuzz
@given(st.text(max_size=200))
def test_garbage(text: str) -> None:
    read(text)


@fuzz
@given(st.binary(max_size=200))
def test_garbage_bytes(data: bytes) -> None:
    read(data)


@fuzz
@given(st.text(alphabet="0123456789.e+-*/()[], <>=pixyatn2scow\"'^_", max_size=60))
def test_expressions(text: str) -> None:
    quoted = text.replace("'", "''")
    read(SPECS[-1].replace("stdx**2", f"'{quoted}'", 1))
