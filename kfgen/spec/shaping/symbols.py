"""What names mean while formulas are expanded: which are vectors, of which parts; and names for what is shared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from kfgen.errors import Place
from kfgen.spec.raw import Path
from kfgen.spec.shaping.extents import Shaped, number
from kfgen.spec.tree import Call, Expression, Name, Tree, names
from kfgen.spec.types import Definition

_DEFINABLE = ("f", "Q", "h", "R")  # scopes in which definitions may stand
MOST_HIDDEN = 2_000


class Symbols:
    """The shapes of all names of a spec; definitions that no user has written, by the section that needs them."""

    def __init__(self, taken: Iterable[str]) -> None:
        self.known: dict[str, Shaped] = {}
        self.taken = {name.upper() for name in taken}
        self.hidden: dict[Path, list[Definition]] = {}  # first keys of a path -> definitions
        self.count = 0

    def fresh(self, stem: str) -> str:
        """A name that nothing has yet."""
        stem = stem[:30]
        n = 1
        while f"{stem}_{n}".upper() in self.taken:
            n += 1
        self.taken.add(f"{stem}_{n}".upper())
        return f"{stem}_{n}"


class Here:
    """The names of one formula: those of the spec, and those of the sensor, which may hide them.

    unknown: whether a name was met that has no shape; it counts as a number, and what follows from that is no mistake.
    """

    def __init__(
        self, symbols: Symbols, scope: str, path: Path, place: Place, local: Mapping[str, Shaped] | None = None,
        own: list[Definition] | None = None, plain: Callable[[str], bool] | None = None,
    ) -> None:  # fmt: skip
        """own: takes the definitions, in place of the section's `let`. plain: names that are numbers though unknown."""
        self.symbols, self.scope, self.path, self.place = symbols, scope, path, place
        self.local = local or {}
        self.own = own
        self.plain = plain or (lambda name: name in ("pi", "e", "dt", "t"))
        self.unknown = False

    def value(self, name: str) -> Shaped:
        found = self.local.get(name) or self.symbols.known.get(name)
        if found is None:
            self.unknown = self.unknown or not self.plain(name)
            return number(Name(name))
        return found

    def define(self, tree: Tree) -> Tree | None:
        if not isinstance(tree, Call):
            return tree
        if self.own is None and (self.scope not in _DEFINABLE or self._local(tree)):
            return None
        if self.symbols.count >= MOST_HIDDEN or tree.op in _CONDITIONS:
            return None
        section = self.path[:4] if self.path[:2] == ("imm", "modes") else self.path[:1]
        found = self.symbols.hidden.setdefault(section, []) if self.own is None else self.own
        for other in found:
            if other.value.tree is tree or other.value.tree == tree:
                return Name(other.name)
        self.symbols.count += 1
        name = self.symbols.fresh(self._stem())
        found.append(Definition(name, Expression(tree, name, self.place)))
        return Name(name)

    def _local(self, tree: Tree) -> bool:
        parts = {part.name for value in self.local.values() for part in value.parts if isinstance(part, Name)}
        return not parts.isdisjoint(names(tree))

    def _stem(self) -> str:
        """Of the keys under which the formula stands: `f_v`, `h_mag`."""
        keys = [key for key in self.path if not key.startswith("[")]
        if "measurements" in keys:
            return f"h_{keys[keys.index('measurements') + 1]}"
        return "_".join(keys[-2:]) if keys[-2:-1] != ["let"] else keys[-1]


_CONDITIONS = ("lt", "le", "gt", "ge", "and", "or", "not")
