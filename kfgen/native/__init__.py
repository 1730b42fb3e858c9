"""Compiled filters in Python: generate, build with the host's C compiler, cache, load through cffi."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cffi

from kfgen.emit.declarations import Declarations
from kfgen.errors import KfgenError
from kfgen.logs import Source, as_log
from kfgen.native import driver
from kfgen.native.compiler import build
from kfgen.native.emitted import Emitted
from kfgen.native.filter import NativeFilter
from kfgen.native.history import NativeHistory, PastStruct
from kfgen.native.run import RunResult
from kfgen.native.struct import Struct
from kfgen.override import override
from kfgen.scalar_names import is_fixed
from kfgen.spec.types import Spec

__all__ = ["Emitted", "NativeFilter", "NativeHistory", "RunResult", "compile", "compile_many", "load_filters"]

SpecOrPath = Spec | str | os.PathLike[str]


def compile(
    spec: SpecOrPath,
    scalar: str | None = None,
    *,
    flags: Sequence[str] | None = None,
    log: Source | None = None,
    history: bool = False,
    **overrides: Any,
) -> NativeFilter:
    """The compiled filter of a spec or of the path of one.

    scalar: float, double or q<m>.<n> in place of the spec's own. flags: options of the C compiler in place of
    `-O2`. log: what a q scalar takes its ranges from, beside simulated runs, as `kfgen build --log` does.
    history: the filter with its past (`history` in the spec), whose update takes `age=`.
    overrides: other fields of the spec, see `kfgen.override.override`. Raises SpecError for a wrong spec and
    KfgenError where there is no C compiler. What was built before is taken from the cache.
    """
    return compile_many([spec], scalar, flags=flags, log=log, history=history, **overrides)[0]


def compile_many(
    specs: Sequence[SpecOrPath],
    scalar: str | None = None,
    *,
    flags: Sequence[str] | None = None,
    log: Source | None = None,
    history: bool = False,
    **overrides: Any,
) -> list[NativeFilter]:
    """The compiled filters of many specs, built into one library by one call of the compiler.

    Arguments as for `compile`; scalar and overrides hold for all. Specs that share a name are given different
    prefixes (`vehicle`, `vehicle_2`), since they meet in one library.
    """
    from kfgen.generate import build as generate

    filters = []
    taken: set[str] = set()
    for each in specs:
        spec = _renamed(override(_loaded(each), scalar, **overrides), taken)
        taken.add(spec.name.upper())
        filters.append(generate(spec, log=as_log(log, spec) if log is not None and is_fixed(spec.scalar) else None))
    return load_filters(filters, flags=flags, history=history)


def load_filters(
    filters: Sequence[Emitted], *, flags: Sequence[str] | None = None, history: bool = False
) -> list[NativeFilter]:
    """Filters that are generated already, compiled into one library, with their past or without; their names are
    distinct. KfgenError for a past that a spec does not have."""
    if not filters:
        return []
    texts: dict[str, str] = {}
    for each in filters:
        name = each.spec.name
        if history and each.spec.history is None:
            raise KfgenError(f"the spec of {name} has no `history`; write for example `history: {{steps: 25}}`")
        wanted = {file: each.files[file] for file in _files(name, history)}
        if wanted.keys() & texts.keys():
            raise KfgenError(f"two filters are named {name}; they cannot share a library")
        texts |= wanted
        texts[f"{name}_kfgen_run.c"] = driver.source(each.spec, each.declarations, history)
    library = str(build(texts, flags))
    for again in (False, True):
        try:
            return [_load(each.spec, each.declarations, library, history) for each in filters]
        except OSError as error:  # built on another machine, perhaps, that shares the cache
            if again:
                raise KfgenError(f"the compiled filter {filters[0].spec.name} could not be loaded: {error}") from None
            library = str(build(texts, flags, afresh=True))
    raise AssertionError


def _files(name: str, history: bool) -> list[str]:
    past = [f"{name}_history.h", f"{name}_history.c"] if history else []
    return [f"{name}.h", f"{name}.c", *past]


def _load(spec: Spec, declared: Declarations, library: str, history: bool) -> NativeFilter:
    ffi = cffi.FFI()
    ffi.cdef("\n".join([declared.text, declared.history if history else "", driver.declarations(spec.name, history)]))
    lib = ffi.dlopen(library)
    for name in (spec.name, f"{spec.name}_history") if history else (spec.name,):
        seen, compiled = ffi.sizeof(f"{name}_t"), getattr(lib, f"{name}_kfgen_size")()
        if seen != compiled:  # going on would corrupt memory
            raise KfgenError(f"{name}_t has {compiled} bytes in C, but {seen} as it is declared")
    return (
        NativeHistory(spec, PastStruct(spec, declared, ffi, lib))
        if history
        else NativeFilter(spec, Struct(spec, declared, ffi, lib))
    )


def _loaded(spec: SpecOrPath) -> Spec:
    if isinstance(spec, Spec):
        return spec
    from kfgen.spec import load

    return load(os.fspath(spec))


def _renamed(spec: Spec, taken: set[str]) -> Spec:
    name, count = spec.name, 1
    while name.upper() in taken:
        count += 1
        name = f"{spec.name}_{count}"
    return spec if count == 1 else replace(spec, name=name)
