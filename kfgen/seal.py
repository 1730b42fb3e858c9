"""The hash that each written file carries of its body: whether somebody has edited it since."""

from __future__ import annotations

import hashlib
import re
from pathlib import PurePath

_MARKS = {".h": "/* {} */", ".c": "/* {} */", ".ino": "// {}", ".cpp": "// {}"}
_SEAL = re.compile(r"^(?:/\*|//|#) kfgen: body ([0-9a-f]{32})(?: \*/)?\n?|; kfgen: body ([0-9a-f]{32})", re.MULTILINE)
_NO_COMMENTS = (".json", ".properties")  # what reads these takes no line that it does not know
_COMMAND = re.compile(r"(kfgen build [^\n\"]*?)(?=\)?\"?,?$)", re.MULTILINE)
_STAMP = re.compile(r"\bkfgen \S+ with SymPy \S+ from the spec with SHA-256\s+\*\s+[0-9a-f]{64}")
_OLDER = re.compile(r"\bkfgen build\b|\bEmitted by kfgen\b")  # in what was written before files were sealed


def sealed(name: str, text: str) -> str:
    """The text of a file with the hash of its body: in its last line, as a comment of the file's language; where there
    are none, behind the command that writes it."""
    text = _SEAL.sub("", text)
    seal, suffix = f"kfgen: body {_hash(text)}", PurePath(name).suffix
    if suffix in _NO_COMMENTS:
        return _COMMAND.sub(rf"\1; {seal}", text, count=1)
    return f"{text}{_MARKS.get(suffix, '# {}').format(seal)}\n"


def is_edited(text: str) -> bool:
    """Whether a file on the disk is not as it was written, or was not written by kfgen at all."""
    found = _SEAL.search(text.replace("\r\n", "\n"))
    if found is None:
        return bool(text.strip()) and _OLDER.search(text) is None
    return _hash(_SEAL.sub("", text.replace("\r\n", "\n"))) != (found.group(1) or found.group(2))


def is_same(a: str, b: str) -> bool:
    """Whether two texts differ in nothing but the stamp (versions, the hash of the spec) and line ends."""
    return _body(a) == _body(b)


def _hash(text: str) -> str:
    return hashlib.sha256(_body(text).encode("utf-8", "surrogateescape")).hexdigest()[:32]


def _body(text: str) -> str:
    return _STAMP.sub("", text.replace("\r\n", "\n"))
