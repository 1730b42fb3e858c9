"""Imports run one way: command line -> native, check -> generate -> emit -> filters -> model -> spec -> errors.

Nothing is imported here: the source is read. What a part may import is listed below; the rest is a mistake of
design, not of taste. Above all, the reference shares no code with what it judges.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "kfgen"

SPEC = {"errors", "scalar_names", "spec"}
ALLOWED = {
    # on nothing
    "errors": set(),
    "status": set(),
    "interface": set(),
    "scalar_names": set(),
    "files": {"errors"},
    # the spec, and what reads only it
    "spec": {"errors", "scalar_names"},
    "override": SPEC,
    "logs": SPEC | {"files"},
    "reference": {"errors", "spec"},
    "simulate": SPEC | {"logs", "reference"},
    # from a spec to C
    "ir": {"errors"},
    "scalars": {"errors", "ir", "scalar_names"},
    "quantiles": {"ir"},
    "model": SPEC | {"ir"},
    "filters": SPEC | {"ir", "model", "quantiles", "scalars"},
    "fixed": SPEC | {"emit", "filters", "ir", "logs", "model", "scalars"},
    "emit": {"errors", "filters", "ir", "scalars", "status"},
    "budgets": SPEC | {"filters", "ir", "scalars"},
    "generate": SPEC | {"budgets", "emit", "filters", "fixed", "ir", "logs", "scalars"},
    # the compiled filter, and what uses it
    "native": SPEC | {"emit", "files", "generate", "logs", "override", "status"},
    "plot": SPEC | {"files", "logs", "native"},
    "check": SPEC | {"generate", "interface", "native", "override", "reference", "simulate", "status"},
    "cost": SPEC | {"emit", "logs", "native", "status"},
    "selftest": SPEC
    | {"emit", "filters", "fixed", "generate", "ir", "logs", "native", "reference", "scalars", "simulate", "status"},
    "layouts": {"emit"},
    "commands": SPEC
    | {"check", "cost", "files", "generate", "layouts", "logs", "native", "override", "plot", "reference", "selftest"}
    | {"simulate", "status"},
    "cli": {"commands", "errors"},
    "__init__": SPEC | {"generate", "native", "reference", "status"},
    "__main__": {"cli"},
}
"""Part of kfgen -> the other parts it may import; `kfgen` itself (its version, a lazy name) is looked through."""

TYPES_ONLY = {("ir", "scalars")}
"""Further imports that are allowed, of modules of protocols only: they bring annotations, no code."""
PROTOCOLS = {"kfgen.scalars.base"}

FORBIDDEN = {"reference": {"sympy", "jinja2", "cffi"}, "spec": {"sympy", "numpy", "scipy"}, "ir": {"numpy", "scipy"}}
"""Part of kfgen -> packages that it may not import."""

MODULES = sorted(PACKAGE.rglob("*.py"))


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> Iterator[tuple[str, int]]:
    """The full name of each module that a file imports, wherever in it, and the line."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: write relative imports out"
            if node.module == "kfgen":
                yield from ((f"kfgen.{alias.name}", node.lineno) for alias in node.names)
            elif node.module:
                yield node.module, node.lineno


@pytest.mark.parametrize("part", sorted({part_of(path) for path in MODULES}))
def test_direction(part):
    assert part in ALLOWED, "say in ALLOWED what this new part may import"
    wrong = []
    for path in MODULES:
        if part_of(path) != part:
            continue
        for name, line in imports(path):
            top, _, rest = name.partition(".")
            other = rest.partition(".")[0]
            if top != "kfgen" or other in ALLOWED[part] | {part, "__version__", ""}:
                continue
            if (part, other) in TYPES_ONLY and name in PROTOCOLS:
                continue
            wrong.append(f"{path.relative_to(PACKAGE.parent)}:{line}: {name}")
    assert wrong == []


@pytest.mark.parametrize("part", sorted(FORBIDDEN))
def test_foreign_packages(part):
    wrong = [
        f"{path.relative_to(PACKAGE.parent)}:{line}: {name}"
        for path in MODULES
        if part_of(path) == part
        for name, line in imports(path)
        if name.partition(".")[0] in FORBIDDEN[part]
    ]
    assert wrong == []


def test_the_rules_have_no_cycle():
    order, left = [], dict(ALLOWED)
    while left:
        free = sorted(part for part, others in left.items() if others <= set(order))
        assert free, f"a cycle among {sorted(left)}"
        order += free
        left = {part: others for part, others in left.items() if part not in free}


def test_the_rules_name_only_what_exists():
    assert sorted({part_of(path) for path in MODULES}) == sorted(ALLOWED)


def test_protocols_are_nothing_but_protocols():
    """A module that is imported for its types only brings no code of kfgen along."""
    for name in PROTOCOLS:
        path = PACKAGE.parent / (name.replace(".", "/") + ".py")
        assert [module for module, _ in imports(path) if module.startswith("kfgen")] == []
