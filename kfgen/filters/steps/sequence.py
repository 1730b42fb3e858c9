"""The measurement update, one scalar measurement after another (Bierman 1977, ch. V).

The innovation of each is corrected by what the earlier ones have already moved, so that the result is that of the
whole vector. Robust and adaptive updates, floors of the innovation variance and changed gains act on each scalar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Generic

from kfgen.filters.algebra.linalg import Vector, plus, times
from kfgen.filters.algebra.measurement import Measurement
from kfgen.filters.algebra.numbers import assume_positive, is_positive, is_zero, reciprocal, select
from kfgen.filters.covariance.base import Form, P
from kfgen.filters.covariance.parts import Motion, Scalar
from kfgen.filters.steps.influence import weigh
from kfgen.filters.steps.sensor import Innovation
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.quantiles import chi2_quantile, log_two_pi


@dataclass(frozen=True)
class Updated(Generic[P]):
    """After all components. motion: by what the state has moved. s: innovation variances. failures: conditions under
    which an innovation variance is negative beyond round-off. spoilt: those under which round-off has made it so.
    """

    motion: Motion
    P: P
    nis: Value
    s: list[Value]
    failures: list[Value]
    log_likelihood: Value
    spoilt: list[Value]


def departs(model: Model) -> bool:
    """Whether the update that is made differs from the textbook's, by which the gate and nis judge."""
    options = model.options
    changed = options.gain_limit is not None or bool(options.consider)
    return changed or options.influence is not None or options.inflation is not None


class Sequence(Generic[P]):
    """Updates of a covariance by the components of a sensor.

    plain: the textbook's, without robust, adaptive and changed gains.
    """

    def __init__(
        self, t: Trace, model: Model, form: Form[P], names: list[str], plain: bool, epsilon: Fraction
    ) -> None:
        self.t = t
        self.epsilon = epsilon
        self.model = model
        self.form = form.plain() if plain else form
        self.names = names
        self.plain = plain
        options = model.options
        self.influence = None if plain else options.influence
        self.inflation = None if plain else options.inflation
        self.floor = options.innovation_floor
        self.singly = self.influence is not None or self.inflation is not None or self.floor is not None
        self.threshold: Fraction | None = None
        if self.inflation is not None:
            self.threshold = self.inflation.threshold or chi2_quantile(self.inflation.probability, 1)

    def run(self, P: P, innovation: Innovation) -> Updated[P]:
        """All components in order; P stays as it is."""
        t, form = self.t, self.form
        rows, variances = innovation.rows, innovation.variances
        motion = form.at_rest(t, P)
        nis: Any = 0
        likelihood: Any = 0  # -2 log
        every_s: list[Value] = []
        failures: list[Value] = []
        spoilt: list[Value] = []
        prior = P  # what rounding leaves is relative to what it was
        exact = [not is_positive(r) and _several(h) for h, r in zip(rows, variances, strict=True)]
        singly = self.singly or any(exact)
        group = 1 if singly else form.group
        for first in range(0, len(rows), group):
            part = range(first, min(first + group, len(rows)))
            titles = ", ".join(self.names[c] for c in part)
            t.section("gain and covariance" + (f": {titles}" if len(rows) > 1 else ""))
            below = [0 if is_positive(variances[c]) else form.tolerance(prior, rows[c]) for c in part]
            if singly:
                P, scalar, failed = self._single(P, prior, innovation, first, motion, exact[first], below[0])
                scalars = [scalar]
                failures += failed
            else:
                scalars = [Scalar(Measurement(rows[c], variances[c]), self._innovation(innovation, c)) for c in part]
            P, gains = form.update(t, P, scalars, motion)
            for c, gain, low in zip(part, gains, below, strict=True):
                variance = t.name(gain.s, f"s_{self.names[c]}")
                motion, square = gain.applied(motion)
                sure = is_positive(variances[c]) or self.floor is not None
                if not sure:  # a direction already known, measured exactly: skipped
                    square = t.select(variance > 0, square, 0)
                    if not gain.sound or form.factored:
                        failures.append(variance < -low)
                elif not gain.sound:
                    failures.append(~(variance > 0))
                if gain.spoilt is not None:
                    spoilt.append(gain.spoilt)
                nis = plus(nis, square)
                if self.model.spec.code.log_likelihood:
                    term = square + t.function("log", variance) + t.value(log_two_pi())
                    term = term if sure else t.select(variance > 0, term, 0)
                    if innovation.used is not None:
                        term = t.select(innovation.used[c], term, 0)
                    likelihood = plus(likelihood, term)
                every_s.append(variance)
        if self.plain:
            t.section("state and innovation squared")
            nis = t.name(nis, "nis")
        return Updated(motion, P, nis, every_s, failures, t.value(likelihood) * Fraction(-1, 2), spoilt)

    def _innovation(self, innovation: Innovation, c: int) -> Callable[[Motion], Value]:
        """y_c less what the components before it have moved."""

        def corrected(motion: Motion) -> Value:
            y = innovation.y[c]
            correction = motion.along(innovation.rows[c])
            nu: Value = y if is_zero(correction) else self.t.name(y - correction, f"nu_{self.names[c]}")
            return nu

        return corrected

    def _single(
        self, P: P, prior: P, innovation: Innovation, c: int, motion: Motion, exact: bool, below: Value | int
    ) -> tuple[P, Scalar, list[Value]]:
        """P, the measurement of a component by itself, and conditions of failure. exact: it may say what is known."""
        nu = self._innovation(innovation, c)(motion)
        measurement = Measurement(innovation.rows[c], innovation.variances[c])
        if exact:
            measurement = self._unless_known(P, prior, measurement)
        used = None if innovation.used is None else innovation.used[c]
        P, nu, measurement, failed = self._prepared(P, c, nu, measurement, used, below)
        return P, Scalar(measurement, lambda _: nu), failed

    def _prepared(
        self, P: P, c: int, nu: Value, measurement: Measurement, used: Value | None, below: Value | int
    ) -> tuple[P, Value, Measurement, list[Value]]:
        """Robust, then adaptive, then the floor: P, the innovation, the measurement, conditions of failure."""
        t, floor = self.t, self.floor
        h, r, name = measurement.h, measurement.r, self.names[c]
        g: Any = 1
        if self.influence is not None:
            nu, g = weigh(t, self.model, self.influence, name, nu, r, used)
        if self.threshold is None and floor is None:
            return P, nu, Measurement(h, r, g), []
        spread = t.value(times(g, self.form.variance(P, h)))
        failed: list[Value] = []
        if self.threshold is not None:
            wanted = times(g, nu * nu) * (1 / self.threshold)  # the s that would just pass the test
            some, inverse = reciprocal(spread)
            excess = t.name(wanted - (spread + r), f"excess_{name}")
            inflate = t.name((excess > 0) & some & self._uncertain(P, h, spread), f"inflate_{name}")
            t.flag(inflate, "ANOMALY")
            a = assume_positive(t.name(select(inflate, 1 + excess * inverse, t.one), f"inflation_{name}"))
            P = self.form.inflated(P, a)
            spread = spread * a
        if floor is not None:
            low = spread + r < floor
            if used is not None:
                low = low & used
            if not is_positive(r):
                failed.append(spread + r < -below)
            if not (self.plain and departs(self.model)):  # that one is judged, not made
                t.flag(low, "REGULARIZED")
            r = assume_positive(select(low, floor - spread, r))
        return P, nu, Measurement(h, r, g), failed

    def _uncertain(self, P: P, h: Vector, spread: Value) -> Value:
        """Whether h P h^T is more than what rounding leaves of a direction that is known exactly."""
        if not _several(h):
            return self.t.wrapped(self.t.pool.boolean(True))
        dense = self.form.entries(P)
        terms = [x * x * dense[i, i] for i, x in enumerate(h) if not is_zero(x)]
        uncertain: Value = spread > sum(terms[1:], terms[0]) * (8 * self.form.n * self.epsilon)
        return uncertain

    def _unless_known(self, P: P, prior: P, measurement: Measurement) -> Measurement:
        """The measurement, with h = 0 where it says exactly what is known exactly already: it is then skipped."""
        h, t = measurement.h, self.t
        spread = t.value(self.form.variance(P, h))
        lowest = -t.value(self.form.tolerance(prior, h))
        known = ~self._uncertain(prior, h, spread) & (t.value(measurement.r) <= 0) & ~(spread < lowest)
        return Measurement([x if is_zero(x) else select(known, 0, x) for x in h], measurement.r)


def _several(h: Vector) -> bool:
    """Whether a row measures more than one state."""
    return sum(1 for x in h if not is_zero(x)) > 1
