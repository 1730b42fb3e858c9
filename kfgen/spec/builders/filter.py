"""The raw data under `filter` -> Filter, with the defaults of each type."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from kfgen.errors import Place
from kfgen.spec.builders.values import Values
from kfgen.spec.raw import Fields, Word, path_text
from kfgen.spec.tree import Expression, Number
from kfgen.spec.types import Adaptive, Filter, Matrix, Robust, SigmaPoints


class FilterBuilder:
    """Builds the filter of the top or of a mode."""

    def __init__(self, values: Values) -> None:
        self.values = values
        self.problems = values.problems

    def filter(self, f: Any, states: tuple[str, ...]) -> Filter:
        """states: the coordinates of the error."""
        if not isinstance(f, Fields):
            f = Fields(Place(self.problems.file))
        kind, covariance = f.get("type", "ekf"), f.get("covariance", "ud")
        reject = f.get("reject")
        if isinstance(reject, Expression) and reject.text == "non_finite":
            reject = "non_finite"
        return Filter(
            type=kind,
            covariance=covariance,
            update=self.update(f, kind, covariance),
            iterations=(self.values.number(f.get("iterations")) or 3) if kind == "iekf" else None,
            gain=f.get("gain"),
            sequential=f.get("sequential", False),
            sigma_points=self.sigma_points(f) if kind == "ukf" else None,
            augment=f.get("augment", False),
            reject=reject,
            robust=self.robust(f),
            adaptive=self.adaptive(f),
            adapt_R=f.get("adapt_R"),
            adapt_Q=f.get("adapt_Q"),
            variance_floor=self.by_state(f.get("variance_floor"), states),
            variance_ceiling=self.by_state(f.get("variance_ceiling"), states),
            innovation_floor=f.get("innovation_floor"),
            gain_limit=f.get("gain_limit"),
            consider=tuple(word.text for word in f.get("consider", ()) if isinstance(word, Word)),
            place=f.place,
            places=dict(f.places),
        )

    def update(self, f: Fields, kind: str, covariance: str) -> str | None:
        if kind == "ukf":
            return None
        default = {"ud": "bierman", "full": "joseph", "sqrt": None}[covariance]
        if "update" not in f:
            return default
        chosen = f.get("update")
        at = self.values.walker.value_place(path_text((*f.path, "update")), f.places["update"])
        if covariance == "sqrt":
            self.problems.add(
                f.places["update"],
                "`update` is not used with `covariance: sqrt`: its update has only one form",
                "remove it",
            )
            return None
        possible = {"ud": ("bierman", "joseph"), "full": ("joseph", "standard")}[covariance]
        if chosen is not None and chosen not in possible:
            why = {
                "bierman": "bierman updates the factors U and D",
                "standard": "the standard form needs the full matrix",
            }
            self.problems.add(
                at,
                f"`update: {chosen}` does not go with `covariance: {covariance}`: {why[chosen]}",
                "write one of " + ", ".join(possible),
            )
            return default
        return chosen or default

    def sigma_points(self, f: Fields) -> SigmaPoints:
        p = f.get("sigma_points")
        if not isinstance(p, Fields):
            p = Fields(f.place)
        kind = p.get("kind", "merwe")
        defaults = {"merwe": (1, 2, 0), "wiki": (1, 2, None), "julier": (None, None, 0)}.get(kind, (None,) * 3)
        values: list[Expression | None] = []
        for key, default in zip(("alpha", "beta", "kappa"), defaults, strict=True):
            filled = None if default is None else Expression(Number(Fraction(default)), str(default), p.place)
            values.append(p.get(key, filled))
        points: Matrix | None = None
        rows = p.get("points")
        if isinstance(rows, tuple) and all(row is not None for row in rows):
            points = rows
        if kind == "custom":
            for key in ("points", "wm", "wc"):
                if key not in p:
                    self.problems.add(
                        p.place,
                        f"sigma points of kind custom need the key `{key}`",
                        "write points, wm and wc",
                    )
        return SigmaPoints(
            kind, values[0], values[1], values[2], p.get("redraw", True), points, p.get("wm"), p.get("wc")
        )

    def robust(self, f: Fields) -> Robust | None:
        r = f.get("robust")
        if r is None or r == "none":
            return None
        if isinstance(r, str):
            return Robust(r, self.huber_default(f) if r == "huber" else None)
        assert isinstance(r, Fields)
        if r.bad:
            return None
        psi = r.get("psi")
        if "influence" in r and "psi" in r:
            self.problems.add(r.places["psi"], "`influence` and `psi` are given both", "remove one of them")
        elif "influence" not in r and "psi" not in r:
            self.problems.add(r.place, "`influence` or `psi` is missing", "write `influence: huber`")
        if "psi_dot" in r and "psi" not in r:
            self.problems.add(r.places["psi_dot"], "`psi_dot` is used beside `psi` only", "remove it")
        if "k" in r and r.get("influence", "huber") != "huber":
            self.problems.add(r.places["k"], f"`k` is not used by `influence: {r.get('influence')}`", "remove it")
        elif "k" in r and "influence" not in r:
            self.problems.add(r.places["k"], "`k` is used by `influence: huber` only", "write it into `psi`")
        if "influence" in r:
            influence = r.get("influence", "huber")
            k = r.get("k", self.huber_default(f)) if influence == "huber" else None
            return Robust(influence, k)
        return Robust("custom", None, psi, r.get("psi_dot"))

    @staticmethod
    def huber_default(f: Fields) -> Expression:
        return Expression(Number(Fraction("1.345")), "1.345", f.at("robust"))

    def adaptive(self, f: Fields) -> Adaptive | None:
        a = f.get("adaptive")
        if isinstance(a, bool) or a is None:
            return Adaptive() if a else None
        if a.bad:
            return None
        if "probability" in a and "chi2" in a:
            self.problems.add(a.places["chi2"], "`probability` and `chi2` are given both", "remove one of them")
        return Adaptive(a.get("probability"), a.get("chi2"))

    @staticmethod
    def by_state(written: Any, states: tuple[str, ...]) -> Mapping[str, Expression]:
        """A single number is spread over the states."""
        if isinstance(written, Expression):
            return dict.fromkeys(states, written)
        if isinstance(written, Fields):
            return {name: value for name, value in written.values.items() if value is not None}
        return {}
