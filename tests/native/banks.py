"""What the tests of emitted banks share: banks of many kinds of modes, and a log that drives one beside its reference.

The dynamics draw tracks together, so that rounding does not grow: what is compared is the algorithm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from kfgen.generate import Generated
from kfgen.native import NativeFilter
from kfgen.native.views import ModeView
from kfgen.reference import reference
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status

# a state that is free, an angle near pi, one within bounds
TOP = """
kfgen: 1
name: mixture
scalar: double
dt: {nominal: 0.1, min: 0.05, max: 0.15}
parameters: {q: 0.3, r: 0.5}
states:
  x: {init: 0.5, std: 1}
  th: {init: 3, std: 0.5, kind: angle}
  w: {init: 0.1, std: 0.3, bounds: [-0.4, 0.5]}
covariances: [[x, w, 0.1]]
inputs: {a: {}, b: {}}
measurements:
  place:
    z: {x: {h: x + w**2/9}, y: {h: x/2 + w}}
    R: [[1, 0.2], [0.2, 0.7]]
    partial: true
    gate: {probability: 0.9}
  course: {z: {c: {h: th + x/9, std: 0.3, kind: angle}}, gate: {probability: 0.8, reset_after: 1}}
"""
# the dynamics of modes: a noise that multiplies, an input of one mode alone, t, definitions, states that stay
DYNAMICS = [
    "noise: {n: {std: 0.3}}\n"
    "dynamics: {f: {x: 0.9*x + dt*cos(th)*(1 + n), th: th + dt*a}, Q: {x: q*dt, th: 0.05, w: 0.01}}",
    "dynamics: {f: {th: th + 3*dt*w, w: 0.9*w, x: x*cos(b)}, Q: {x: 0.1, th: 0.2, w: 0.3}}",
    "noise: {n: {}, m: {}}\nnoise_covariance: [[0.04, 0.01], [0.01, 0.02]]\nlet: {c: x + sin(th)/9}\n"
    "dynamics:\n  f: {x: 0.9*c + m, w: 0.9*w*(1 + n)}\n"
    "  Q: [[0.1, 0.01, 0], [0.01, 0.1, 0.02], [0, 0.02, 0.05]]",
    "dynamics: {form: continuous, f: {x: w - x, th: w + a, w: -x/9 - w/3 + t/(9 + t)}, "
    "Q: {x: 0.01, w: 0.1*dt}, integrator: midpoint}",
]
# what a mode may have of its own
START = "states: {x: {init: -1, std: 2}, th: {init: -3.1, std: 0}, w: {init: 0, std: 0.2}}"
SENSORS = (
    "measurements:\n"
    "  place: {z: {x: {h: x*(1 + s), std: 1}, y: {h: x/2 + w, var: r}}, "
    "noise: {s: {std: 0.2}}, partial: true, gate: {probability: 0.99}}\n"
    '  course: {z: {c: {h: "atan2(sin(th), cos(th)) + a*w", std: 0.3, kind: angle}}, gate: {probability: 0.9}}'
)
OPEN = SENSORS.replace(", gate: {probability: 0.99}", "").replace("var: r", "var: 0.5")  # place refuses nothing


def covariance(mode: ModeView, order: Sequence[int]) -> np.ndarray:
    """P (n, n) of a mode's block, in the spec's order. order: inner position -> state."""
    raw = mode.raw
    n = len(raw["x"])
    if "S" in raw:
        S = np.zeros((n, n))
        S[np.tril_indices(n)] = raw["S"]
        return S @ S.T
    P = np.zeros((n, n))
    upper = np.tril_indices(n)[::-1]  # the upper triangle column by column
    if "P" in raw:
        P[upper] = raw["P"]
        return np.triu(P) + np.triu(P, 1).T
    U = np.eye(n)
    U[tuple(np.array(upper)[:, upper[0] != upper[1]])] = raw.get("U", [])
    P[np.ix_(order, order)] = U @ np.diag(raw["D"].astype(float)) @ U.T
    return P


class Pair:
    """A compiled bank and its reference, which are told the same."""

    def __init__(self, spec: Spec, made: Generated, kf: NativeFilter) -> None:
        self.kf, self.ref = kf, reference(spec)
        self.orders = [note.order for note in made.code.modes]
        self.seen = Status.OK
        self.worst = self.error()

    def __call__(self, name: str, *arguments: Any, **keywords: Any) -> int:
        """One call of both: equal statuses, an error leaves every byte."""
        before = bytes(self.kf)
        ours, theirs = (getattr(kf, name)(*arguments, **keywords) for kf in (self.kf, self.ref))
        assert ours == theirs, f"{name}{arguments}{keywords}: {ours:#x}, reference {theirs:#x}"
        if ours >= ERROR:
            assert bytes(self.kf) == before, f"{name}{arguments}{keywords}: {ours:#x}, and a change"
        self.worst = max(self.worst, self.error())
        self.seen |= Status(ours)
        return ours

    def error(self) -> float:
        """The largest difference: of states in sigmas, of covariances relative to them, of mu; nis and the
        log-likelihood relative to 1 and to themselves."""
        kf, ref = self.kf, self.ref
        worst = float(np.max(np.abs(kf.mu - ref.mu)))
        pairs = [(kf.x, kf.P, ref)]
        for mode, other, order in zip(kf.modes, ref.modes, self.orders, strict=True):
            pairs.append((mode.x, covariance(mode, order), other))
        for x, P, other in pairs:
            d = x - other.x
            for i, period in ref.model.periods.items():
                d[i] -= period * round(d[i] / period)
            sigma = np.maximum(np.sqrt(other.P.diagonal()), 1e-6)
            worst = max(worst, np.max(np.abs(d) / sigma), np.max(np.abs(P - other.P) / np.outer(sigma, sigma)))
        worst = max(worst, abs(kf.nis - ref.nis) / (1 + ref.nis))
        if kf.spec.code.log_likelihood:
            worst = max(worst, abs(kf.log_likelihood - ref.log_likelihood) / (1 + abs(ref.log_likelihood)))
        if kf.spec.code.gate_count:
            assert dict.fromkeys(ref.gate_count, 0) | kf.gate_count == ref.gate_count
        return worst

    def drive(self, steps: int, seed: int, size: float = 1.0) -> None:
        """Predicts and updates in no fixed order; masks, outliers, and now and then something set anew."""
        for name, arguments, keywords in calls(self.kf, steps, seed, size):
            self(name, *arguments, **keywords)


def calls(kf: NativeFilter, steps: int, seed: int, size: float) -> Iterator[tuple[str, list[Any], dict[str, Any]]]:
    """(function, arguments, keywords) of a random log."""
    random, n = np.random.default_rng(seed), len(kf.states)
    changes = ["set_state", "set_covariance", "indefinite", "not finite", "init"]
    changes += ["redraw"] * kf.struct.has("redraw")
    for step in range(steps):
        for _ in range(int(random.integers(0, 3))):
            keywords: dict[str, Any] = {}
            if kf.inputs:
                keywords["u"] = random.normal(size=len(kf.inputs))
            if kf.struct.takes("predict", "dt"):
                keywords["dt"] = float(random.uniform(0.04, 0.16))
            yield "predict", [], keywords
        for sensor in kf.spec.measurements:
            m = len(sensor.components)
            z = size * random.normal(size=m) * (5 if random.random() < 0.2 else 1)
            keywords = {}
            if kf.struct.takes(f"update_{sensor.name}", "u"):
                keywords["u"] = random.normal(size=len(kf.inputs))
            if sensor.partial and random.random() < 0.5:
                keywords["mask"] = int(random.integers(0, 1 << m))
            if random.random() < 0.7:
                yield "update", [sensor.name, z], keywords
        if step % 5 == 4:
            A = random.normal(size=(n, n))
            change = changes[step // 5 % len(changes)]
            arguments = {
                "set_state": [A[0]], "set_covariance": [A @ A.T / n], "indefinite": [A - A.T - np.eye(n)],
                "not finite": [np.where(A[0] > 0, A[0], np.nan)],
            }.get(change, [])  # fmt: skip
            yield {"indefinite": "set_covariance", "not finite": "set_state"}.get(change, change), arguments, {}
