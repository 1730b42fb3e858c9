"""Reads an emitted header: the declarations cffi needs, the numeric macros, the functions' arguments.

The header is the truth about layout and signatures: what the C compiler sees is what is loaded here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from kfgen.errors import KfgenError

_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_ONLY_CPP = re.compile(
    r"^[ \t]*#[ \t]*(?:ifdef[ \t]+__cplusplus|if[ \t]+defined[ \t]*\(?__cplusplus\)?)[ \t]*$.*?"
    r"^[ \t]*#[ \t]*(?:else\b[^\n]*$(?P<c>.*?)^[ \t]*#[ \t]*)?endif\b[^\n]*$",
    re.DOTALL | re.MULTILINE,
)
_DEFINE = re.compile(r"^[ \t]*#[ \t]*define[ \t]+(\w+)[ \t]+(\S[^\n]*?)[ \t]*$", re.MULTILINE)
_DIRECTIVE = re.compile(r"^[ \t]*#[^\n]*$", re.MULTILINE)
_PROTOTYPE = re.compile(r"(\w+)\s*\(([^()]*)\)\s*;\s*$", re.DOTALL)
_NUMBER = re.compile(r"[-+]?(?:0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)[uUlLfF]*")


@dataclass(frozen=True)
class Header:
    """What one emitted header declares.

    cdef: declarations for cffi. macros: `#define` names with a plain number. functions: name -> its
    arguments' names in order. real: `float`, `double` or `int32_t`.
    """

    prefix: str
    cdef: str
    macros: Mapping[str, float]
    functions: Mapping[str, tuple[str, ...]]
    real: str

    def takes(self, function: str, argument: str) -> bool:
        """Whether `<prefix>_<function>` exists and has an argument of that name."""
        return argument in self.functions.get(f"{self.prefix}_{function}", ())

    def has(self, function: str) -> bool:
        return f"{self.prefix}_{function}" in self.functions

    def declares(self, name: str) -> bool:
        """Whether the header declares a type `<prefix>_<name>`."""
        return re.search(rf"\b{re.escape(self.prefix)}_{re.escape(name)}\b", self.cdef) is not None


def parse(text: str, prefix: str) -> Header:
    """Parse the header of the filter `prefix`. KfgenError if it declares no filter of that name."""
    text = _COMMENT.sub(" ", text).replace("\\\n", " ")
    text = _ONLY_CPP.sub(lambda match: match["c"] or "", text)
    macros = {name: float_of(value) for name, value in _DEFINE.findall(text) if _NUMBER.fullmatch(_bare(value))}
    declarations = _declarations(_DIRECTIVE.sub("", text))
    functions: dict[str, tuple[str, ...]] = {}
    for declaration in declarations:
        match = _PROTOTYPE.search(declaration)
        if match and not declaration.startswith(("typedef", "enum", "struct")):
            functions[match[1]] = _arguments(match[2])
    cdef = "\n".join(_integers(declaration, macros) for declaration in declarations)
    real = re.search(rf"typedef\s+(\w+)\s+{re.escape(prefix)}_real_t\s*;", cdef)
    if real is None or f"{prefix}_init" not in functions:
        raise KfgenError(f"the emitted header does not declare {prefix}_real_t and {prefix}_init")
    return Header(prefix, cdef, macros, functions, real[1])


def float_of(literal: str) -> float:
    """The value of a C number: `4`, `0x10u`, `0.5f`, `(-3)`."""
    literal = _bare(literal)
    if literal.lower().lstrip("+-").startswith("0x"):
        return float(int(literal.rstrip("uUlL"), 16))
    return float(literal.rstrip("uUlLfF"))


def _bare(value: str) -> str:
    while value.startswith("(") and value.endswith(")"):
        value = value[1:-1].strip()
    return value


def _declarations(text: str) -> list[str]:
    """The top-level declarations, each up to its `;`; inline function bodies are left out."""
    found: list[str] = []
    depth, start, position = 0, 0, 0
    while position < len(text):
        character = text[position]
        if character == "{":
            depth += 1
        elif character == "}":
            depth -= 1
            head = text[start:position].split("{", 1)[0].rstrip()
            if depth == 0 and head.endswith(")"):
                start = position + 1  # a function with a body
        elif character == ";" and depth == 0:
            declaration = " ".join(text[start : position + 1].split())
            if declaration != ";":
                found.append(declaration.removeprefix("extern "))
            start = position + 1
        position += 1
    return found


def _arguments(text: str) -> tuple[str, ...]:
    if text.strip() in ("", "void"):
        return ()
    names = (re.search(r"(\w+)\s*(?:\[[^\]]*\]\s*)*$", argument.strip()) for argument in text.split(","))
    return tuple(match[1] if match else "" for match in names)


def _integers(declaration: str, macros: Mapping[str, float]) -> str:
    """Replace the macros of a declaration by their numbers: cffi knows no preprocessor."""
    return re.sub(
        r"\b[A-Z_]\w*\b",
        lambda match: str(int(macros[match[0]])) if match[0] in macros and macros[match[0]].is_integer() else match[0],
        declaration,
    )
