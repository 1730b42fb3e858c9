"""Numbers that are read from the filter's arrays by their places, under names: `p_px_vx` instead of `kf->P[1]`.

A number gets its constant local right before the statement that first reads it, so that nothing lives longer than it
has to. A compiler makes the same code of it; the program that is counted, lowered and interpreted stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from fractions import Fraction

from kfgen.ir.nodes import INT, REAL, Node
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
        self.taken = {*taken, *(s.name for s in walk(body) if isinstance(s, Let | Declare))}
        self.bound: dict[Place, Node] = {}  # the locals that hold entries
        self.gone: set[Place] = set()  # entries that were written: what is read there now is another value
        self.held: dict[str, Place] = {}  # numbered locals that the program holds entries in -> the entry
        self.nested = False
        self.fresh: list[Let] = []

    def run(self, body: list[Statement]) -> list[Statement]:
        out: list[Statement] = []
        for statement in body:
            if isinstance(statement, Let) and _NUMBERED.fullmatch(statement.name):
                place = self._place(statement.node)
                if place is not None:
                    self.held[statement.name] = place
                    continue
            inner = walk(statement.body) if isinstance(statement, For | If) else [statement]
            written = {place for s in inner for place in self._written(s)} - self.gone
            for place in self.held.values():
                if place in written:
                    self._local(place)  # from before, for what is read later
            if isinstance(statement, For | If):
                self.gone |= written
                made: Statement = self._inside(statement)
            else:
                made = mapped(statement, self._node)
                self.gone |= written
            out += [*self.fresh, made]
            self.fresh = []
        return out

    def _inside(self, statement: For | If) -> For | If:
        """Loops and branches: what they read stays where it stands, but for what has a local already."""
        made = mapped(statement, self._node)
        assert isinstance(made, For | If)
        outer, self.nested = self.nested, True
        body = [self._inside(s) if isinstance(s, For | If) else mapped(s, self._node) for s in statement.body]
        self.nested = outer
        return replace(made, body=body)

    def _written(self, statement: Statement) -> Set[Place]:
        """The entries that a statement may write."""
        match statement:
            case Store(name=name, index=index) if index is not None and index.constant is not None:
                return {(name, int(index.constant))}
            case Store(name=name):
                return {place for place in self.entries if place[0] == name}
            case Call(callee=callee, args=args):
                given = [g for a, g in zip(callee.arguments, args, strict=True) if not a.constant]
                arrays = {g.array for g in given if isinstance(g, Slice)}
                return {place for place in self.entries if "kf" in given or place[0] in arrays}
        return set()

    def _place(self, node: Node) -> Place | None:
        """Which entry a node reads, with the value that it had when the function was called."""
        if node.op != "element" or node.args[0].constant is None:
            return None
        place = (node.data, int(node.args[0].constant))
        return place if place in self.entries and place not in self.gone else None

    def _node(self, node: Node) -> Node:
        args = node.args
        if not args:
            return self._local(self.held[node.data]) if node.op == "variable" and node.data in self.held else node
        if node.op == "element":
            place = self._place(node)
            if place is not None:
                return node if self.nested and place not in self.bound else self._local(place)
        made = tuple([self._node(a) for a in args])
        return node if made == args else Node(node.op, made, node.data, node.kind, node.serial, node.volatile)

    def _local(self, place: Place) -> Node:
        """The local of an entry, declared before the present statement if there is none yet."""
        found = self.bound.get(place)
        if found is None:
            name = self._unused(self.entries[place].name)
            found = self.bound[place] = Node("variable", (), name, REAL, -1, False)
            path, index = place
            read = Node("element", (Node("const", (), Fraction(index), INT, -1, False),), path, REAL, -1, True)
            self.fresh.append(Let(read, name, self.entries[place].point))
        return found

    def _unused(self, base: str) -> str:
        name, count = base, 0
        while name in self.taken or (count == 0 and name.startswith(self.prefix)):
            count += 1
            name = f"{base}_{count}"
        self.taken.add(name)
        return name
