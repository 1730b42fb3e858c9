"""What a walk over a spec's nodes finds: every formula, reference and declaration, and where every value stands."""

from __future__ import annotations

from kfgen.errors import Place
from kfgen.spec.expressions import Source
from kfgen.spec.nodes import Node, Scalar, kind_of
from kfgen.spec.problems import Problems, unseen
from kfgen.spec.raw import Path, Word, Written, path_text
from kfgen.spec.shapes import Reference, Whole
from kfgen.spec.tree import Expression


class Findings:
    """Remembers every formula and where every value stands."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.formulas: list[Written] = []
        self.parsed: dict[Place, Source] = {}
        self.whole: list[tuple[Expression, Whole]] = []
        self.sources: dict[Place, Scalar] = {}
        self.values: dict[str, Place] = {}  # key path -> place of the value
        self.keys: dict[str, Place] = {}  # key path -> place of the key
        self.declared: list[tuple[str, str, Place, Path]] = []  # kind, name, place, path
        self.empty: set[str] = set()  # paths of collections without entries
        self.broken: set[str] = set()  # paths of values that could not be read
        self.meant: set[str] = set()  # paths of keys for which an unknown key was probably meant
        self.doubtful: set[str] = set()  # names that a reported mistake may have hidden
        self.references: list[tuple[Reference, Word, Path]] = []

    # --- places

    def place(self, node: Node, path: Path) -> Place:
        return self.problems.at(node.line, node.column, path_text(path))

    def offset_place(self, expression: Expression, offset: int) -> Place:
        """The place of a character of an expression."""
        source = self.sources.get(expression.place)
        if source is None:
            return expression.place
        line, column = source.position(offset)
        return Place(self.problems.file, line, column, expression.place.path)

    def value_place(self, path: str, otherwise: Place) -> Place:
        return self.values.get(path, otherwise)

    # --- single values

    def wrong(self, node: Node, path: Path, wanted: str, hint: str = "") -> None:
        if isinstance(node, Scalar) and node.kind == "null":
            self.problems.add(self.place(node, path), "there is no value", hint or f"write {wanted}")
            return
        found = kind_of(node)
        if isinstance(node, Scalar) and len(node.text) <= 40 and node.kind != "boolean":
            found += f" (`{node.text}`)"
        self.problems.add(self.place(node, path), f"{wanted} is wanted here, not {found}", hint)

    def text(self, node: Scalar, path: Path) -> str | None:
        if node.kind == "null":
            self.wrong(node, path, "text", "write text or leave the key out")
        elif node.kind == "boolean":
            self.wrong(node, path, "text", f'quote it: "{node.text}"')
        elif (odd := unseen(node.text)) is not None:
            text = f"the character U+{ord(odd):04X} cannot be seen, and would stand in the header"
            self.problems.add(self.place(node, path), text, "remove it")
        else:
            return node.text
        return None
