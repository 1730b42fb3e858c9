"""The iterated extended Kalman filter: Gauss-Newton steps of the update (Bell & Cathey 1993)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kfgen.filters.algebra.linalg import dot, plus
from kfgen.filters.algebra.numbers import is_zero
from kfgen.filters.kinds.ekf import Ekf, Final
from kfgen.filters.kinds.work import Update
from kfgen.filters.steps.resetting import moving
from kfgen.filters.steps.sensor import Innovation
from kfgen.filters.steps.sequence import Updated
from kfgen.geometry import Turn


class Iekf(Ekf):
    """x_i+1 = x^- + K_i (y_i - H_i (x^- - x_i)) from x_0 = x^- on; P from the last H, R and K."""

    title = "Iterated extended Kalman filter"

    def description(self) -> str:
        return f"{super().description()}, {self.model.spec.filter.iterations} linearisations"

    def final(self, u: Update, innovation: Innovation, plain: Updated[Any]) -> Final:
        iterations = self.model.spec.filter.iterations or 1
        if iterations == 1:
            return (yield from super().final(u, innovation, plain))
        yield from self.judged(u, innovation, plain)
        result = self.made(u, innovation, plain)
        for k in range(2, iterations + 1):
            u.t.section(f"linearisation {k} of {iterations}")
            result = self._turned_step(u, result) if self.model.rotations else self._step(u, result)
        return result

    def reset(self, u: Update, P: Any) -> Any:
        """P is about the last linearisation already."""
        return P

    def _turned_step(self, u: Update, before: Updated[Any]) -> Updated[Any]:
        """The update about x_i with P_i = J^-1 P^- J^-T, J^-1 = T(e_i), e_i = x_i [-] x^- (He, Xu & Zhang 2021):
        d_i = K_i (y_i + H_i e_i) - e_i, since J^-1 e_i = e_i."""
        t, model = u.t, self.model
        x = self.retracted(u, before.motion)
        apart = self.by_error(t, before.motion)
        P = u.P
        turns = []
        for r in model.rotations:
            own = slice(r.first, r.first + 4)
            x[own] = [t.name(a, f"{name}_iterate") for a, name in zip(x[own], r.parts, strict=True)]
            e = [t.name(t.value(a), f"e_{name}")
                 for a, name in zip(r.geometry.local(x[own], u.x[own]), r.errors, strict=True)]  # fmt: skip
            apart[r.first_error : r.first_error + 3] = e
            turns.append(Turn(e))
        for i, j, part in model.space.singles:
            if not part.flat:
                x[i] = part.placed(x[i])
                apart[j] = part.local(x[i], u.x[i])
        u.base, u.apart = x, apart
        T = moving(t, model, self.order, list(zip(model.rotations, turns, strict=True)))
        P = self.form.turned(t, P, T, self.nothing(t), [])
        linear = self.compensation.corrected(t, u.code.linearise(x), self.order, u.rests)
        y = [t.value(plus(v, dot(h, [apart[i] for i in self.order]))) for v, h in zip(linear.y, linear.H, strict=True)]
        return self.sequence(u, self.innovation(u, replace(linear, y=y)), plain=False, P=P)

    def _step(self, u: Update, before: Updated[Any]) -> Updated[Any]:
        """The linear update about x^- + before.moved."""
        t, model = u.t, self.model
        x = list(u.x)
        moved = before.motion.entries()  # x_i - x^-
        for place, (i, m) in enumerate(zip(self.order, list(moved), strict=True)):
            if is_zero(m):
                continue
            part = model.space.singles[i][2]
            x[i] = part.retract(u.x[i], m)
            if not part.flat:
                moved[place] = part.local(x[i], u.x[i])
            t.name(x[i], f"{model.states[i]}_iterate")
        steps = {i: t.value(moved[self.order.index(i)]) for i in self.compensation.states}
        compensated, rests = self.compensation.moved(t, u.x, steps)
        x = [compensated[i] if i in rests else value for i, value in enumerate(x)]
        linear = self.compensation.corrected(t, u.code.linearise(x), self.order, rests)
        y = [t.value(plus(v, dot(h, moved))) for v, h in zip(linear.y, linear.H, strict=True)]
        innovation = self.innovation(u, replace(linear, y=y))
        return self.sequence(u, innovation, plain=False)


FILTERS = {"iekf": Iekf}
