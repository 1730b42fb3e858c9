"""Changing a loaded spec from Python: another scalar, another filter, another covariance form."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from typing import Any

from kfgen.errors import KfgenError
from kfgen.spec.types import Spec

_UPDATES = {"ud": "bierman", "full": "joseph", "sqrt": None}  # covariance -> its default form of update
_Q = re.compile(r"q(\d{1,2})\.(\d{1,2})", re.ASCII)


def check_scalar(scalar: str) -> str:
    """`scalar` if it is float, double or a q<m>.<n> with m + n = 32 and 8 <= n <= 24; else KfgenError."""
    if scalar in ("float", "double"):
        return scalar
    match = _Q.fullmatch(scalar)
    if match and int(match[1]) + int(match[2]) == 32 and 8 <= int(match[2]) <= 24:
        return scalar
    raise KfgenError(f"scalar `{scalar}` is unknown; write float, double, or q<m>.<n> with m + n = 32 and 8 <= n <= 24")


def override(spec: Spec, scalar: str | None = None, **changes: Any) -> Spec:
    """A spec with some fields replaced, named as in `kfgen.spec.types`.

    A mapping replaces single fields of a nested part and keeps the rest:
    `override(spec, "double", filter={"covariance": "full"})`. The filter's `update` becomes the default of
    its covariance where it is not given along. KfgenError names an unknown field; what the changed spec may
    not combine is refused where it is generated.
    """
    if scalar is not None:
        changes["scalar"] = scalar
    if "scalar" in changes:
        check_scalar(changes["scalar"])
    changed: Spec = _replace(spec, changes, "spec")
    chosen = changes.get("filter")
    if isinstance(chosen, Mapping) and "update" not in chosen and {"type", "covariance"} & set(chosen):
        # what the language fills in where a spec does not say
        update = None if changed.filter.type == "ukf" else _UPDATES[changed.filter.covariance]
        changed = replace(changed, filter=replace(changed.filter, update=update))
    return changed


def _replace(part: Any, changes: Mapping[str, Any], path: str) -> Any:
    known = {field.name for field in fields(part)}
    values: dict[str, Any] = {}
    for name, value in changes.items():
        if name not in known:
            close = get_close_matches(name, known, 1)
            hint = f"; did you mean `{close[0]}`?" if close else ""
            raise KfgenError(f"{path} has no field `{name}`{hint}")
        current = getattr(part, name)
        nested = isinstance(value, Mapping) and is_dataclass(current)
        values[name] = _replace(current, value, f"{path}.{name}") if nested else value
    return replace(part, **values)
