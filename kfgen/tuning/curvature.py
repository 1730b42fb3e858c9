"""What the curvature at the top says of the numbers there: standard errors, correlations, what the data leave open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kfgen.tuning.objective import Array
from kfgen.tuning.search import FAR, LOOSE, Search

FLAT = 2e-3  # an eigenvalue of the normalised curvature below this is none
CLEAR = 0.02  # what a difference of the curvature changes the likelihood by


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
    highest = upper(search, i, 1.92)
    if highest >= 0.1 * slot.value * math.exp(FAR):
        return "the data cannot tell it"
    return f"the data cannot tell it from 0 (below {highest:.2g} with 95 %)"


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
