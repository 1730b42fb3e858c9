"""Imports run one way: command line -> native, check -> generate -> emit -> filters -> model -> spec -> errors.

Nothing is imported here: the source is read, imports for annotations included. Which part may import which is listed
below; the rest is a mistake of design, not of taste. Inside the parts, files and rooms (folders) form no circle, and
the rooms that PARTS lists import only those above them in the list. Above all, the reference shares no code with
what it judges.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
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
    "packaged": set(),
    "seal": set(),
    "examples": {"errors", "packaged"},
    # the spec, and what reads only it
    "spec": {"errors", "scalar_names"},
    "override": SPEC,
    "excursions": {"errors", "spec"},
    "cells": {"errors"},
    "apart": SPEC,
    "columns": SPEC,
    "logs": SPEC | {"cells", "columns", "files"},
    "late": SPEC | {"logs"},
    "reference": {"errors", "spec"},
    # from a spec to C
    "ir": {"errors"},
    "scalars": {"errors", "ir", "scalar_names"},
    "quantiles": {"ir"},
    "geometry": {"ir"},
    "model": SPEC | {"geometry", "ir"},
    "filters": SPEC | {"geometry", "ir", "model", "quantiles", "scalars"},
    "fixed": SPEC | {"emit", "filters", "geometry", "ir", "logs", "model", "scalars"},
    "emit": {"errors", "filters", "ir", "packaged", "scalars", "status"},
    "budgets": SPEC | {"filters", "ir", "scalars"},
    "generate": SPEC | {"budgets", "emit", "filters", "fixed", "ir", "logs", "scalars", "seal"},
    "advice": SPEC | {"generate", "reference", "simulate"},
    # the compiled filter, and what uses it
    "simulate": SPEC | {"geometry", "logs", "reference"},
    "native": SPEC | {"emit", "files", "generate", "late", "logs", "override", "status"},
    "smoothing": SPEC | {"logs", "native", "reference"},
    "statistics": set(),
    "tuning": SPEC | {"apart", "logs", "native", "reference", "statistics", "status"},
    "plot": SPEC | {"files", "logs", "native"},
    "report": SPEC
    | {"apart", "cost", "generate", "logs", "model", "native", "packaged", "plot", "reference", "simulate"}
    | {"smoothing", "statistics", "status"},
    "check": SPEC
    | {"advice", "excursions", "generate", "geometry", "interface", "native", "override", "reference", "simulate"}
    | {"status"},
    "cost": SPEC | {"emit", "logs", "native", "status"},
    "selftest": SPEC
    | {"emit", "filters", "fixed", "generate", "geometry", "ir", "logs", "native", "reference", "scalars", "simulate"}
    | {"status"},
    "layouts": {"emit"},
    "difference": SPEC | {"apart", "generate", "logs", "native"},
    "tools": {"__init__", "errors", "native"},
    "commands": SPEC
    | {"advice", "check", "columns", "cost", "difference", "examples", "excursions", "files", "generate", "late"}
    | {"layouts", "logs", "native", "override", "plot", "reference", "report", "seal", "selftest", "simulate"}
    | {"smoothing", "status", "tools", "tuning"},
    "cli": {"commands", "errors"},
    "__init__": SPEC | {"generate", "native", "reference", "report", "status", "tuning"},
    "__main__": {"cli"},
}
"""Part of kfgen -> the other parts it may import; `kfgen` itself (its version, a lazy name) is looked through."""

FLOORS = {
    "filters": ["base", "algebra", "frame", "covariance", "steps", "kinds", "sigma", "bank", "order", "choice",
                "build"],
    "filters.covariance": ["names", "noise", "kept", "parts", "base", "motion", "definite", "kernels", "gather",
                           "loops", "straight", "forms", "ud", "full", "sqrt"],
    "report": ["blocks", "walk", "observability", "equations", "figures", "subject", "sections", "page"],
    "tuning": ["numbers", "opened", "writing", "objective", "search", "curvature"],
    "fixed": ["arithmetic", "program", "ranges", "formats", "lowering", "trial", "linear", "substeps",
              "build"],
}  # fmt: skip
"""Part or room -> its files and rooms, the lowest first: each imports only what stands before it."""

TYPES_ONLY = {("ir", "scalars")}
"""Further imports that are allowed, of modules of protocols only: they bring annotations, no code."""
PROTOCOLS = {"kfgen.scalars.base"}

FORBIDDEN = {"reference": {"sympy", "jinja2", "cffi"}, "spec": {"sympy", "numpy", "scipy"}, "ir": {"numpy", "scipy"}}
"""Part of kfgen -> packages that it may not import."""

LONGEST = 300  # lines that a module may have

MODULES = sorted(PACKAGE.rglob("*.py"))
NAMES = {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
         for path in MODULES}  # fmt: skip
"""Full name -> file."""


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@cache
def imports(path: Path) -> tuple[tuple[str, int], ...]:
    """The full name of each module that a file imports, wherever in it, and the line."""
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[tuple[str, int]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: write relative imports out"
            assert node.module is not None
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield (full if full in NAMES or node.module == "kfgen" else node.module), node.lineno


def circles(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """The nodes of one circle, if there is any."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


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


def test_files_form_no_circle():
    """The package's own face, which brings kfgen.compile and the like, is looked through."""
    face = {"kfgen"}
    graph = {name: {other for other, _ in imports(path) if other in NAMES and other not in face | {name}}
             for name, path in NAMES.items() if name not in face}  # fmt: skip
    assert circles(graph) == []


def _rooms(folder: str) -> dict[str, set[str]]:
    """The files and folders in a folder -> which others of it they import."""
    graph: dict[str, set[str]] = {}
    for name, path in NAMES.items():
        if not name.startswith(f"{folder}.") or name == folder:
            continue
        room = name.removeprefix(f"{folder}.").partition(".")[0]
        found = {other.removeprefix(f"{folder}.").partition(".")[0]
                 for other, _ in imports(path) if other.startswith(f"{folder}.")}  # fmt: skip
        graph.setdefault(room, set()).update(found - {room})
    return graph


@pytest.mark.parametrize("folder", sorted({name.rpartition(".")[0] for name in NAMES} - {""}))
def test_rooms_form_no_circle(folder):
    rooms = _rooms(folder)
    if folder == "kfgen":
        rooms.pop("__init__", None)
    assert circles(rooms) == []


@pytest.mark.parametrize("folder", sorted(FLOORS))
def test_arrows_run_down(folder):
    rooms, floors = _rooms(f"kfgen.{folder}"), FLOORS[folder]
    assert sorted(rooms) == sorted(floors), "say on which floor a new room stands"
    up = {room: found - set(floors[: floors.index(room)]) for room, found in rooms.items()}
    assert {room: sorted(found) for room, found in up.items() if found} == {}


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
    assert circles(ALLOWED) == []


def test_the_rules_name_only_what_exists():
    assert sorted({part_of(path) for path in MODULES}) == sorted(ALLOWED)


def test_protocols_are_nothing_but_protocols():
    """A module that is imported for its types only brings no code of kfgen along."""
    for name in PROTOCOLS:
        assert [module for module, _ in imports(NAMES[name]) if module.startswith("kfgen")] == []


def test_a_module_says_in_one_line_what_it_is():
    for path in MODULES:
        said = ast.get_docstring(ast.parse(path.read_text()))
        assert said, f"{path}: no docstring"
        assert said.split("\n\n")[0].count("\n") <= 1, f"{path}: its docstring begins with more than a sentence"


def test_no_module_or_template_is_too_long_to_hold_in_the_head():
    files = [*MODULES, *(PACKAGE.parent / "templates").rglob("*.j2"), *PACKAGE.rglob("*.j2")]
    long = {str(path.relative_to(PACKAGE.parent)): path.read_text().count("\n") for path in files}
    assert {name: lines for name, lines in long.items() if lines > LONGEST} == {}


def test_types_are_not_silenced():
    silenced = [path for path in MODULES for line in path.read_text().split("\n") if "# type: ignore" in line]
    assert len(silenced) <= 8
    assert not any("ignore[override]" in path.read_text() for path in MODULES)
