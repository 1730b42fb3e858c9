"""The interacting multiple model: a bank of filters of one state, between which a Markov chain switches.

Blom & Bar-Shalom 1988; Bar-Shalom, Li & Kirubarajan 2001, 11.6.6. predict: every mode starts from a mixture of all,
and mu moves by the transition matrix. update: every mode updates, and mu is weighed by their likelihoods. The steps
are those of the modes' own filters, taken side by side: nothing is stored before all of them are through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.numbers import Number, assume_positive, is_zero, select
from kfgen.filters.bank.covariance import BankCovariance
from kfgen.filters.bank.loops import Source, mixed_in_loops
from kfgen.filters.bank.mixing import Estimate, mixed, normalised, spread, transition
from kfgen.filters.bank.mode import Mode
from kfgen.filters.bank.trace import BankTrace, Scope
from kfgen.filters.base import KF, Block, FilterCode, ModeNote
from kfgen.filters.frame import guards
from kfgen.filters.frame.shared import shared
from kfgen.filters.kinds.single import LONG_FUNCTIONS, SingleFilter
from kfgen.filters.steps import process
from kfgen.filters.steps.gate import gate, store_outcome
from kfgen.filters.steps.phases import Judged, Made, Phases, begin_predict, begin_update, predict_doc, update_name
from kfgen.filters.steps.process import Step
from kfgen.filters.steps.state import NIS, StateCode
from kfgen.ir.program import Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model.bank import BankModel
from kfgen.model.model import SensorModel
from kfgen.scalars import Scalar


class Imm:
    """Emits a bank of filters. bank: the model; filters: those of the modes."""

    def __init__(self, bank: BankModel, filters: Sequence[SingleFilter], scalar: Scalar) -> None:
        self.bank = bank
        self.model = bank.head
        self.scalar = scalar
        # what is to stay above 0 must not become 0 by the rounding of mu
        self.floor = max(bank.mu_floor, scalar.probability) if bank.mu_floor > 0 else bank.mu_floor
        self.lively = bank.lively(scalar.smallest, scalar.probability)
        self.modes = [Mode(name, f, (*f.own_blocks(), NIS)) for name, f in zip(bank.names, filters, strict=True)]
        forms = [f.form for f in filters]
        self.mixers = [form.mixer(forms) for form in forms]
        outdated = tuple(mode.path("kept") for mode in self.modes if mode.filter.outdated)
        fields = [field for mode in self.modes for field in mode.fields()]
        mu = Block("mu", len(self.modes), "probabilities of the modes", initial=bank.mu0)
        states = ("kf.x", *(mode.path("x") for mode in self.modes))
        self.outdated, self.covariance = outdated, BankCovariance(self.model, self.modes, outdated)
        self.state = StateCode(self.model, (mu, *fields), (), outdated, states, bank.sensors, self.covariance.isolate)

    def code(self, taken: frozenset[str]) -> FilterCode:
        """The complete filter. taken: names that locals must not have."""
        privates = shared([(mode.name, mode.filter.private_functions(taken)) for mode in self.modes])
        functions = [self.state.init(taken), *privates, self.predict(taken)]
        for k, sensor in enumerate(self.model.sensors):
            functions.append(self.update(k, taken))
            if sensor.spec.partial:
                functions.append(self.update(k, taken, partial=True))
        functions += [self.state.set_state(taken), *self.covariance.functions(taken)]
        functions += self.covariance.outputs(taken, self.scalar.smallest)
        if self.outdated:
            functions.append(self.redraw(taken))
        remarks = [f"{mode.name}: {text}" for mode in self.modes for text in mode.filter.remarks()]
        straight = list(range(len(self.model.states)))
        tables = {name: table for mode in self.modes for name, table in mode.filter.form.tables.items()}
        notes = []
        for mode in self.modes:
            order = mode.filter.order if mode.filter.form.reorders else straight
            notes.append(ModeNote(mode.name, mode.filter.description(), tuple(order), mode.model))
        return FilterCode(
            model=self.model,
            blocks=tuple(self.state.blocks()),
            functions=tuple(functions),
            order=tuple(straight),
            description=f"Interacting multiple model of {len(self.modes)} modes",
            constants={**self.covariance.constants(), **tables},
            remarks=tuple(remarks),
            modes=tuple(notes),
            notes=LONG_FUNCTIONS if len(self.modes) * len(straight) >= 8 else (),
        )

    def redraw(self, taken: frozenset[str]) -> Function:
        t = Trace()
        for path in self.outdated:
            t.store(path, None, t.wrapped(t.pool.boolean(False)))
        doc = "Have the next update draw its points anew from the modes' x and covariances."
        return Function("redraw", [KF], schedule(t, taken), doc)

    def _mu(self, t: Trace) -> list[Value]:
        mu = [t.name(t.element("kf.mu", i), f"mu_{mode.name}") for i, mode in enumerate(self.modes)]
        if self.lively:
            for value in mu:
                assume_positive(value)
        return mu

    def _loaded(self, t: BankTrace, scopes: list[Scope]) -> list[Estimate]:
        """The estimates in the struct."""
        out = []
        for mode, scope in zip(self.modes, scopes, strict=True):
            with t.of(scope):
                x = [t.name(t.element("kf.x", i), name) for i, name in enumerate(self.model.states)]
                form = mode.filter.form.straight()
                P = form.load(t)
                if not form.factored:  # entries are read when they are first asked for: here
                    _ = [P[i, j] for j in range(form.n) for i in range(j + 1)]
                out.append(Estimate(x, form, P))
        return out

    def combined(self, t: BankTrace, made: list[Made], mu: list[Value]) -> list[Value]:
        """x of all modes together."""
        t.section("combined state")
        weights: list[Number] = list(mu)
        mean = spread(t, self.model, [one.x for one in made], weights, 0).mean
        for value, name in zip(mean, self.model.states, strict=True):
            t.name(value, f"{name}_all")
        guards.finite(t, [*mean, *mu])
        return self.state.confined(t, mean)

    # predict -----------------------------------------------------------------------------------------

    def predict(self, taken: frozenset[str]) -> Function:
        """All modes mixed, then each predicted; mu <- M^T mu."""
        t = BankTrace(self.scalar.smallest)
        arguments, step = begin_predict(t, self.model, self.state.first)
        scopes = [mode.scope() for mode in self.modes]
        mu = self._mu(t)
        t.section("probabilities after a switch, and of the mode before, given the mode now")
        w, c = transition(t, self.transition(t, step), mu)
        for mode, value in zip(self.modes, c, strict=True):
            t.name(value, f"c_{mode.name}")
        for i, before in enumerate(self.modes):
            for j, now in enumerate(self.modes):
                t.name(t.value(w[i][j]), f"w_{before.name}_{now.name}")
        t.settle()
        self._mix_all(t, scopes, w)
        runs: list[tuple[Scope, Phases]] = []
        made: list[Made] = []
        for mode, scope in zip(self.modes, scopes, strict=True):
            run = mode.filter.predicting(t, step)
            runs.append((scope, run))
            one = _advance(t, scope, run)
            assert isinstance(one, Made)
            made.append(one)
        t.settle()
        mu = [t.name(v, f"mu_{mode.name}_next") for mode, v in zip(self.modes, normalised(c), strict=True)]
        x = self.combined(t, made, mu)
        self._store(t, runs, x, mu)
        process.store_time(t, self.model, step)
        guards.settled(t, self.model)
        names = taken | {a.name for a in arguments}
        return Function("predict", arguments, schedule(t, names), predict_doc(self.model))

    def transition(self, t: BankTrace, step: Step) -> list[list[Value]]:
        """M (B, B); rows that do not sum to 1 by what they are, are normalised."""
        given = process.parameters_and_inputs(t, self.model, inputs=False)
        if step.dt is not None:
            given["dt"] = Dual(step.dt)
        evaluator = Evaluator(t, self.model, given)
        rows = [[evaluator.value(e) for e in row] for row in self.bank.transition]
        sums = [sum(row[1:], row[0]) for row in rows]
        exact = [sympy.expand(sum(row)) == 1 for row in self.bank.transition]
        varying = [v for row in rows for v in row if v.constant is None]
        guards.finite(t, varying)
        empty = [total <= 0 for total, ok in zip(sums, exact, strict=True) if not ok]
        guards.positive(t, [*(v < 0 for v in varying), *empty])
        return [
            row if ok else [v / assume_positive(total) for v in row]
            for row, total, ok in zip(rows, sums, exact, strict=True)
        ]

    def _mix_all(self, t: BankTrace, scopes: list[Scope], w: list[list[Number]]) -> None:
        """Have every mode start from its mixture."""
        weights = [[row[j] for row in w] for j in range(len(scopes))]
        mixers = [mixer for mixer in self.mixers if mixer is not None]
        if len(mixers) < len(self.modes):
            parts = self._loaded(t, scopes)
            for j, (mode, scope) in enumerate(zip(self.modes, scopes, strict=True)):
                self._mix(t, mode, scope, parts, weights[j], j)
            return
        sources = [
            Source(t, scope, mode.filter.covariance.place(t)) for mode, scope in zip(self.modes, scopes, strict=True)
        ]
        mixtures: list[dict[str, Array]] = []
        for j, (mixer, scope) in enumerate(zip(mixers, scopes, strict=True)):
            alone = all(i == j or is_zero(weight) for i, weight in enumerate(weights[j]))
            if not alone:
                with t.of(scope):
                    t.section("where it starts from")
            mixtures.append({} if alone else mixed_in_loops(t, self.model, sources, weights[j], j, mixer))
        for scope, arrays in zip(scopes, mixtures, strict=True):
            scope.arrays.update(arrays)

    def _mix(self, t: BankTrace, mode: Mode, scope: Scope, parts: list[Estimate], w: list[Number], own: int) -> None:
        """Have the mode start from its mixture; where none joins it, from its own estimate as it stands."""
        if all(i == own or is_zero(weight) for i, weight in enumerate(w)):
            return
        with t.of(scope):
            t.section("where it starts from")
            mixture = spread(t, self.model, [part.x for part in parts], w, own)
            x = [part.placed(v) for v, part in zip(mixture.mean, self.model.parts, strict=True)]
            P = mixed(t, parts, w, mixture, own)
            with t.capture() as captured:
                mode.filter.form.straight().store(t, P, mode.filter.names, after_predict=False)
            scope.given = {"kf.x": dict(enumerate(x)), **captured}
        if mode.filter.indexed:
            t.materialise(scope, captured)

    # update ------------------------------------------------------------------------------------------

    def update(self, k: int, taken: frozenset[str], partial: bool = False) -> Function:
        """Each mode updated; mu_j <- mu_j exp(l_j), normalised."""
        t = BankTrace(self.scalar.smallest)
        sensors = [self._sensor(mode, k) for mode in self.modes]
        models = [mode.model.of(sensor) for mode, sensor in zip(self.modes, sensors, strict=True)]
        arguments, used = begin_update(t, models, sensors, partial, self.state.first)
        self.state.first.run(t, sensors[0], used)
        scopes = [mode.scope() for mode in self.modes]
        runs: list[tuple[Scope, Phases]] = []
        first: list[Judged | Made] = []
        for mode, scope, sensor in zip(self.modes, scopes, sensors, strict=True):
            runs.append((scope, mode.filter.of(sensor).updating(t, sensor, used)))
            first.append(_advance(t, *runs[-1]))
        t.settle()
        judged = [phase.nis for phase in first if phase.nis is not None]
        gate(t, self.model, sensors, judged, used)
        made: list[Made] = []
        for run, phase in zip(runs, first, strict=True):
            while isinstance(phase, Judged):
                phase = _advance(t, *run)
            made.append(phase)
        t.settle()
        mu, log_likelihood = self.weighed(t, made)
        self._store(t, runs, self.combined(t, made, mu), mu)
        fields = [mode.path("nis") for mode in self.modes]
        store_outcome(t, self.model, sensors, judged, log_likelihood, fields)
        guards.settled(t, self.model, sensors[0])
        name, doc = update_name(sensors[0], partial)
        return Function(name, arguments, schedule(t, taken | {a.name for a in arguments}), doc)

    def _sensor(self, mode: Mode, k: int) -> SensorModel:
        """A mode's sensor; without its gate where another mode takes everything."""
        every = [other.model.sensors[k] for other in self.modes]
        sensor = mode.model.sensors[k]
        if all(s.gate is not None for s in every):
            return sensor
        return replace(sensor, gate=None, spec=replace(sensor.spec, gate=None))

    def weighed(self, t: BankTrace, made: list[Made]) -> tuple[list[Value], Value]:
        """mu after the modes' likelihoods, and the log-likelihood of the bank. The largest is taken out before exp,
        so that one mode at least keeps its weight."""
        mu = self._mu(t)
        t.section("probabilities")
        logs = []
        for mode, one in zip(self.modes, made, strict=True):
            assert one.log_likelihood is not None
            logs.append(t.name(one.log_likelihood, f"l_{mode.name}"))
        best, alive = logs[0], mu[0] > 0
        for value, m in zip(logs[1:], mu[1:], strict=True):
            if self.lively:
                best = t.function("max", best, value)
            else:
                best = select((m > 0) & (~alive | (value > best)), value, best)
                alive = alive | (m > 0)
        best = t.name(best, "l_best")
        guards.finite(t, [best])
        terms = [m * t.function("exp", value - best) for m, value in zip(mu, logs, strict=True)]
        if not self.lively:
            terms = [select(m > 0, term, 0) for m, term in zip(mu, terms, strict=True)]
        total = assume_positive(t.name(sum(terms[1:], terms[0]), "mu_sum"))
        guards.finite(t, [total])
        after = [term / total for term in terms]
        floor = self.floor
        if floor > 0:
            after = normalised([t.function("max", v, t.value(floor)) for v in after])
        after = [t.name(v, f"mu_{mode.name}_next") for mode, v in zip(self.modes, after, strict=True)]
        return after, best + t.function("log", total)

    def _store(self, t: BankTrace, runs: list[tuple[Scope, Phases]], x: list[Value], mu: list[Value]) -> None:
        for scope, run in runs:
            with t.of(scope):
                for _ in run:
                    raise AssertionError("a step goes on after it was made")
        t.section("store: the bank")
        for i, value in enumerate(mu):
            t.store("kf.mu", i, value)
        for i, value in enumerate(x):
            t.store("kf.x", i, value)


def _advance(t: BankTrace, scope: Scope, run: Phases) -> Judged | Made:
    with t.of(scope):
        return next(run)
