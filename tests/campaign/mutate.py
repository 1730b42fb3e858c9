"""Changes to specs that people wrote: other options, scalars and noises, parts left out, numbers far away."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from tests.campaign.model import Data
from tests.campaign.options import FORMS, POINTS

SPECS = Path(__file__).parents[2] / "specs"
SCALARS = ("double", "float", "q16.16", "q20.12")


@cache
def examples() -> tuple[Data, ...]:
    """The specs in specs/, as plain data; those of numbers alone, for calls are drawn by the keys of the data."""
    yaml = YAML(typ="safe", pure=True)
    texts = [path.read_text() for path in sorted(SPECS.glob("*.yaml"))]
    return tuple(yaml.load(text) for text in texts if "vector:" not in text and "quaternion" not in text)


def mutant(seed: int) -> Data:
    """An example after up to four changes."""
    dice = random.Random(seed)
    data = copy.deepcopy(dice.choice(examples()))
    data |= {"name": f"s{seed}", "filter": data.get("filter", {"type": "ekf"})}
    for _ in range(dice.choice((0, 1, 2, 3, 4))):
        dice.choice(CHANGES)(data, dice)
    # whether Q and R stay covariances whatever their parameters are is not known of what others wrote
    return {**data, "campaign": False}


def _scalar(data: Data, dice: random.Random) -> None:
    data["scalar"] = dice.choice(SCALARS)


def _form(data: Data, dice: random.Random) -> None:
    covariance, update = dice.choice(FORMS)
    options = data["filter"]
    options["covariance"] = covariance
    options.pop("update", None)
    if update and options.get("type") != "ukf":
        options["update"] = update


def _type(data: Data, dice: random.Random) -> None:
    kind = dice.choice(("ekf", "iekf", "ekf2", "ukf"))
    covariance = data["filter"].get("covariance", "ud")
    data["filter"] = {"type": kind, "covariance": covariance}
    if kind == "ukf":
        data["filter"]["sigma_points"] = dict(dice.choice(POINTS))


def _option(data: Data, dice: random.Random) -> None:
    key, value = dice.choice(
        (("robust", "chernodarov"), ("robust", "huber"), ("adaptive", True), ("variance_floor", 1e-9),
         ("variance_ceiling", 1e4), ("innovation_floor", 1e-9), ("adapt_R", 1e-3), ("adapt_Q", 1e-3))
    )  # fmt: skip
    data["filter"][key] = value


def _start(data: Data, dice: random.Random) -> None:
    state = data["states"][dice.choice(list(data["states"]))]
    if isinstance(state.get("std"), int | float):
        state["std"] *= dice.choice((0, 1e-3, 10, 1e3))


def _noise(data: Data, dice: random.Random) -> None:
    sensor = data["measurements"][dice.choice(list(data["measurements"]))]
    component = sensor["z"][dice.choice(list(sensor["z"]))]
    if isinstance(component.get("std"), int | float):
        component["std"] *= dice.choice((0, 1e-4, 0.1, 10))


def _sensor(data: Data, dice: random.Random) -> None:
    if len(data["measurements"]) > 1:
        del data["measurements"][dice.choice(list(data["measurements"]))]


def _manners(data: Data, dice: random.Random) -> None:
    sensor = data["measurements"][dice.choice(list(data["measurements"]))]
    change = dice.choice(("partial", "gate", "no gate"))
    if change == "partial":
        sensor["partial"] = True
    elif change == "gate":
        sensor["gate"] = {"probability": 0.95, "reset_after": 2}
    else:
        sensor.pop("gate", None)


def _code(data: Data, dice: random.Random) -> None:
    data["code"] = {"unroll": dice.choice(("none", "full")), "log_likelihood": True, "gate_count": True}


def _bounds(data: Data, dice: random.Random) -> None:
    name = dice.choice(list(data["states"]))
    state: dict[str, Any] = data["states"][name]
    if "kind" not in state and isinstance(state.get("init", 0), int | float):
        init = float(state.get("init", 0))
        state["bounds"] = [init - 5, init + 5]


CHANGES: tuple[Callable[[Data, random.Random], None], ...] = (
    _scalar, _form, _type, _option, _option, _start, _noise, _sensor, _manners, _code, _bounds,
)  # fmt: skip
