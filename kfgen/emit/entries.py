"""Numbers that are read from the filter's arrays by their places, under names: `p_px_vx` instead of `kf->P[1]`.

A number gets its constant local right before the statement that first reads it, so that nothing lives longer than it
has to. A compiler makes the same code of it; the program that is counted, lowered and interpreted stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace

from kfgen.ir.nodes import Node
from kfgen.ir.program import Call, Declare, For, If, Let, Slice, Statement, Store, mapped, walk

Place = tuple[str, int]
"""An array, as `kf.P`, and an index."""

_NUMBERED = re.compile(r"t\d+")


@dataclass(frozen=True)
class Entry:
    """What a number is called, and, of fixed point, the exponent of its raw 1."""

    name: str
    point: int | None = None


def with_entries(
    body: list[Statement], entries: Mapping[Place, Entry], taken: Set[str], prefix: str
) -> list[Statement]:
    """The body with the entries that it reads under their names.

    taken: what no local may be called, beside the body's own locals. prefix: of the names of file scope.
    """
    return _Naming(body, entries, taken, prefix).run(body) if entries else body


class _Naming:
    def __init__(self, body: list[Statement], entries: Mapping[Place, Entry], taken: Set[str], prefix: str) -> None:
        self.entries = entries
        self.prefix = f"{prefix}_"
        self.taken = taken | {s.name for s in walk(body) if isinstance(s, Let | Declare)}
        self.bound: dict[Place, Node] = {}
        self.gone: set[Place] = set()  # written: what is read there now is another value
        self.renamed: dict[str, Node] = {}  # a local that held an entry -> that entry's own
        self.fresh: list[Let] = []

    def run(self, body: list[Statement]) -> list[Statement]:
        out: list[Statement] = []
        for statement in body:
            if isinstance(statement, For | If):
                out.append(self._nested(statement))
                continue
            if isinstance(statement, Let) and _NUMBERED.fullmatch(statement.name) and self._place(statement.node):
                self.renamed[statement.name] = self._node(statement.node)
                out += self._made()
                continue
            made = mapped(statement, self._node)
            out += [*self._made(), made]
            self._forget(statement)
        return out

    def _made(self) -> list[Let]:
        made, self.fresh = self.fresh, []
        return made

    def _nested(self, statement: For | If) -> For | If:
        """Loops and branches: what they read stays where it stands, but for what has a name already."""
        for inner in walk(statement.body):
            self._forget(inner)
        free, self.entries = self.entries, {}

        def inside(body: list[Statement]) -> list[Statement]:
            out = []
            for s in body:
                made = mapped(s, self._node)
                out.append(replace(made, body=inside(made.body)) if isinstance(made, For | If) else made)
            return out

        made = mapped(statement, self._node)
        assert isinstance(made, For | If)
        made = replace(made, body=inside(statement.body))
        self.entries = free
        return made

    def _forget(self, statement: Statement) -> None:
        """What a statement may have written has no name any more."""
        match statement:
            case Store(name=name, index=index) if index is not None and index.constant is not None:
                self._lose({(name, int(index.constant))})
            case Store(name=name):
                self._lose({place for place in self.entries if place[0] == name})
            case Call(callee=callee, args=args):
                given = [g for a, g in zip(callee.arguments, args, strict=True) if not a.constant]
                arrays = {g.array for g in given if isinstance(g, Slice)}
                self._lose({place for place in self.entries if "kf" in given or place[0] in arrays})
            case _:
                pass

    def _lose(self, places: Set[Place]) -> None:
        self.gone |= places
        for place in places:
            self.bound.pop(place, None)

    def _place(self, node: Node) -> Place | None:
        if node.op != "element" or node.args[0].constant is None:
            return None
        place = (node.data, int(node.args[0].constant))
        return place if place in self.entries and place not in self.gone else None

    def _node(self, node: Node) -> Node:
        args = node.args
        if not args:
            return self.renamed.get(node.data, node) if self.renamed and node.op == "variable" else node
        if node.op == "element" and args[0].constant is not None:
            place = (node.data, int(args[0].constant))
            return self.bound.get(place) or (self._bind(place, node) if self._place(node) else node)
        made = tuple([self._node(a) for a in args])
        return node if made == args else Node(node.op, made, node.data, node.kind, node.serial, node.volatile)

    def _bind(self, place: Place, node: Node) -> Node:
        entry = self.entries[place]
        base = name = entry.name
        count = 0
        while name in self.taken or (count == 0 and name.startswith(self.prefix)):
            count += 1
            name = f"{base}_{count}"
        self.taken |= {name}
        made = self.bound[place] = Node("variable", (), name, node.kind, node.serial, False)
        self.fresh.append(Let(node, name, entry.point))
        return made
