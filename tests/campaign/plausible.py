"""What a spec says of its own numbers: scales, ranges, limits, whether its noises stay covariances."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tests.campaign.model import Data


def units_of(units: Mapping[str, float]) -> Callable[[str], float]:
    """Name -> the physical value of raw 1."""
    by_name = {name.upper(): value for name, value in units.items()}
    return lambda name: by_name.get(name.upper(), 1.0)


def number(value: Any, default: float) -> float:
    return float(value) if isinstance(value, int | float) and value else default


def size(entry: Any, default: float) -> float:
    """Half the width of a declared range."""
    ends = (entry or {}).get("range")
    return max(abs(number(end, default)) for end in ends) / 2 if ends else default


def scale(state: Data) -> float:
    return (
        max(number(state.get("std"), 0.0), abs(number(state.get("init"), 0.0)), 1e-3)
        if "range" not in state
        else (size(state, 1.0) / 8)
    )


def parameter(name: str, entry: Any, unit: float) -> Data:
    entry = entry if isinstance(entry, dict) else {"value": entry}
    value = number(entry.get("value"), 1.0)
    low, high = entry.get("range", (value / 2, value * 2))
    return {"name": name, "low": number(low, value / 8) / unit, "high": number(high, value) / unit}


def step(data: Data, unit: float) -> Data:
    dt = data.get("dt")
    dt = dt if isinstance(dt, dict) else {"nominal": dt}
    nominal = number(dt.get("nominal"), 0.1)
    return {"low": number(dt.get("min"), nominal / 2) / unit, "high": number(dt.get("max"), nominal * 2) / unit}


def having(data: Data, key: str) -> list[tuple[int, Data]]:
    return [(i, state) for i, state in enumerate(data["states"].values()) if key in state]


def turns(data: Data) -> list[tuple[int, str]]:
    made = []
    for i, state in having(data, "kind"):
        kind = state["kind"]
        if kind == "angle":
            made.append((i, "3.14159265358979323846"))
        elif isinstance(kind, dict) and isinstance(kind["periodic"], int | float):
            made.append((i, repr(kind["periodic"] / 2)))
    return made


def limits(data: Data) -> list[tuple[int, str, str]]:
    """(state, floor, ceiling) as the filter promises them; a bank combines, so promises nothing."""
    options = data["filter"]
    if "imm" in data or not {"variance_floor", "variance_ceiling"} & set(options):
        return []
    made = []
    for i, name in enumerate(data["states"]):
        ends = []
        for key, default in (("variance_floor", -1.0), ("variance_ceiling", float("inf"))):
            value = options.get(key)
            value = value.get(name) if isinstance(value, dict) else value
            ends.append(repr(number(value, default)).replace("inf", "(double)INFINITY"))
        made.append((i, *ends))
    return made


def positive(data: Data) -> bool:
    """Whether NOT_POSITIVE is never right: no negative weights among the points."""
    filters = [data["filter"], *(mode.get("filter", {}) for mode in data.get("imm", {}).get("modes", {}).values())]
    for options in filters:
        points = options.get("sigma_points", {})
        kind = points.get("kind", "merwe")
        if kind == "custom" or (kind == "julier" and number(points.get("kappa"), 0.0) < 0):
            return False
        if kind in ("merwe", "wiki") and number(points.get("beta"), 2.0) < number(points.get("alpha"), 1.0) ** 2:
            return False
    return data.get("campaign", True) is True
