"""Compiled filters along plausible tracks, held against the reference and the second oracle; fixed point in its box."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from kfgen.native import NativeFilter
from kfgen.native.run import plan
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.spec.sensors import readings_of
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status
from tests.campaign.generate import text_of
from tests.campaign.model import Data
from tests.campaign.oracle_model import UnfollowedError
from tests.campaign.oracle_points import oracle

STEPS = 25
TOLERANCE = 1e-9
EPS = float(np.finfo(float).eps)
SINGULAR = 1e-6  # of sigma points, where a pivot of P may be rounding alone
BLURRED = 1e-3  # the last digit is amplified to this: nothing is left to compare
FIXED_X, FIXED_P = 0.1, 0.2  # sigma, and relative to the variance


def calls(spec: Spec, seed: int) -> Iterator[tuple[str | None, dict[str, Any]]]:
    """(None, arguments of predict) or (sensor, arguments of its update) along a track that the model draws."""
    dice = random.Random(seed)
    work = plan(spec, simulate(spec, STEPS, seed, {s.name: 1 + i % 2 for i, s in enumerate(spec.measurements)}, 0.1))
    run_time = spec.dt is not None and spec.dt.run_time
    for row in range(STEPS):
        u = {"u": work.u[row]} if spec.inputs else {}
        if work.step[row]:
            yield None, {**u, **({"dt": float(work.dt[row])} if run_time else {})}
        for i, (sensor, place) in enumerate(readings_of(spec)):
            m = len(sensor.components)
            z, inputs = np.split(work.z[row, place].copy(), [m])
            if not work.mask[row, i]:
                continue
            if dice.random() < 0.1 and spec.scalar == "double":
                z[dice.randrange(m)] += dice.choice((-1, 1)) * dice.choice((1, 5, 30))
            mask = {"mask": dice.randrange(1, 1 << m)} if sensor.partial and dice.random() < 0.3 else {}
            yield sensor.name, {"z": z, **u, **mask, **({"inputs": inputs} if sensor.inputs else {})}


def _made(kf: Any, sensor: str | None, arguments: dict[str, Any]) -> int:
    if sensor is None:
        return int(kf.predict(**arguments))
    known = dict(arguments)
    if isinstance(kf, NativeFilter):
        names = [f"update_{sensor}{end}" for end in ("", "_masked")]
        if not any(kf.struct.takes(name, "u") for name in names):
            known.pop("u", None)
    elif not kf.sensors[sensor].takes_inputs:
        known.pop("u", None)
    return int(kf.update(sensor, **known))


class _Second:
    """The second oracle with the calls of the others; None once it has met what it does not follow."""

    def __init__(self, data: Data) -> None:
        self.reason = ""
        try:
            self.kf: Any = oracle(data)
        except UnfollowedError as reason:
            self.kf, self.reason = None, str(reason)

    def call(self, sensor: str | None, arguments: dict[str, Any]) -> None:
        if self.kf is None:
            return
        model = self.kf.model
        u = np.asarray(arguments.get("u", np.zeros(model.nu)), dtype=float)
        try:
            with np.errstate(all="ignore"):
                if sensor is None:
                    self.kf.predict(u, arguments.get("dt", model.nominal))
                else:
                    m = len(arguments["z"])
                    mask = arguments.get("mask", (1 << m) - 1)
                    self.kf.update(sensor, arguments["z"], u, [i for i in range(m) if mask >> i & 1])
        except (UnfollowedError, np.linalg.LinAlgError) as reason:
            self.kf, self.reason = None, str(reason)


def compare(kf: NativeFilter, data: Data, seed: int) -> tuple[list[str], int, str]:
    """What differs (kinds, the first of each), how many calls were compared, why the oracle did not follow."""
    return _fixed(kf, data, seed) if kf.spec.scalar.startswith("q") else _double(kf, data, seed)


def _double(kf: NativeFilter, data: Data, seed: int) -> tuple[list[str], int, str]:
    spec = kf.spec
    ref, shaken, second = reference(spec), reference(spec), _Second(data)
    for each in (kf, ref, shaken):
        each.init()
    if "adapt_R" in str(data) and any(sensor.partial for sensor in spec.measurements):
        second.kf, second.reason = None, "adapt_R with masks"
    if spec.filter.gain is not None:
        second.kf, second.reason = None, "a steady gain"
    distance = _Distance(ref, steady=spec.filter.gain is not None)
    tolerance = SINGULAR if "ukf" in str(data) else TOLERANCE
    count = 0
    for k, (sensor, arguments) in enumerate(calls(spec, seed)):
        ours, theirs = _made(kf, sensor, arguments), _made(ref, sensor, arguments)
        _made(shaken, sensor, arguments)
        shaken.displace(lambda x: x * (1 + EPS))
        second.call(sensor, arguments)
        count += 1
        what = "predict" if sensor is None else "update"
        if (ours ^ theirs) & ~Status.REGULARIZED:
            if ours >= ERROR or theirs >= ERROR:
                return [f"{what}: status differs from the reference's: {ours:#x} for {theirs:#x}"], count, second.reason
            return [], count, second.reason  # a decision at a threshold, by round-off
        distance.see(ref)
        # where the model amplifies the last digit, that is what can be asked
        allowed = max(tolerance, 64 * distance(shaken, ref)[0])
        if allowed > BLURRED:
            return [], count, second.reason
        found = _verdict(distance, kf, ref, second.kf, allowed)
        if found:
            return [f"{what}: {found}, call {k}"], count, second.reason
    return [], count, second.reason


def _verdict(distance: _Distance, kf: Any, ref: Any, second: Any, allowed: float) -> str:
    """Which of the compiled filter, the reference and the second oracle stands alone, and in what."""
    error, which = distance(kf, ref)
    if second is None:
        return f"{which} differs from the reference's" if error > allowed else ""
    between, apart = distance(second, ref)
    if error > allowed:
        to_second = distance(kf, second)[0]
        if to_second <= allowed:
            return f"{which} of the reference differs from the filter and the second oracle"
        if between <= allowed:
            return f"{which} differs from the reference's and the second oracle's"
        return f"{which} differs, and the oracles differ among themselves" if error > 8 * between else ""
    return f"{apart} of the second oracle differs from the filter and the reference" if between > 8 * allowed else ""


class _Distance:
    """How far two filters are apart, by magnitudes learnt along the track.

    x of its largest and of the largest sigma; P_ij of sqrt(P_ii P_jj), but for what rounding leaves of a large P_ii
    that an update has taken away.
    """

    def __init__(self, ref: Any, steady: bool) -> None:
        self.steady = steady
        self.largest, self.top = np.full(ref.model.n, 1e-3), np.zeros(ref.model.n)
        self.periods = dict(getattr(ref.model, "periods", {}))
        self.see(ref)

    def see(self, ref: Any) -> None:
        self.largest = np.maximum(self.largest, np.abs(ref.x))
        if not self.steady:
            self.top = np.maximum(self.top, np.diag(ref.P))

    def __call__(self, a: Any, b: Any) -> tuple[float, str]:
        d = np.abs(a.x - b.x)
        for i, period in self.periods.items():
            d[i] = min(d[i], abs(d[i] - period))
        x = float(np.max(d / (self.largest + np.sqrt(self.top))))
        if self.steady:
            return _known(x), "x"
        P, Q = a.P, b.P
        variance = np.diag(Q)
        floor = np.maximum(variance, 1e-6 * self.top)
        lost = 16 * len(d) * EPS * float(np.max(self.top / np.maximum(variance, EPS * self.top + 1e-300)))
        scale = np.sqrt(np.outer(floor, floor)) * max(1.0, lost / TOLERANCE) + 1e-20
        y = float(np.max(np.abs(P - Q) / scale))
        return max((_known(x), "x"), (_known(y), "P"))


def _known(value: float) -> float:
    return value if value == value else float("inf")


def _fixed(kf: NativeFilter, data: Data, seed: int) -> tuple[list[str], int, str]:
    """From a random place of the declared box; the reference in float64 is given what the integers hold."""
    dice = random.Random(seed)
    moved = {**data, "states": {name: dict(state) for name, state in data["states"].items()}}
    for state in moved["states"].values():
        if "range" in state:
            state["init"] = dice.uniform(*state["range"]) * 0.8
    spec = replace(loads(text_of(moved)), scalar=kf.spec.scalar)
    ref = reference(kf.spec)
    kf.init()
    ref.init()
    start = np.array([float(state["init"]) for state in moved["states"].values()])
    kf.set_state(start)
    ref.set_state(start)
    count, unit = 0, kf.struct.units
    found: list[str] = []
    for sensor, arguments in calls(spec, seed):
        ours, theirs = _made(kf, sensor, arguments), _made(ref, sensor, arguments)
        count += 1
        inside = all(
            "range" not in s or s["range"][0] <= v <= s["range"][1]
            for s, v in zip(data["states"].values(), ref.x, strict=True)
        )
        if not inside:
            break
        if ours & Status.SATURATED:
            return ["fixed point: SATURATED in the declared box"], count, ""
        if (ours ^ theirs) & ~Status.REGULARIZED:
            return ([f"fixed point: status {ours:#x} for {theirs:#x}"] if max(ours, theirs) >= ERROR else []), count, ""
        if kf.spec.filter.gain is not None:
            continue
        variance = np.diag(ref.P)
        d = np.abs(kf.x - ref.x)
        for i, period in getattr(ref.model, "periods", {}).items():
            d[i] = min(d[i], abs(d[i] - period))
        if np.any(d > FIXED_X * np.sqrt(variance) + 4 * unit.x):
            found = ["fixed point: x is more than 0.1 sigma off"]
        elif np.any(np.abs(np.diag(kf.P) - variance) > FIXED_P * variance + 4 * np.diag(unit.P)):
            found = ["fixed point: a variance is more than 20 % off"]
        if found:
            break
    return found, count, ""
