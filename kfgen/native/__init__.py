"""Compiled filters in Python: generate, build with the host's C compiler, cache, load through cffi."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import cffi

from kfgen.errors import KfgenError
from kfgen.native import driver, header
from kfgen.native.compiler import build
from kfgen.native.filter import NativeFilter
from kfgen.native.run import RunResult
from kfgen.native.struct import Struct
from kfgen.override import override
from kfgen.spec.types import Spec

__all__ = ["NativeFilter", "RunResult", "compile", "compile_many", "load_filters"]

SpecOrPath = Spec | str | os.PathLike[str]


def compile(
    spec: SpecOrPath, scalar: str | None = None, *, flags: Sequence[str] | None = None, **overrides: Any
) -> NativeFilter:
    """The compiled filter of a spec or of the path of one.

    scalar: float, double or q<m>.<n> in place of the spec's own. flags: options of the C compiler in place of
    `-O2`. overrides: other fields of the spec, see `kfgen.override.override`. Raises SpecError for a wrong
    spec and KfgenError where there is no C compiler. What was built before is taken from the cache.
    """
    return compile_many([spec], scalar, flags=flags, **overrides)[0]


def compile_many(
    specs: Sequence[SpecOrPath],
    scalar: str | None = None,
    *,
    flags: Sequence[str] | None = None,
    **overrides: Any,
) -> list[NativeFilter]:
    """The compiled filters of many specs, built into one library by one call of the compiler.

    Arguments as for `compile`; scalar and overrides hold for all. Specs that share a name are given different
    prefixes (`vehicle`, `vehicle_2`), since they meet in one library.
    """
    from kfgen.generate import generate

    pairs = []
    taken: set[str] = set()
    for each in specs:
        spec = _renamed(override(_loaded(each), scalar, **overrides), taken)
        taken.add(spec.name.upper())
        pairs.append((spec, generate(spec)))
    return load_filters(pairs, flags=flags)


def load_filters(
    filters: Sequence[tuple[Spec, Mapping[str, str]]], *, flags: Sequence[str] | None = None
) -> list[NativeFilter]:
    """Filters whose C is at hand: pairs of a spec and its files (`<name>.h`, `<name>.c`), names distinct."""
    if not filters:
        return []
    texts: dict[str, str] = {}
    headers: list[header.Header] = []
    for spec, files in filters:
        wanted = {name: files[name] for name in (f"{spec.name}.h", f"{spec.name}.c")}
        if wanted.keys() & texts.keys():
            raise KfgenError(f"two filters are named {spec.name}; they cannot share a library")
        parsed = header.parse(wanted[f"{spec.name}.h"], spec.name)
        headers.append(parsed)
        texts |= wanted
        texts[f"{spec.name}_kfgen_run.c"] = driver.source(spec, parsed)
    library = build(texts, flags)
    return [_load(spec, parsed, str(library)) for (spec, _), parsed in zip(filters, headers, strict=True)]


def _load(spec: Spec, parsed: header.Header, library: str) -> NativeFilter:
    ffi = cffi.FFI()
    ffi.cdef(parsed.cdef + "\n" + driver.declarations(spec.name))
    try:
        lib = ffi.dlopen(library)
    except OSError as error:
        raise KfgenError(f"the compiled filter {spec.name} could not be loaded: {error}") from None
    seen, compiled = ffi.sizeof(f"{spec.name}_t"), getattr(lib, f"{spec.name}_kfgen_size")()
    if seen != compiled:  # a declaration was misread; going on would corrupt memory
        raise KfgenError(f"{spec.name}_t has {compiled} bytes in C, but {seen} by its header")
    return NativeFilter(spec, Struct(spec, parsed, ffi, lib))


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
