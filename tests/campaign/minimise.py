"""Smaller specs that still fail in the same way: states, sensors, noises, terms and options are left out by turns."""

from __future__ import annotations

import copy
import re
import time
from collections.abc import Callable, Iterator
from typing import Any

from tests.campaign.model import Data

DEFAULTS = ("initialize", "covariances", "code", "noise_covariance")


def minimised(data: Data, fails: Callable[[Data], bool], seconds: float) -> Data:
    """The smallest spec found in that time for which `fails` still holds."""
    end = time.monotonic() + seconds
    smaller = True
    while smaller:
        smaller = False
        for candidate in candidates(data):
            if time.monotonic() > end:
                return data
            if fails(candidate):
                data, smaller = candidate, True
                break
    return data


def candidates(data: Data) -> Iterator[Data]:
    """Specs with one thing less, the largest things first."""
    for key in DEFAULTS:
        if key in data:
            yield _without(data, key)
    if "imm" in data:
        yield from _fewer_modes(data)
    for sensor, entry in data["measurements"].items():
        if len(data["measurements"]) > 1:
            yield _without(data, "measurements", sensor)
        for key in ("gate", "partial", "noise"):
            if key in entry:
                yield _valued(_without(data, "measurements", sensor, key), dict.fromkeys(entry.get("noise", {}), "0"))
        for component in entry["z"]:
            if len(entry["z"]) > 1 and "R" not in entry:
                yield _without(data, "measurements", sensor, "z", component)
    yield from _fewer_states(data)
    for key in ("noise", "inputs", "parameters", "let"):
        for name, entry in data.get(key, {}).items():
            value = entry.get("value", 0) if isinstance(entry, dict) else entry if key == "parameters" else 0
            yield _valued(_without(data, key, name), {name: f"{value}"})
    for key in data["filter"]:
        if key not in ("type", "covariance", "update"):
            yield _without(data, "filter", key)
    for state, entry in data["states"].items():
        for key in ("kind", "bounds"):
            if key in entry:
                yield _without(data, "states", state, key)
    for state, expression in data.get("dynamics", {}).get("f", {}).items():
        for shorter in _shorter(expression):
            yield _with(data, shorter, "dynamics", "f", state)
    for sensor, entry in data["measurements"].items():
        for component, content in entry["z"].items():
            for shorter in _shorter(content["h"]):
                yield _with(data, shorter, "measurements", sensor, "z", component, "h")
    if isinstance(data.get("dt"), dict):
        yield _with(data, data["dt"]["nominal"], "dt")
    if data.get("dynamics", {}).get("form") == "continuous" and not any(
        "density" in str(w) for w in data.get("noise", {}).values()
    ):
        yield _with(data, {"f": data["dynamics"]["f"], "Q": data["dynamics"].get("Q", {})}, "dynamics")


def _fewer_states(data: Data) -> Iterator[Data]:
    """A state's place is taken by its initial value."""
    names = list(data["states"])
    for i, name in enumerate(names):
        if len(names) == 1:
            return
        init = data["states"][name].get("init", 0)
        made = _without(data, "states", name)
        parts = [made, *made.get("imm", {}).get("modes", {}).values()]
        for part in parts:
            dynamics = part.get("dynamics", {})
            dynamics.get("f", {}).pop(name, None)
            Q = dynamics.get("Q")
            if isinstance(Q, dict):
                Q.pop(name, None)
            elif isinstance(Q, list):
                dynamics["Q"] = _minor(Q, i)
            for key in ("variance_floor", "variance_ceiling"):
                value = part.get("filter", {}).get(key)
                if isinstance(value, dict):
                    value.pop(name, None)
                    if not value:
                        del part["filter"][key]
            if name in part.get("filter", {}).get("consider", ()):
                del part["filter"]["consider"]
        if "P0" in made:
            made["P0"] = _minor(made["P0"], i)
        yield _valued(made, {name: f"({init})"})


def _fewer_modes(data: Data) -> Iterator[Data]:
    modes = data["imm"]["modes"]
    for mode in modes.values():
        yield {**{key: value for key, value in data.items() if key != "imm"}, **mode}
    for name in modes:
        if len(modes) > 2:
            left = {key: value for key, value in modes.items() if key != name}
            k = len(left)
            M = [[0.9 if i == j else 0.1 / (k - 1) for j in range(k)] for i in range(k)]
            yield {**data, "imm": {"modes": left, "transition": M, "mu0": [1 / k] * k}}


def _minor(rows: list[list[Any]], i: int) -> list[list[Any]]:
    return [[v for b, v in enumerate(row) if b != i] for a, row in enumerate(rows) if a != i]


def _shorter(expression: Any) -> Iterator[str]:
    """A sum with one term less."""
    terms = str(expression).split(" + ")
    if len(terms) > 1:
        for i in range(len(terms)):
            shorter = " + ".join(terms[:i] + terms[i + 1 :])
            if shorter.count("(") == shorter.count(")"):
                yield shorter


def _without(data: Data, *path: str) -> Data:
    made = copy.deepcopy(data)
    part = made
    for key in path[:-1]:
        part = part[key]
    del part[path[-1]]
    if len(path) > 1 and not part and path[-2] in ("noise", "inputs", "parameters", "let"):
        return _without(made, *path[:-1])
    return made


def _with(data: Data, value: Any, *path: str) -> Data:
    made = copy.deepcopy(data)
    part = made
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    return made


def _valued(part: Any, values: dict[str, str]) -> Any:
    """Names replaced by values in every expression; a name that stands alone as a key or entry is not one."""
    if isinstance(part, dict):
        return {
            key: value if key in ("name", "type", "kind") else _valued(value, values) for key, value in part.items()
        }
    if isinstance(part, list):
        return [_valued(each, values) for each in part]
    if isinstance(part, str):
        for name, value in values.items():
            part = re.sub(rf"\b{name}\b", value, part)
    return part
