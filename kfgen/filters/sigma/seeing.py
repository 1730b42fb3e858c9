"""What the sigma points of a filter tell of a sensor: private functions that run h on every point."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.factors import solved, udu
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import image_of
from kfgen.filters.covariance.base import Solving
from kfgen.filters.covariance.noise import Given
from kfgen.filters.frame import guards
from kfgen.filters.kinds.work import Update
from kfgen.filters.sigma import cloud
from kfgen.filters.sigma.carried import images_of_sensor
from kfgen.filters.sigma.cloud import Private
from kfgen.filters.sigma.drawing import Drawing, noise_root
from kfgen.filters.sigma.points import PointSet
from kfgen.filters.sigma.turned import Seen, mean_of, point, seen_spread
from kfgen.filters.steps.sensor import Linearised, SensorCode, total
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value
from kfgen.model import Model
from kfgen.model.model import SensorModel


class Seeing:
    """What the sigma points of a filter tell of one sensor.

    linear: h needs no points. The private function `see_<sensor>` fills an array with z, the upper triangle of
    the spread, the cross covariances. kept: the same for points that predict has kept, which may be other ones,
    and whose centre need not be x.
    """

    def __init__(self, model: Model, sensor: SensorModel, points: PointSet, carried: tuple[str, ...],
                 drawing: Drawing, kept: PointSet | None = None, recalls: bool = False) -> None:  # fmt: skip
        self.recalls = recalls  # whether these are the points of predict
        self.kept = None if kept is None else Seeing(model, sensor, kept, (), drawing, recalls=True)
        self.model = model
        self.sensor = sensor
        self.points = points
        self.carried = carried
        self.drawing = drawing
        self.tolerance = drawing.tolerance
        self.n, self.m, self.q = len(model.errors), sensor.dimension, len(carried)
        self.stride = self.n + self.q
        self.images = images_of_sensor(model, sensor)
        self.symmetric = not recalls and points.balanced
        self.linear = self._is_linear()
        self.h: Private | None = None
        self.see: Private | None = None

    def _is_linear(self) -> bool:
        model, sensor = self.model, self.sensor
        if self.kept is not None or self.recalls or self.carried or not self.points.exact:
            return False
        if any(b is not None for b in model.bounds) or sensor.rotations:  # rotations beyond pi come round
            return False
        if any(not part.flat for _, _, part in self.images.singles) or any(r is not None for r in sensor.residual):
            return False
        t = Trace()
        code = SensorCode(t, model, sensor, list(range(self.n)))
        linear = code.linearise(code.prior())
        return not cloud.bends([p.value for p in linear.predicted], [v for row in linear.H for v in row])

    @property
    def size(self) -> int:
        """Of the array that `see` fills."""
        return len(self.sensor.h) + self.m * (self.m + 1) // 2 + (self.n + self.q) * self.m

    def functions(self, taken: frozenset[str]) -> list[Function]:
        """The private functions of the sensor."""
        if self.linear:
            return []
        self.h = cloud.measurement(self.model, self.sensor, self.carried, taken)
        self.see = self._see(taken)
        out = [self.h.function, self.see.function]
        if self.kept is not None:
            self.kept.h = self.h
            self.kept.see = self.kept._see(taken)
            out.append(self.kept.see.function)
        return out

    @property
    def offset(self) -> int:
        """How many numbers the centre of kept points takes."""
        return self.n if self.points.centre else 0

    def _see(self, taken: frozenset[str]) -> Private:
        model, sensor, points, n, m = self.model, self.sensor, self.points, self.n, self.m
        assert self.h is not None
        t = Trace()
        x = [t.name(t.element("x", i), name) for i, name in enumerate(model.states)]
        numbers = len(model.states)
        at_point, z = t.array("point", numbers + self.q), t.array(image_of(sensor), len(sensor.h))
        store = None if points.theta == 0 else t.array("dz", len(points.rows) * m)
        call = self.h.arguments(None)
        middle = [t.zero] * n
        if self.recalls and points.centre:
            middle = [t.name(t.element("middle", i), f"{name}_middle") for i, name in enumerate(model.errors)]
        for i, value in enumerate(point(model, x, middle)):
            at_point[i] = value
        for i in range(self.q):
            at_point[numbers + i] = t.zero
        t.call(self.h.function, [*call, ("point", 0), (z.name, 0)])
        names = list(sensor.errors)
        base = [t.name(z[a], f"{c.name}_centre") for a, c in enumerate(sensor.spec.components)]
        shift = [t.variable(f"shift_{name}", 0) for name in names]
        spread = {(a, b): t.variable(f"s_{names[a]}_{names[b]}", 0) for b in range(m) for a in range(b + 1)}
        labels = [*model.errors, *self.carried]
        cross = {(i, a): t.variable(f"c_{labels[i]}_{names[a]}", 0) for i in range(self.stride) for a in range(m)}
        about = not self.symmetric and points.theta != 0
        first = [t.variable(f"m_{label}", 0) for label in labels] if about else []
        around = self.recalls and points.centre and not about  # the centre's image: the mean's shift is in `middle`
        t.section("points through h")
        with t.loop("k", 0, len(points.rows)) as k:
            at = k * self.stride
            own = [t.element("cloud", at + i) for i in range(self.stride)]
            for i, value in enumerate([*point(model, x, own[:n]), *own[n:]]):
                at_point[i] = value
            t.call(self.h.function, [*call, ("point", 0), (z.name, 0)])
            apart = [t.zero] * m
            for i, j, single in self.images.singles:
                apart[j] = cloud.difference(t, model, sensor, single, i, z[i], base[i], x)
            for i, j, rotation in self.images.rotations:
                apart[j : j + 3] = rotation.local([z[i + k] for k in range(4)], base[i : i + 4])
            d = [t.name(v, f"dz_{name}") for v, name in zip(apart, names, strict=True)]
            part = own
            if around:
                part = [own - shifted for own, shifted in zip(part, middle, strict=True)]
            wm, wc = cloud.weights(t, points.wm, k, "wm"), cloud.weights(t, points.wc, k, "wc")
            weighted = d if points.uniform else [v * wc for v in d]
            for a in range(m):
                shift[a].set(shift[a].get() + (d[a] if points.uniform else wm * d[a]))
                if store is not None:
                    store[k * m + a] = d[a]
            if store is None:
                for (a, b), variable in spread.items():
                    variable.set(variable.get() + d[a] * weighted[b])
            for (i, a), variable in cross.items():
                variable.set(variable.get() + part[i] * weighted[a])
            for i, variable in enumerate(first):
                variable.set(variable.get() + (part[i] if points.uniform else wc * part[i]))
        scale_m = points.wm[0] if points.uniform else Fraction(1)
        scale_c = points.wc[0] if points.uniform else Fraction(1)
        delta = [t.name(v.get() * scale_m, f"mean_{name}") for v, name in zip(shift, names, strict=True)]
        if store is not None:
            with t.loop("k", 0, len(points.rows)) as k:
                wc = cloud.weights(t, points.wc, k, "wc")
                d = [store[k * m + a] - delta[a] for a in range(m)]
                for (a, b), variable in spread.items():
                    term = d[a] * d[b] if points.uniform else wc * d[a] * d[b]
                    variable.set(variable.get() + term)
        mean, seen_from = mean_of(t, self.images, base, delta)
        for a, value in enumerate(mean):
            t.store("seen", a, value)
        first_entry = len(sensor.h)
        whole_spread = {(a, b): variable.get() * scale_c + delta[a] * delta[b] * points.extra
                        for (a, b), variable in spread.items()}  # fmt: skip
        moved_cross: dict[tuple[int, int], Value] = {}
        for (a, b), value in seen_spread(t, whole_spread, seen_from).items():
            t.store("seen", first_entry + b * (b + 1) // 2 + a, value)
        offset = first_entry + m * (m + 1) // 2
        for (i, a), variable in cross.items():
            value = variable.get() * scale_c
            if first:  # the weighted sum of deviations of x need not be 0
                whole = first[i].get() * scale_c + (middle[i] if i < n else t.zero) * points.wc0
                value = value - whole * delta[a]
            elif around:
                value = value - middle[i] * delta[a] * points.extra
            moved_cross[i, a] = value
        for i in range(self.stride):
            row = [moved_cross[i, a] for a in range(m)]
            if seen_from is not None:
                row = [t.value(linalg.dot(seen_from[a], row)) for a in range(m)]
            for a, value in enumerate(row):
                t.store("seen", offset + i * m + a, value)
        sizes = [("x", numbers, True), *([("middle", n, True)] if self.recalls and points.centre else []),
                 ("cloud", len(points.rows) * self.stride, True), ("seen", self.size, False)]  # fmt: skip
        arrays = [Argument(name, "{name}_real_t", pointer=True, constant=c, size=s) for name, s, c in sizes]
        body = schedule(t, taken | {"kf", "u", "x", "z", z.name, "middle", "cloud", "seen"})
        doc = f"what the points predict of {sensor.name}: mean, covariance, covariances with the state"
        return cloud.private(f"{'recall' if self.recalls else 'see'}_{sensor.name}", body, arrays, doc, sensor)

    # in the update -----------------------------------------------------------------------------------

    def analytic(self, u: Update) -> Seen:
        """Of a linear h: P H^T and H P H^T."""
        linear = u.code.linearise(u.x)
        dense = u.form.entries(u.P)
        columns = [dense.times(h) for h in linear.H]
        spread = Symmetric(self.m, lambda a, b: linalg.dot(linear.H[a], columns[b]))
        straight: Rows = [[0] * self.m for _ in range(self.n)]
        for a, column in enumerate(columns):
            for place, value in zip(u.form.order, column, strict=True):
                straight[place][a] = value
        return Seen(u.code.predicted(u.x), spread, straight, [])

    def draw(
        self, u: Update, P: Any, name: str = "", stored: bool = True
    ) -> tuple[Array, list[Value]]:
        """An array of points of P; conditions of failure. stored: P is that of the struct."""
        array = u.t.array(f"cloud{name}", len(self.points.rows) * self.stride)
        return array, self.drawing.scatter(u.t, P, self._noise_root(u), self.points, array, stored)

    def redraw(self, u: Update, array: Array) -> list[Value]:
        """Points of the stored P, in a branch of its own; conditions of failure."""
        return self.drawing.scatter(u.t, u.form.load(u.t), self._noise_root(u), self.points, array)

    def look(self, u: Update) -> tuple[Array, Array, list[Value]]:
        """Through points of x and P, or through those that the last prediction kept: what is seen, the array of
        points, conditions of failure."""
        t = u.t
        _ = u.P  # read before the branches
        seen = t.array("seen", self.size)
        if self.kept is None:
            array, failures = self.draw(u, u.P)
            self.run(u, seen, array)
            return seen, array, failures
        array = t.array("cloud", len(self.points.rows) * self.stride)
        fresh = ~t.field("kf.kept", "bool")
        with t.when(fresh):
            guards.positive(t, self.redraw(u, array))
            self.run(u, seen, array)
        with t.when(~fresh):
            assert self.kept.see is not None
            kept = [("kf.points", 0), ("kf.points", self.kept.offset)] if self.kept.offset else [("kf.points", 0)]
            t.call(self.kept.see.function, [*self.kept.see.arguments(None), ("kf.x", 0), *kept, (seen.name, 0)])
        return seen, array, []

    def _noise_root(self, u: Update) -> Rows:
        C = self.noise_covariance(u)
        root, tested = noise_root(C, self.model.spec.filter.covariance, self.tolerance)
        u.tested += tested
        return root

    def noise_covariance(self, u: Update) -> Rows:
        """Of the carried noises."""
        names = [w.name for w in self.sensor.noises]
        index = [names.index(w) for w in self.carried]
        whole = u.code.noise_covariance() if index else []
        return [[whole[i][j] for j in index] for i in index]

    def run(self, u: Update, seen: Array, array: Array, x: tuple[str, int] = ("kf.x", 0)) -> None:
        """Have `see` fill the array `seen`."""
        assert self.see is not None
        u.t.call(self.see.function, [*self.see.arguments(None), x, (array.name, 0), (seen.name, 0)])

    def read(self, t: Trace, seen: Array) -> Seen:
        """The numbers of the array."""
        m, components = self.m, self.sensor.spec.components
        z = [t.name(seen[a], f"h_{c.name}") for a, c in enumerate(components)]
        made: dict[tuple[int, int], Value] = {}
        for b in range(m):
            for a in range(b + 1):
                made[a, b] = seen[len(components) + b * (b + 1) // 2 + a]
        offset = len(components) + m * (m + 1) // 2
        cross = [[seen[offset + i * m + a] for a in range(m)] for i in range(self.stride)]
        return Seen(z, Symmetric(m, lambda a, b: made[a, b]), cross[: self.n], cross[self.n :])

    def residual(self, u: Update, x: list[Value], P: Any) -> Vector:
        """z less what points of the new x and P predict."""
        t = u.t
        array, failures = self.draw(u, P, "_after", stored=False)
        guards.positive(t, failures)
        local, seen = t.array("after", len(x)), t.array("seen_after", self.size)
        for i, value in enumerate(x):
            local[i] = value
        self.run(u, seen, array, (local.name, 0))
        return u.code.residuals(x, self.read(t, seen).z, named=False)

    def regression(self, u: Update, form: Solving[Any]) -> tuple[Linearised, Symmetric]:
        """H = Pxz^T P^-1, with R as it is; and the spread of the points. form: of P, as u has it."""
        seen = self.read(u.t, self.look(u)[0])
        columns = [[seen.cross[i][a] for i in range(self.n)] for a in range(self.m)]
        return self._regressed(u, seen, form.solved(u.t, u.P, columns, self.tolerance)), seen.spread

    def _regressed(self, u: Update, seen: Seen, H: Rows) -> Linearised:
        """With R, and what the carried noises add to it."""
        t = u.t
        linear = replace(u.code.linearise(u.x), y=u.code.residuals(u.x, seen.z), H=H)
        if self.carried:
            if u.used is None and u.adapted is None and any(r.constant is None for row in total(linear) for r in row):
                Given(total(linear)).factors()  # tested before the rest comes in
            V, C = udu(self.noise_covariance(u))
            none: Vector = [t.zero] * self.q
            rows = [solved(V, C, [seen.noise[i][a] for i in range(self.q)], none) for a in range(self.m)]
            share = [[t.value(linalg.dot(rows[a], [seen.noise[i][b] for i in range(self.q)])) for b in range(self.m)]
                     for a in range(self.m)]  # fmt: skip
            added = [[p + q for p, q in zip(r, s, strict=True)] for r, s in zip(linear.added, share, strict=True)]
            linear = replace(linear, added=added, computed=True)
        return linear
