"""Random options of filters: form, points, robustness, adaptation, limits, code, and banks of several of them."""

from __future__ import annotations

from typing import Any

from tests.campaign.model import Data, Draw

FORMS = (("ud", "bierman"), ("ud", "joseph"), ("full", "joseph"), ("full", "standard"), ("sqrt", None))
POINTS: tuple[dict[str, Any], ...] = (
    {}, {"kind": "merwe", "alpha": 0.5, "beta": 2, "kappa": 1}, {"kind": "merwe", "alpha": 0.1},
    {"kind": "julier", "kappa": 1}, {"kind": "julier", "kappa": -0.5},
    {"kind": "wiki"}, {"kind": "trivial"}, {"kind": "cubature"},
)  # fmt: skip


def options(draw: Draw, data: Data) -> None:
    """Adds filter, imm, initialize and code to a spec."""
    if draw.type == "imm":
        data["filter"] = filter_of(draw, "ekf", data)
        data["imm"] = bank(draw, data)
    else:
        data["filter"] = filter_of(draw, draw.type, data)
    if draw.chance(0.15):
        sensor = draw.dice.choice(list(data["measurements"]))
        component = next(iter(data["measurements"][sensor]["z"]))
        data["initialize"] = {"from": sensor, "states": {"x0": component}}
    code: Data = {}
    if not draw.fixed and draw.type != "imm" and draw.chance(0.5):
        code["unroll"] = draw.dice.choice(("full", "none"))
    for key in ("log_likelihood", "gate_count"):
        if draw.chance(0.3):
            code[key] = True
    if code:
        data["code"] = code


def filter_of(draw: Draw, kind: str, data: Data) -> Data:
    """The options of one filter."""
    dice, chance = draw.dice, draw.chance
    covariance, update = dice.choice(FORMS)
    made: Data = {"type": kind, "covariance": covariance}
    if kind != "ukf" and update:
        made["update"] = update
    if kind == "kf" and chance(0.15):
        made["gain"] = "steady"
    if kind == "iekf":
        made["iterations"] = dice.choice((1, 2, 3))
    if kind == "ukf":
        sigma_points(draw, made, data)
    scalars = kind != "iekf" and (kind != "ukf" or made.get("sequential", False))
    if scalars and chance(0.3):
        made["robust"] = dice.choice(
            ("chernodarov", "huber", {"influence": "huber", "k": 2}, {"psi": "e/(1 + e**2/16)"})
        )
    if kind != "iekf" and chance(0.3):
        made["adaptive"] = dice.choice((True, {"probability": 0.99}, {"chi2": 8}))
    if kind != "iekf" and chance(0.15) and not data.get("parameters") and not data.get("inputs"):
        made["adapt_R"] = 0.01
    Q = data["dynamics"]["Q"]
    constant = not isinstance(Q, dict) or not any(isinstance(v, str) for v in Q.values())
    if kind in ("kf", "ekf", "ekf2") and chance(0.15) and constant:
        made["adapt_Q"] = 0.01
    if kind != "ukf" and update == "joseph" and draw.n > 1 and chance(0.3):
        made["consider"] = [dice.choice(draw.states)]
    if kind != "ukf" and update == "joseph" and chance(0.2):
        made["gain_limit"] = 0.5
    if chance(0.15):
        made["variance_floor"] = {"x0": 0.01 * draw.scales[0] ** 2}
    if chance(0.15):
        made["variance_ceiling"] = {draw.states[-1]: 4 * draw.scales[-1] ** 2}
    if chance(0.08):
        made["innovation_floor"] = 0.01
    return made


def sigma_points(draw: Draw, made: Data, data: Data) -> None:
    """The part of a ukf's options that others do not have."""
    points = dict(draw.dice.choice(POINTS))
    if draw.fixed:
        points.pop("alpha", None)
    if made["covariance"] == "ud" and draw.chance(0.4):
        made["sequential"] = True
    if draw.chance(0.2) and len(data["measurements"]) == 1:
        points |= {"redraw": False}
    if points:
        made["sigma_points"] = points
    if draw.noises and draw.chance(0.3):
        made["augment"] = True
    if draw.chance(0.15) and points.get("kind") != "cubature":
        made["reject"] = draw.dice.choice(("non_finite", f"abs(x0) > {50 * draw.scales[0]}"))


def bank(draw: Draw, data: Data) -> Data:
    """Two or three modes of different types, noises and starts over one state."""
    count = draw.dice.choice((2, 2, 3))
    modes: Data = {}
    for k in range(count):
        mode: Data = {"filter": filter_of(draw, draw.dice.choice(("ekf", "ekf2", "iekf", "ukf")), data)}
        if k:
            mode["dynamics"] = draw.dynamics("let" in data) | {"form": data["dynamics"]["form"]}
        modes[f"k{k}"] = mode
    others = 0.1 / (count - 1)
    transition = [[0.9 if i == j else others for j in range(count)] for i in range(count)]
    if draw.chance(0.2):
        transition[0] = [1.0 if j == 0 else 0.0 for j in range(count)]
    return {"modes": modes, "transition": transition, "mu0": [1 / count] * count}
