"""Changing a loaded spec from Python: another scalar, another filter, another covariance form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from typing import Any

from kfgen.errors import KfgenError
from kfgen.scalar_names import KNOWN, is_scalar
from kfgen.spec.types import Spec

_UPDATES = {"ud": "bierman", "full": "joseph", "sqrt": None}  # covariance -> its default form of update


def override(spec: Spec, scalar: str | None = None, **changes: Any) -> Spec:
    """A spec with some fields replaced, named as in `kfgen.spec.types`.

    A mapping replaces single fields of a nested part and keeps the rest:
    `override(spec, "double", filter={"covariance": "full"})`. The filter's `update` becomes the default of
    its covariance where it is not given along. KfgenError names an unknown field; what the changed spec may
    not combine is refused where it is generated.
    """
    if scalar is not None:
        changes["scalar"] = scalar
    if "scalar" in changes and not is_scalar(changes["scalar"]):
        raise KfgenError(f"scalar `{changes['scalar']}` is unknown; {KNOWN}")
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
