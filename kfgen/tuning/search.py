"""The search for the best numbers, and what the curvature there says of them: errors, correlations, what is open."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from kfgen.errors import KfgenError
from kfgen.tuning.numbers import Slot
from kfgen.tuning.objective import Array, Objective, Score

FAR = math.log(1e6)  # how far a positive number may go from where it was, in its logarithm
STEP, ROUGH_STEP = 2e-3, 0.03  # of the gradient's differences, in the coordinates; where gates make jumps
LOOSE = math.log(10.0)  # a standard error of a logarithm beyond this tells nothing
FLAT = 2e-3  # an eigenvalue of the normalised curvature below this is none
CLEAR = 0.02  # what a difference of the curvature changes the likelihood by

Advance = Callable[[int, str], None]


@dataclass(frozen=True)
class Coordinates:
    """Numbers as the search sees them: logarithms of positive ones, others in a unit that matters."""

    slots: Sequence[Slot]
    units: Array

    def numbers(self, at: Array) -> list[float]:
        out = []
        for slot, unit, t in zip(self.slots, self.units, at.tolist(), strict=True):
            number = slot.value * math.exp(t) if slot.positive else slot.value + unit * t
            out.append(min(max(number, slot.limits[0]), slot.limits[1]))
        return out

    def bounds(self) -> list[tuple[float | None, float | None]]:
        found: list[tuple[float | None, float | None]] = []
        for slot, unit in zip(self.slots, self.units, strict=True):
            low, high = slot.limits
            if slot.positive:
                found.append((max(-FAR, math.log(low / slot.value)) if low > 0 else -FAR,
                              min(FAR, math.log(high / slot.value)) if high < math.inf else FAR))  # fmt: skip
            else:
                found.append((None if low == -math.inf else (low - slot.value) / unit,
                              None if high == math.inf else (high - slot.value) / unit))  # fmt: skip
        return found

    def slope(self, at: Array) -> Array:
        """d number / d coordinate at numbers `at`."""
        pairs = zip(self.slots, self.units, at.tolist(), strict=True)
        return np.array([number if slot.positive else unit for slot, unit, number in pairs])


@dataclass
class Search:
    """Where a search has come to. interrupted: by Ctrl-C, before its end."""

    objective: Objective
    coordinates: Coordinates
    advance: Advance = lambda done, what: None
    best: Array = field(default_factory=lambda: np.zeros(0))
    height: float = -math.inf
    interrupted: bool = False

    @property
    def uneven(self) -> bool:
        """Whether a small change may make a jump."""
        return any(sensor.gate is not None for sensor in self.objective.spec.measurements)

    def heights(self, trials: Sequence[Array]) -> Array:
        scores = self.objective.scores([self.coordinates.numbers(trial) for trial in trials])
        heights = np.array([self.objective.value(score) for score in scores])
        heights = np.where(np.isfinite(heights), heights, -1e300)
        for trial, height in zip(trials, heights.tolist(), strict=True):
            if height > self.height:
                self.best, self.height = np.array(trial), height
        self.advance(self.objective.trials, "tuning")
        return heights

    def climb(self) -> None:
        """To the top, by L-BFGS-B on differences; then by a simplex where gates make the ground uneven."""
        k = len(self.coordinates.slots)
        bounds = self.coordinates.bounds()
        try:
            self.heights([self.best if self.best.size else np.zeros(k)])
            for _ in range(4):
                before = self.height
                minimize(self._slope, self.best, jac=True, method="L-BFGS-B", bounds=bounds,
                         options={"maxiter": 100, "ftol": 1e-10, "gtol": 1e-3, "maxls": 30})  # fmt: skip
                if self.height - before < 0.01:
                    break
            if self.uneven and k <= 8:
                simplex = np.vstack([self.best, self.best + 0.2 * np.eye(k)])
                options: Any = {"initial_simplex": simplex, "maxfev": 60 * k, "fatol": 0.01, "xatol": 1e-3}
                minimize(self._depth, self.best, method="Nelder-Mead", bounds=bounds, options=options)
        except KeyboardInterrupt:
            self.interrupted = True

    def _depth(self, at: Array) -> float:
        return -float(self.heights([at])[0])

    def _slope(self, at: Array) -> tuple[float, Array]:
        step = ROUGH_STEP if self.uneven else STEP
        moved = [at + sign * step * row for row in np.eye(len(at)) for sign in (1.0, -1.0)]
        heights = self.heights([at, *moved])
        slope = (heights[1::2] - heights[2::2]) / (2 * step)
        return -float(heights[0]), -slope


def units_of(objective: Objective, slots: Sequence[Slot]) -> Array:
    """By how much each number that is not positive has to change to matter; 1 for the others, which are logarithms.

    KfgenError for a number that changes nothing at all.
    """
    start = [slot.value for slot in slots]
    base = objective.scores([start])[0]
    units, idle = np.ones(len(slots)), []
    for i, slot in enumerate(slots):
        step = 0.5 if slot.positive else _first_step(slot)
        for _ in range(24):
            trial = list(start)
            trial[i] = slot.value * math.exp(step) if slot.positive else slot.value + step
            score = objective.scores([trial])[0]
            if slot.positive or abs(objective.value(score) - objective.value(base)) > 0.1:
                break
            step *= 4.0
        if _same(score, base):
            idle.append(slot.path)
        units[i] = 1.0 if slot.positive else step
    if idle:
        where = "this log" if len(objective.drives) == 1 else "these logs"
        listed = ", ".join(idle)
        raise KfgenError(f"{listed} changes nothing on {where}: no measurement depends on it; leave it out of --free")
    return units


def _first_step(slot: Slot) -> float:
    low, high = slot.limits
    width = high - low if math.isfinite(high - low) else abs(slot.value) or 1.0
    return 1e-4 * width


def _same(a: Score, b: Score) -> bool:
    return a.likelihood == b.likelihood and a.error == b.error


@dataclass(frozen=True)
class Curvature:
    """What the second derivatives at the top tell.

    errors [k]: standard errors of the numbers, NaN where the data cannot tell them. correlations [k, k]: of the
    coordinates, NaN likewise. unidentified: sentences. loose: the slots that stay open by themselves, and how large
    they may be before the likelihood falls by 1/2.
    """

    errors: Array
    correlations: Array
    unidentified: tuple[str, ...]
    loose: Mapping[int, float]


def curvature(found: Search) -> Curvature:
    """By central differences, wide enough for the likelihood's change to be seen, small enough for it to be even.

    What the gates have decided at the top stays decided (at their thresholds the likelihood jumps): the curvature is
    that at the top of the likelihood of what they let in.
    """
    still = found.objective.decided(found.coordinates.numbers(found.best))
    search = Search(still, found.coordinates, lambda done, what: found.advance(found.objective.trials + done, what))
    search.best = found.best
    if still is not found.objective:
        search.climb()
        if search.interrupted:
            raise KeyboardInterrupt
    result = _curvature(search)
    found.objective.trials += still.trials if still is not found.objective else 0
    return result


def _curvature(search: Search) -> Curvature:
    slots, k = search.coordinates.slots, len(search.best)
    top, height = search.best, float(search.heights([search.best])[0])
    widths, drops = _widths(search, top, height, CLEAR)
    open_alone = [i for i in range(k) if not drops[i] > 0.25 * CLEAR]
    told = [f"{slots[i].path}: {_why_alone(search, i)}" for i in open_alone]
    used = [i for i in range(k) if i not in open_alone]
    errors, correlations = np.full(k, math.nan), np.full((k, k), math.nan)
    if not used:
        return Curvature(errors, correlations, tuple(told), {i: upper(search, i) for i in open_alone})
    H = _hessian(search, top, height, widths, used)
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    values, vectors = np.linalg.eigh(H / np.outer(scale, scale))
    flat = [j for j in range(len(used)) if values[j] < FLAT]
    tied: set[int] = set()
    for j in flat:
        direction = vectors[:, j] / scale
        members = [m for m in range(len(used)) if abs(vectors[m, j]) > 0.3]
        tied |= {used[m] for m in members}
        told.append(_tie(search, top, height, used, members, direction))
    kept = [j for j in range(len(used)) if j not in flat]
    covariance = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T / np.outer(scale, scale)
    slope = search.coordinates.slope(np.array(search.coordinates.numbers(top)))
    for a, i in enumerate(used):
        if i in tied:
            continue
        error = math.sqrt(max(covariance[a, a], 0.0))
        if slots[i].positive and error > LOOSE:
            told.append(f"{slots[i].path}: {_why_alone(search, i)}")
            open_alone.append(i)
            continue
        # of a positive number, whose logarithm is estimated: that of the lognormal distribution
        errors[i] = math.sqrt(math.expm1(error**2) * math.exp(error**2) if slots[i].positive else error**2) * abs(
            slope[i]
        )
        for b, other in enumerate(used):
            if other not in tied:
                correlations[i, other] = covariance[a, b] / math.sqrt(covariance[a, a] * covariance[b, b])
    return Curvature(errors, correlations, tuple(told), {i: upper(search, i) for i in open_alone})


def _widths(search: Search, top: Array, height: float, wanted: float) -> tuple[Array, Array]:
    """How far each coordinate has to move for the likelihood to fall by about so much, and what it then falls by.

    At a positive number's end, `LOOSE`, what it falls by until there.
    """
    k = len(top)
    widths = np.full(k, 0.05)
    most = np.where([slot.positive for slot in search.coordinates.slots], LOOSE, 1e6)
    near, far = np.zeros(k), np.full(k, math.inf)
    drops = np.zeros(k)
    for _ in range(30):
        moved = [top + sign * widths[i] * np.eye(k)[i] for i in range(k) for sign in (1.0, -1.0)]
        drops = height - search.heights(moved).reshape(k, 2).mean(axis=1)
        near = np.where(drops < 0.5 * wanted, np.maximum(near, widths), near)
        far = np.where(drops > 2.0 * wanted, np.minimum(far, widths), far)
        settled = ((drops >= 0.5 * wanted) & (drops <= 2.0 * wanted)) | ((drops >= 0.5 * wanted) & (far < 1.3 * near))
        settled |= (near >= most) & (widths >= most)
        if settled.all():
            break
        step = np.clip(np.sqrt(wanted / np.maximum(drops, 1e-3 * wanted)), 0.1, 10.0)
        between = np.sqrt(np.maximum(near, 1e-9) * np.where(np.isfinite(far), far, 1.0))
        inner = np.where(far < 1.3 * near, far, between)
        bracketed = (near > 0) & np.isfinite(far)
        new = np.where(bracketed, inner, np.minimum(widths * step, most))
        widths = np.where(settled, widths, new)
    return widths, drops


def _hessian(search: Search, top: Array, height: float, widths: Array, used: Sequence[int]) -> NDArray[np.float64]:
    """Of minus the likelihood, over the coordinates in use."""
    k, unit = len(used), np.eye(len(top)) * widths
    trials, places = [], []
    for a in range(k):
        for b in range(a + 1):
            i, j = used[a], used[b]
            shifts = [unit[i], -unit[i]] if a == b else [s * unit[i] + r * unit[j] for s in (1, -1) for r in (1, -1)]
            trials += [top + shift for shift in shifts]
            places.append((a, b, len(shifts)))
    heights = search.heights(trials)
    H, first = np.zeros((k, k)), 0
    for a, b, number in places:
        found = heights[first : first + number]
        first += number
        if number == 2:
            second = (found[0] - 2 * height + found[1]) / widths[used[a]] ** 2
        else:
            second = (found[0] - found[1] - found[2] + found[3]) / (4 * widths[used[a]] * widths[used[b]])
        H[a, b] = H[b, a] = -second
    return H


def _why_alone(search: Search, i: int) -> str:
    slot = search.coordinates.slots[i]
    if not slot.positive:
        return "the data cannot tell it"
    return f"the data cannot tell it from 0 (below {upper(search, i, 1.92):.2g} with 95 %)"


def upper(search: Search, i: int, fall: float = 0.5) -> float:
    """Up to where a positive number may grow before the likelihood falls by so much (1/2: one standard error)."""
    best = search.best
    top = float(search.heights([best])[0])
    low, high = float(best[i]), float(best[i])
    for _ in range(40):
        high += 0.5
        if top - float(search.heights([_moved(best, i, high)])[0]) > fall or high > FAR:
            break
        low = high
    for _ in range(6):
        middle = 0.5 * (low + high)
        if top - float(search.heights([_moved(best, i, middle)])[0]) > fall:
            high = middle
        else:
            low = middle
    return search.coordinates.numbers(_moved(best, i, low))[i]


def _moved(at: Array, i: int, to: float) -> Array:
    out = at.copy()
    out[i] = to
    return out


def _tie(search: Search, top: Array, height: float, used: Sequence[int], members: Sequence[int], d: Array) -> str:
    """A sentence on numbers that can change together without a trace."""
    slots = search.coordinates.slots
    paths = [slots[used[m]].path for m in members]
    if len(members) == 1:
        return f"{paths[0]}: the data cannot tell it"
    listed = f"{', '.join(paths[:-1])} and {paths[-1]}"
    if len(members) > 2 or not all(slots[used[m]].positive for m in members):
        return f"{listed}: only a combination of them"
    first, second = (d[m] for m in members)
    along = np.zeros(len(top))
    along[used[members[0]]], along[used[members[1]]] = math.copysign(0.5, first), math.copysign(0.5, second)
    straight = abs(height - float(search.heights([top + along])[0])) < 0.5 and abs(first + second) + abs(
        first - second
    ) < 2.2 * max(abs(first), abs(second))
    if first * second > 0:
        return f"{listed}: only their ratio"
    return f"{listed}: only their {'product' if straight else 'sum'}"
