"""The sections of a report, a file each: `ORDER`, and `section(subject)`, None where there is nothing to say."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from kfgen.report.blocks import Section
from kfgen.report.subject import Subject


def sections(subject: Subject) -> list[Section]:
    """All that have something to say, in their order."""
    modules = [import_module(f"{__name__}.{found.name}") for found in iter_modules(__path__)]
    made = [module.section(subject) for module in sorted(modules, key=lambda module: (module.ORDER, module.__name__))]
    return [each for each in made if each is not None]
