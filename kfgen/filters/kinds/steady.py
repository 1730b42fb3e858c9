"""The Kalman filter with its steady-state gain compiled in: no covariance is kept, an update is K times z - h."""

from __future__ import annotations

from fractions import Fraction

from kfgen.errors import SpecError
from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import Number
from kfgen.filters.algebra.riccati import Gain, Rules, Scalar, steady
from kfgen.filters.base import CONST_KF, INPUTS, KF, FilterCode, sensor_argument
from kfgen.filters.frame import guards
from kfgen.filters.steps import process
from kfgen.filters.steps.gate import gate, store_outcome, tested
from kfgen.filters.steps.needed import read
from kfgen.filters.steps.outputs import outputs_function
from kfgen.filters.steps.sensor import SensorCode, needs_inputs, total
from kfgen.filters.steps.state import StateCode
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel
from kfgen.quantiles import log_two_pi
from kfgen.scalars import Scalar as Arithmetic

Numbers = list[list[Fraction]]


class Steady:
    """Emits a kf with `gain: steady`."""

    def __init__(self, model: Model, scalar: Arithmetic) -> None:
        self.model = model
        self.scalar = scalar
        self.n = len(model.states)
        self.state = StateCode(model, ())
        options = model.options
        rules = Rules(options.innovation_floor, options.gain_limit, options.consider)
        gains = steady(*_constants(model), rules)
        if gains is None:
            chosen = model.spec.filter
            raise SpecError.at(
                chosen.places.get("gain", chosen.place),
                "no steady state: some state is not observed, or is never excited and keeps its first uncertainty",
                "measure it or give it process noise, or remove `gain`",
            )
        self.gains: list[Gain] = gains

    def code(self, taken: frozenset[str]) -> FilterCode:
        """The complete filter. taken: names that locals must not have."""
        functions = [self.state.init(taken), self.predict(taken)]
        functions += [self.update(s, g, taken) for s, g in zip(self.model.sensors, self.gains, strict=True)]
        functions += [self.state.set_state(taken), self.get_covariance(taken)]
        if self.model.outputs:
            t = Trace(self.scalar.smallest)
            functions.append(outputs_function(t, self.model, self.variances, taken))
        return FilterCode(
            model=self.model,
            blocks=tuple(self.state.blocks()),
            functions=tuple(functions),
            order=tuple(range(self.n)),
            description="Kalman filter, steady-state gain",
        )

    def predict(self, taken: frozenset[str]) -> Function:
        """x <- f(x, u, 0)."""
        model, t = self.model, Trace(self.scalar.smallest)
        arguments: list[Argument] = [KF]
        self.state.first.wait(t)
        if model.inputs:
            arguments.append(INPUTS)
        guards.arguments(t)
        step = process.step_length(t, model)
        prior = process.given(t, model, step)
        t.section("model")
        result = process.advance(t, model, prior, step)
        free = [t.name(v, f"{name}_next") for v, name in zip(result.x, model.states, strict=True)]
        x = self.state.confined(t, free)
        moved = [i for i, (value, before) in enumerate(zip(x, prior.x, strict=True)) if value.node is not before.node]
        t.section("guards")
        guards.finite(t, [free[i] for i in moved])
        t.section("store")
        for i in moved:
            t.store("kf.x", i, x[i])
        process.store_time(t, model, step)
        guards.settled(t, model)
        return Function("predict", arguments, schedule(t, taken | {"u"}), "Advance the estimate by one step.")

    def update(self, sensor: SensorModel, gain: Gain, taken: frozenset[str]) -> Function:
        """x <- x + K (z - h), nis by the constant S."""
        model, t = self.model, Trace(self.scalar.smallest)
        arguments: list[Argument] = [KF, sensor_argument(sensor.name)]
        first = self.state.first
        first.wait(t, sensor)
        if needs_inputs(model, sensor) or first.takes_inputs(sensor):
            arguments.append(INPUTS)
        guards.arguments(t, first.needed(t, sensor, None, {}, read([model], [sensor])))
        tested(t, model, [sensor])
        first.run(t, sensor, None)
        t.section("innovation")
        code = SensorCode(t, model, sensor, list(range(self.n)))
        prior = code.prior()
        y = code.linearise(prior).y
        nis = self._likelihood(t, gain.plain, y)[0]
        t.name(nis, "nis")
        t.section("state")
        free = []
        for i, name in enumerate(model.states):
            moved: Value = t.zero
            for k, v in zip(gain.K[i], y, strict=True):
                moved = moved + v * k
            free.append(t.name(prior[i] + moved, f"{name}_next"))
        x = self.state.confined(t, free)
        t.section("guards")
        if sensor.gate is not None:  # a far outlier may overflow nis and is gated all the same
            guards.finite(t, y)
            gate(t, model, [sensor], [nis], None)
        guards.finite(t, [nis, *free])
        if gain.floored:
            t.flag(t.wrapped(t.pool.boolean(True)), "REGULARIZED")
        t.section("store")
        for i, value in enumerate(x):
            if value.node is not prior[i].node:
                t.store("kf.x", i, value)
        squares, logs = self._likelihood(t, gain.made, y)
        store_outcome(t, model, [sensor], [nis], (squares + logs) * Fraction(-1, 2))
        guards.settled(t, model)
        doc = f"Take a measurement of {sensor.name} into account."
        return Function(f"update_{sensor.name}", arguments, schedule(t, taken | {"z", "u"}), doc)

    def _likelihood(self, t: Trace, scalars: list[Scalar], y: Vector) -> tuple[Value, Value]:
        """The sum of nu^2 / s, and that of ln(2 pi s)."""
        squares, logs = t.zero, t.zero
        for scalar in scalars:
            nu = linalg.dot(scalar.row, y)
            squares = squares + nu * nu * (1 / scalar.s)
            logs = logs + t.function("log", scalar.s) + t.value(log_two_pi())
        return squares, logs

    def variances(self, J: Rows) -> list[Number]:
        """The diagonal of J P J^T (k,) with the constant P."""
        P = self.gains[-1].P
        return [linalg.dot(row, [linalg.dot(p, row) for p in P]) for row in J]

    def get_covariance(self, taken: frozenset[str]) -> Function:
        """P in the steady state, after the update of the last sensor."""
        t, n, P = Trace(), self.n, self.gains[-1].P
        for i in range(n):
            for j in range(n):
                t.store("P", i * n + j, t.value(P[i][j]))
        argument = Argument("P", "{name}_real_t", pointer=True, constant=False, size=n * n, doc="covariance, row-major")
        return Function(
            "get_covariance", [CONST_KF, argument], schedule(t, taken | {"x", "P"}),
            "The covariance of the state after a step's last update; it is constant.", returns="void",
        )  # fmt: skip


def _constants(model: Model) -> tuple[Numbers, Numbers, list[tuple[Numbers, Numbers]]]:
    """F, Q with what the noise inputs add, and H, R of each sensor."""
    t = Trace()
    step = process.step_length(t, model)
    result = process.advance(t, model, process.given(t, model, step), step)
    n = len(model.states)
    Q = [list(row) for row in result.Q]
    for w, d in result.noise:
        for i in range(n):
            for j in range(n):
                Q[i][j] = Q[i][j] + w[i] * d * w[j]
    sensors = []
    for sensor in model.sensors:
        code = SensorCode(Trace(), model, sensor, list(range(n)))
        linear = code.linearise(code.prior())
        sensors.append((_known(model, linear.H), _known(model, total(linear))))
    return _known(model, result.F), _known(model, Q), sensors


def _known(model: Model, rows: list[list[Value]]) -> Numbers:
    """Entries as the constants that they have to be."""
    values = [[t.constant for t in row] for row in rows]
    if any(v is None for row in values for v in row):
        chosen = model.spec.filter
        raise SpecError.at(
            chosen.places.get("gain", chosen.place), "`gain: steady` wants constant F, H, Q and R", "remove `gain`"
        )
    return [[v for v in row if v is not None] for row in values]
