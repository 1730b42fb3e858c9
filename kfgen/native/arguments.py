"""Arguments of a filter's functions, checked and brought into the spec's order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kfgen.native.values import Array

Row = Sequence[float] | Array | Mapping[str, float]


def unknown(what: str, name: object, known: Mapping[str, object]) -> str:
    """The message for a name that is not there, with the nearest and all known ones."""
    close = get_close_matches(str(name), known, 1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    return f"unknown {what} {name!r}{hint} (known: {', '.join(known) or 'none'})"


def row(values: Row, names: Sequence[str], what: str) -> Array:
    """One number per name: from a sequence in order, or from a mapping that has exactly these names."""
    if isinstance(values, Mapping):
        for name in values:
            if name not in names:
                raise KeyError(f"{what}: " + unknown("name", name, dict.fromkeys(names)))
        missing = [name for name in names if name not in values]
        if missing:
            raise KeyError(f"{what} lacks {', '.join(missing)}")
        values = [values[name] for name in names]
    return shaped(values, (len(names),), f"{what} ({', '.join(names)})")


def shaped(values: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
    """`values` as float64 of a shape; a lone number passes for one entry. ValueError names the misfit."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape != shape and not (shape == (1,) and array.shape == ()):
        raise ValueError(f"{what} must have shape {shape}, not {array.shape}")
    return array.reshape(shape)


def bits_of(mask: int | Sequence[bool], components: Sequence[str]) -> int:
    """A mask as bits; ValueError where it does not fit the components."""
    full = (1 << len(components)) - 1
    if isinstance(mask, int):
        if not 0 <= mask <= full:
            raise ValueError(f"mask must be between 0 and {full} for {len(components)} components, not {mask}")
        return mask
    flags = list(mask)
    if len(flags) != len(components):
        raise ValueError(f"mask must have one entry per component ({', '.join(components)}), not {len(flags)}")
    return sum(1 << i for i, flag in enumerate(flags) if flag)


def numpy_type(item: Any, ffi: Any) -> np.dtype[Any]:
    """The numpy type of a C number."""
    if item.kind != "primitive":
        return np.dtype(object)
    size = ffi.sizeof(item)
    if item.cname in ("float", "double"):
        return np.dtype(f"f{size}")
    unsigned = item.cname.startswith(("u", "_Bool", "size_t"))
    return np.dtype(f"{'u' if unsigned else 'i'}{size}")
