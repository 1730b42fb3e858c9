"""Layouts of the output: what stands where, and what else a build system wants to see.

A layout is a module of this folder with a function `arrange(package)` that returns path -> text, below the filter's
own folder; its docstring is its description. That one file (and its templates) is all that a new layout takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kfgen.emit.data import View


@dataclass(frozen=True)
class Package:
    """A filter's files, and what a layout says of them. flags: of the compiler, as the header recommends them."""

    view: View
    sources: Mapping[str, str]
    command: str  # the arguments of `kfgen build`
    flags: tuple[str, ...] = ()
    step: float = 1.0  # s, the nominal one
    run_time: bool = False  # whether predict takes the step
    takes_inputs: tuple[str, ...] = ()  # the functions that take them

    @property
    def name(self) -> str:
        return self.view.name

    @property
    def selftest(self) -> bool:
        return f"{self.name}_selftest.c" in self.sources

    @property
    def title(self) -> str:
        """One line."""
        return " ".join(self.view.title.split())


def layouts() -> list[str]:
    """The names of all layouts."""
    return sorted(module.name for module in iter_modules(__path__))


def arrange(layout: str, package: Package) -> dict[str, str]:
    """Path below the filter's folder -> text."""
    arranged: dict[str, str] = import_module(f"{__name__}.{layout}").arrange(package)
    return arranged
