"""The targets, one file per family: a module here with a list TARGETS is all that a new family takes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules

from kfgen.cost.target import Target
from kfgen.errors import KfgenError


@lru_cache(maxsize=1)
def targets() -> Mapping[str, Target]:
    """Name -> target."""
    found: dict[str, Target] = {}
    for module in sorted(iter_modules(__path__), key=lambda each: each.name):
        for target in import_module(f"{__name__}.{module.name}").TARGETS:
            found[target.name] = target
    return found


def target_of(name: str) -> Target:
    """The target of a name. KfgenError lists them."""
    try:
        return targets()[name]
    except KeyError:
        raise KfgenError(f"target `{name}` is unknown; write one of {', '.join(targets())}") from None
