"""kfgen turns a Kalman-filter spec in YAML into specialised C.

    import kfgen

    spec = kfgen.load("specs/vehicle.yaml")       # SpecError lists every mistake
    files = kfgen.generate(spec)                  # {"vehicle.h": "...", "vehicle.c": "..."}
    kf = kfgen.compile(spec, scalar="double")     # built with the host C compiler, cached
    ref = kfgen.reference(spec)                   # numpy float64, the same interface

Importing kfgen imports next to nothing; each name below is fetched at its first use.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from kfgen.errors import KfgenError, Mistake, Place, SpecError
from kfgen.status import Status

if TYPE_CHECKING:
    from kfgen.generate import generate as generate
    from kfgen.native import compile as compile
    from kfgen.native import compile_many as compile_many
    from kfgen.reference import reference as reference
    from kfgen.report import report as report
    from kfgen.spec import load as load
    from kfgen.tuning import tune as tune

__version__ = "0.1.0"

__all__ = [
    "KfgenError",
    "Mistake",
    "Place",
    "SpecError",
    "Status",
    "__version__",
    "compile",
    "compile_many",
    "generate",
    "load",
    "reference",
    "report",
    "tune",
]

_FUNCTIONS = {"load": "kfgen.spec", "compile": "kfgen.native", "compile_many": "kfgen.native", "tune": "kfgen.tuning"}
_CALLABLE_MODULES = ("generate", "reference", "report")


class _CallableModule(ModuleType):
    """A submodule that may be called like its function of the same name.

    `kfgen.generate(spec)` is the public call, and `kfgen.generate` is also the module that Python binds here
    as soon as anything imports it; this makes the two agree in whichever order they happen.
    """

    def __call__(self, *args: Any, **keywords: Any) -> Any:
        return getattr(self, self.__name__.rpartition(".")[2])(*args, **keywords)


class _Package(ModuleType):
    def __setattr__(self, name: str, value: object) -> None:
        if name in _CALLABLE_MODULES and type(value) is ModuleType:
            value.__class__ = _CallableModule
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name in _FUNCTIONS:
        return getattr(import_module(_FUNCTIONS[name]), name)
    if name in _CALLABLE_MODULES:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
