"""YAML text -> node graph with positions. No Python object is ever constructed from the file's content.

The graph is built from the parser's events, on an explicit stack: depth, node count and the expansion
of aliases are bounded while reading, so a hostile file ends in an error and not in memory or the stack.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from kfgen.errors import SpecError
from kfgen.spec.commas import join_items, joined_pairs
from kfgen.spec.nodes import Bad, Mapping, Node, Scalar, Sequence, columns_of, refused
from kfgen.spec.problems import Problems, short

MAX_BYTES = 1_000_000
MAX_NODES = 50_000  # after expansion of aliases
MAX_DEPTH = 40


@dataclass(slots=True)
class _Frame:
    """A collection under construction."""

    node: Mapping | Sequence
    path: str
    anchor: str | None
    key: Scalar | Bad | None = None
    pairs: list[tuple[Scalar | Bad, Node]] = field(default_factory=list)


def read(text: str, problems: Problems) -> Node:
    """The root node of a document. What allows no further reading is raised, all else collected."""
    _refuse_control_characters(text, problems)
    position = [1, 1]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            root = _Composer(text, problems, position).compose()
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark is not None else position
        what = error.problem or error.context or "cannot be read"
        if error.problem and error.context:
            what = f"{error.context}, {error.problem}"
        raise problems.stop(problems.at(line, column), f"not valid YAML: {what}", _cure(what)) from None
    except SpecError:
        raise
    except Exception as error:  # whatever a parser does on garbage is a mistake of the file
        what = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise problems.stop(problems.at(position[0], position[1]), f"not valid YAML: {what}") from None
    if root is None:
        raise problems.stop(problems.at(1, 1), "the spec is empty", "begin with `kfgen: 1`")
    return root


def _cure(what: str) -> str:
    if "start any token" in what:
        return "indent with spaces" if "\\t" in what else "quote text that begins with this character"
    if "expected <block end>" in what:
        return "check the indentation"
    if "mapping values are not allowed" in what:
        return "check the indentation, or quote text that holds a colon"
    if "got '['" in what:
        return "quote an expression with brackets, such as \"v[0]\": to YAML they begin a list"
    if "flow" in what:
        return "check that brackets and braces are closed"
    return ""


def _refuse_control_characters(text: str, problems: Problems) -> None:
    for line, content in enumerate(text.split("\n"), 1):
        if content.isprintable():
            continue
        for column, c in enumerate(content, 1):
            if (c < " " and c not in "\t\r") or "\x7f" <= c <= "\x9f" or c in "\u2028\u2029\ufffe\uffff\ufeff":
                at = problems.at(line, column)
                raise problems.stop(at, f"the character U+{ord(c):04X} may not stand in a spec", "remove it")


class _Composer:
    def __init__(self, text: str, problems: Problems, position: list[int]) -> None:
        self.text = text
        self.problems = problems
        self.position = position
        self.stack: list[_Frame] = []
        self.anchors: dict[str, Node | None] = {}  # None: still being read
        self.root: Node | None = None
        self.count = 0

    def compose(self) -> Node | None:
        documents = 0
        for event in self._events():
            kind = type(event).__name__
            line, column = event.start_mark.line + 1, event.start_mark.column + 1
            self.position[:] = line, column
            if kind == "DocumentStartEvent":
                documents += 1
                if documents > 1:
                    at = self.problems.at(line, column)
                    raise self.problems.stop(at, "a second document begins", "one file holds one spec")
            elif kind == "ScalarEvent":
                self._put(self._scalar(event, line, column), event.anchor)
            elif kind == "AliasEvent":
                self._put(self._alias(event.anchor, line, column), None)
            elif kind in ("MappingStartEvent", "SequenceStartEvent"):
                self._open(event, kind == "MappingStartEvent", line, column)
            elif kind in ("MappingEndEvent", "SequenceEndEvent"):
                self._close()
        # a document without content is one empty plain scalar
        empty = isinstance(self.root, Scalar) and self.root.plain and not self.root.text
        return None if empty else self.root

    def _events(self) -> Iterator[Any]:
        yield from YAML(typ="safe", pure=True).parse(self.text)

    def _path(self) -> str:
        """The key path of the node that comes next."""
        if not self.stack:
            return ""
        frame = self.stack[-1]
        if isinstance(frame.node, Sequence):
            return f"{frame.path}[{len(frame.node.items)}]"
        name = frame.key.text if isinstance(frame.key, Scalar) else ""
        return f"{frame.path}.{name}" if frame.path and name else frame.path or name

    def _tagged(self, event: Any, line: int, column: int) -> bool:
        tag = event.tag
        if tag is None or (tag == "!" and not isinstance(getattr(event, "implicit", None), tuple)):
            return False
        self.problems.add(
            self.problems.at(line, column, self._path()),
            f"the tag {short(str(tag))} is not allowed",
            "remove it",
        )
        return True

    def _scalar(self, event: Any, line: int, column: int) -> Node:
        if self._tagged(event, line, column):
            return Bad(line, column)
        raw = self.text[event.start_mark.index : event.end_mark.index]
        offset = 0
        if event.anchor is not None:  # the position is that of the text, not of its anchor
            offset = len(raw) - len(raw[1 + len(event.anchor) :].lstrip(" "))
            if "\n" in raw[:offset]:
                offset = 0
            raw = raw[offset:]
        plain = not event.style
        scalar = Scalar(line, column + offset, event.value, plain)
        scalar.columns = columns_of(raw, event.value, event.style, column + offset)
        return scalar

    def _alias(self, anchor: str, line: int, column: int) -> Node:
        at = self.problems.at(line, column, self._path())
        if anchor not in self.anchors:
            self.problems.add(at, f"the alias *{anchor} has no anchor &{anchor} above it")
            return Bad(line, column)
        node = self.anchors[anchor]
        if node is None:
            raise self.problems.stop(at, f"the alias *{anchor} stands inside what it names", "write it out")
        return node

    def _open(self, event: Any, mapping: bool, line: int, column: int) -> None:
        path = self._path()
        if len(self.stack) >= MAX_DEPTH:
            at = self.problems.at(line, column)
            raise self.problems.stop(at, f"nested deeper than {MAX_DEPTH} levels", "use fewer brackets")
        bad = self._tagged(event, line, column)
        flow = bool(event.flow_style)
        node = Mapping(line, column, flow) if mapping else Sequence(line, column, flow)
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        if bad:
            path = ""
        self.stack.append(_Frame(node, path, event.anchor))

    def _close(self) -> None:
        frame = self.stack.pop()
        if isinstance(frame.node, Mapping):
            self._finish_mapping(frame, frame.node)
        elif frame.node.flow:
            join_items(frame.node.items, frame.path, self.problems)
        self._put(frame.node, frame.anchor, opened=True)

    def _put(self, node: Node, anchor: str | None, opened: bool = False) -> None:
        self.count += 1 if opened else node.size
        if self.count > MAX_NODES:
            at = self.problems.at(self.position[0], self.position[1])
            raise self.problems.stop(at, f"more than {MAX_NODES} values", "use fewer anchors and aliases")
        if anchor is not None:
            self.anchors[anchor] = node
        if not self.stack:
            self.root = node
            return
        frame = self.stack[-1]
        frame.node.size += node.size
        if isinstance(frame.node, Sequence):
            if isinstance(node, Scalar):
                node = self._checked(node, self._path())
            frame.node.items.append(node)
        elif frame.key is None:
            frame.key = node if isinstance(node, Scalar) else self._no_key(node)
        else:
            if isinstance(node, Scalar) and node.plain and not node.text:
                # the parser has it on the next token
                node.line, node.column = frame.key.line, frame.key.column
            frame.pairs.append((frame.key, node))
            frame.key = None

    def _no_key(self, node: Node) -> Bad:
        if not isinstance(node, Bad):
            path = self.stack[-1].path
            self.problems.add(self.problems.at(node.line, node.column, path), "a key must be a name")
        return Bad(node.line, node.column)

    def _checked(self, node: Scalar, path: str) -> Node:
        """A value, or Bad where it is a plain scalar that the language refuses."""
        wrong = refused(node.text) if node.plain else None
        if wrong is None:
            return node
        self.problems.add(self.problems.at(node.line, node.column, path), *wrong)
        return Bad(node.line, node.column)

    def _finish_mapping(self, frame: _Frame, node: Mapping) -> None:
        seen: dict[str, Scalar] = {}
        pairs = joined_pairs(frame.pairs, frame.path, self.problems) if node.flow else frame.pairs
        for key, value in pairs:
            if isinstance(key, Bad):
                continue
            path = f"{frame.path}.{key.text}" if frame.path else key.text
            at = self.problems.at(key.line, key.column, path)
            if key.plain and key.text == "<<":
                self.problems.add(at, "merge keys (`<<`) are not allowed", "write the keys out")
                continue
            if key.kind != "text" or (key.plain and refused(key.text)):
                self.problems.add(at, f"the key {short(key.text)} is not a name", "keys are strings")
                continue
            if key.text in seen:
                first = seen[key.text]
                self.problems.add(
                    at,
                    f"the key {short(key.text)} stands twice (first at line {first.line}, column {first.column})",
                    "remove one of them",
                )
                continue
            seen[key.text] = key
            if isinstance(value, Scalar):
                value = self._checked(value, path)
            node.items.append((key, value))
