"""From a file to a Spec: read, walk, build, check. The one place that knows the order of these steps."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

from kfgen.errors import Advice, Place, SpecError
from kfgen.scalar_names import KNOWN, is_scalar
from kfgen.spec.advice import warnings as _warnings
from kfgen.spec.builders import Builder
from kfgen.spec.names import check_identifiers
from kfgen.spec.nodes import Mapping, kind_of
from kfgen.spec.problems import Problems, short
from kfgen.spec.raw import BAD
from kfgen.spec.reader import MAX_BYTES, read
from kfgen.spec.rules import check
from kfgen.spec.schema import TOP
from kfgen.spec.types import Spec
from kfgen.spec.walk import Walker


def load(path: str | Path) -> Spec:
    """The spec in a file; a SpecError lists every mistake."""
    path = Path(path)
    file = str(path)
    place = Place(file, 1, 1)
    try:
        if path.is_dir():
            raise SpecError.at(place, "this is a directory", "name a spec file")
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise SpecError.at(place, "there is no such file", "check the path") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SpecError.at(place, f"the file cannot be read: {reason}", "check the path and its permissions") from None
    return loads(data, file)


def loads(text: str | bytes, file: str = "<spec>") -> Spec:
    """The spec in a text; `file` is what messages call it."""
    place = Place(file, 1, 1)
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else bytes(text)
    if len(data) > MAX_BYTES:
        raise SpecError.at(place, f"the spec is larger than {MAX_BYTES} bytes", "shorten it")
    try:
        content = data.decode("utf-8")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line = before.count(b"\n") + 1
        column = len(before[before.rfind(b"\n") + 1 :].decode("utf-8", "replace")) + 1
        at = Place(file, line, column)
        raise SpecError.at(at, f"the byte 0x{data[error.start]:02x} is not UTF-8", "save the file as UTF-8") from None
    # line ends of any system, and a byte-order mark, mean nothing
    content = content.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return _loads(content, file, hashlib.sha256(data).hexdigest())


def _loads(content: str, file: str, sha256: str) -> Spec:
    problems = Problems(file)
    root = read(content, problems)
    if not isinstance(root, Mapping):
        at = problems.at(root.line, root.column)
        raise problems.stop(at, f"a spec is a mapping of keys, not {kind_of(root)}", "begin with `kfgen: 1`")
    walker = Walker(problems)
    top = walker.record(root, TOP, ())
    spec = Builder(walker, top).build(file, sha256)
    check(walker, spec)
    if not problems.mistakes:
        _unshaped(walker)
    if problems.mistakes:
        raise problems.error()
    return spec


def _unshaped(walker: Walker) -> None:
    """A formula whose shape follows from itself is a mistake that nothing else has found."""
    for written in walker.formulas:
        if any(part.tree == BAD for part in written.parts):
            hint = "definitions that are vectors must not use each other in a circle"
            walker.problems.add(written.expression.place, "the shape of this formula cannot be told", hint)


def with_scalar(spec: Spec, scalar: str) -> Spec:
    """The same spec with another scalar; a SpecError where there is none, or emitted names collide."""
    problems = Problems(spec.file)
    if not is_scalar(scalar):
        raise problems.stop(Place(spec.file, 1, 1, "scalar"), f"there is no scalar {short(scalar)}", KNOWN)
    spec = replace(spec, scalar=scalar)
    check_identifiers(spec, problems)
    if problems.mistakes:
        raise problems.error()
    return spec


def warnings(spec: Spec) -> list[Advice]:
    """What is allowed but probably not meant, as far as the spec alone tells."""
    return _warnings(spec)
