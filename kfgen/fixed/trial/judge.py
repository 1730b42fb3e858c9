"""Whether the integers carry a filter: they are tried, and what they may be off by is weighed."""

from __future__ import annotations

import math
from collections.abc import Collection

from kfgen.errors import Mistake, Place, SpecError
from kfgen.filters.base import FilterCode
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.fixed.formats.formats import Formats
from kfgen.fixed.ranges.declared import limits
from kfgen.fixed.ranges.generator import Random
from kfgen.fixed.ranges.real import RealProgram
from kfgen.fixed.ranges.weather import Weather
from kfgen.fixed.trial.integers import IntegerProgram
from kfgen.fixed.trial.probe import Departure, probe, shaken
from kfgen.fixed.trial.tour import FAILING, MARGIN, WIDE, Found
from kfgen.spec.types import Spec

PROBED = 120  # rows that the integers are tried on
CLOSE = 0.01  # standard deviations, and share of a variance: half of what `check` allows
CHAOTIC = 16.0  # times as far as real numbers depart by less than what formats lose
NARROWED = 12  # bits: no range that is narrower by more is of use


def judge(program: RealProgram, real: FilterCode, integers: IntegerProgram, integer: FilterCode, formats: Formats,
          scalar: Fixed, weather: Weather) -> tuple[str, ...]:  # fmt: skip
    """Try the integers beside the real numbers: what is to be said of them. SpecError where they do not follow."""
    log, rows = weather.log(PROBED, Random(11), Random(111))
    found = probe(program, real, integers, integer, formats, log, rows)
    if found.sigmas <= CLOSE and found.share <= CLOSE and not found.errors:
        return ()
    model = shaken(program, real, formats, log, rows)
    if not found.errors and not found.beyond(model, FAILING, CHAOTIC):
        if not found.beyond(model, CLOSE, CHAOTIC) and found.share <= CLOSE:
            return ()  # the model magnifies whatever is rounded
        if found.share <= WIDE:
            return _coarse(found, formats, real, scalar)
    state = real.model.spec.states[found.state]
    what, bits = _carrying(formats, found.state, real, scalar), _missing(found.sigmas)
    raise SpecError.at(
        state.place, f"{what}; {bits} {'bits are' if bits > 1 else 'bit is'} missing",
        _cure(real, found.state, bits),
    )  # fmt: skip


def _coarse(found: Departure, formats: Formats, real: FilterCode, scalar: Fixed) -> tuple[str, ...]:
    """Of what is right, but not to the digits that a check along the model's own track wants."""
    far = found.sigmas > CLOSE
    i = found.state if far else found.widest
    bits = math.ceil(math.log2(max(found.sigmas, found.share) / CLOSE))
    largest, least = _spread(formats, i, len(real.model.states))
    return (
        f"{scalar.name} carries `{real.model.spec.states[i].name}` within {found.sigmas:.2g} standard deviations and "
        f"{found.share:.1%} of its variance, where `check` wants {2 * CLOSE:.0%}: its standard deviation goes from "
        f"{largest:.3g} to {least:.3g}; {bits} bit{'s' * (bits > 1)} missing; {_cure(real, i, bits)}",
    )


def hear(spec: Spec, heard: Collection[str]) -> None:
    """SpecError for a sensor that has never measured anything in the runs, so that nothing is known of its update."""
    mistakes = [
        Mistake(
            sensor.place, f"`{sensor.name}` has no value in any run of the model, and its update no binary points",
            "let the filter start where h has a value, declare ranges in which it has, or give a log",
        )
        for sensor in spec.measurements if sensor.name not in heard
    ]  # fmt: skip
    if mistakes:
        raise SpecError(mistakes)


def refuse(
    found: Found, shaken: Found, real: FilterCode, formats: Formats, scalar: Fixed, last: bool
) -> tuple[str, ...]:
    """SpecError where the integers have not followed everywhere in the declared box.

    shaken: what digits that no format keeps make of the model there, which may magnify whatever is rounded. last: what
    saturates now and then, with the flag, but follows all the same, is told instead.
    """
    if found.saturated and not last:
        raise SpecError.at(*_saturated(found, real, scalar))
    far = found.sigmas > max(MARGIN * FAILING, CHAOTIC * shaken.sigmas)
    if not far and found.share <= max(MARGIN * WIDE, CHAOTIC * shaken.share) and not found.errors:
        return ("; ".join(_saturated(found, real, scalar)[1:]),) if found.saturated else ()
    i = found.state if far else found.widest
    bits = max(_missing(found.sigmas), math.ceil(math.log2(max(min(found.share, 1e9) / (MARGIN * WIDE), 2.0))))
    what = _carrying(formats, i, real, scalar)
    raise SpecError.at(
        real.model.spec.states[i].place,
        f"{what}, everywhere in the declared ranges; {bits} bit{'s' * (bits > 1)} missing",
        f"{_narrower(real, i, bits)}; or {_other(real)}",
    )  # fmt: skip


def _saturated(found: Found, real: FilterCode, scalar: Fixed) -> tuple[Place, str, str]:
    """That something has no format that holds it everywhere: where, what, what to do."""
    function, times = found.saturated.most_common(1)[0]
    i = found.widest if found.share > 0 else found.state
    return (
        real.model.spec.states[i].place,
        f"{scalar.name} cannot carry all that `{function}` computes in the declared ranges: it saturates in {times} of "
        f"{found.rows} steps; 1 bit missing, at least",
        f"{_narrower(real, i, 1)}; or {_other(real)}",
    )


def _cure(real: FilterCode, i: int, bits: int) -> str:
    if bits > NARROWED:
        return f"start with a smaller std, give what sees it a larger one, {_other(real)}"
    if real.model.spec.states[i].range is None:
        return f"start with a smaller std, declare a range, {_other(real)}"
    return f"{_narrower(real, i, bits)}; or start with a smaller std, {_other(real)}"


def _other(real: FilterCode) -> str:
    """What else may do: a full covariance needs the fewest digits, as it divides by nothing but S."""
    full = not any(block.name.rpartition(".")[2] in ("D", "S") for block in real.blocks)
    return "or use float" if full else "try covariance: full, or use float"


def _narrower(real: FilterCode, i: int, bits: int) -> str:
    """The range of a state that is by so many bits smaller, or which others would have to be."""
    model = real.model
    state = model.spec.states[i]
    if state.range is None:
        return f"narrow the ranges of what it depends on by a factor of {2**bits}"
    low, high = limits(state.range, model.spec)
    middle = min(max(float(model.x0[i]), low), high)
    low, high = (middle + (end - middle) / 2**bits for end in (low, high))
    return f"range: [{low:.4g}, {high:.4g}] would fit, or narrow those of what it depends on by a factor of {2**bits}"


def _missing(sigmas: float) -> int:
    return max(1, math.ceil(math.log2(min(sigmas, 1e9) / FAILING))) if sigmas > FAILING else 1


def _carrying(formats: Formats, i: int, real: FilterCode, scalar: Fixed) -> str:
    states = real.model.spec.states
    error = real.model.space.errors_of[i] or 0
    largest, least = _spread(formats, error, len(real.model.errors))
    what = f"{scalar.name} cannot carry `{states[i].name}`"
    return f"{what}: its standard deviation goes from {largest:.3g} to {least:.3g}" if least > 0 else what


def _spread(formats: Formats, i: int, n: int) -> tuple[float, float]:
    """The largest and the smallest standard deviation of a state that the runs have met."""
    cell = formats.arrays.variance(i, n)
    return math.sqrt(formats.ranges.largest(cell)), math.sqrt(formats.ranges.smallest(cell))
