"""Single values of the raw data: formulas, whole numbers, kinds, and the one variance that a quantity may have."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from kfgen.errors import Place
from kfgen.spec.constants import NotConstant, value
from kfgen.spec.operations import NoValue, Value
from kfgen.spec.problems import short
from kfgen.spec.raw import BAD, Fields, entries, path_text
from kfgen.spec.shaping.vectors import RawRotation
from kfgen.spec.tree import Call, Expression, Name, Number
from kfgen.spec.walk import Walker


class Values:
    """Reads values for all builders of one spec; mistakes go to the walker's problems."""

    def __init__(self, walker: Walker) -> None:
        self.walker = walker
        self.problems = walker.problems
        self.environment: dict[str, Value] = {}  # of the constants

    def bad(self, place: Place) -> Expression:
        return Expression(BAD, "", place)

    def number(self, expression: Any) -> int | None:
        """The value of a whole-number key (whether it is whole and in range is a rule)."""
        if expression is None or isinstance(expression, int):
            return expression
        try:
            found = value(expression.tree, self.environment)
        except (NotConstant, NoValue):
            return None
        return int(found)

    def formula(self, fields: Fields, key: str) -> Expression:
        found = fields.get(key)
        return found if isinstance(found, Expression) else self.bad(fields.at(key))

    def kind(self, f: Fields) -> tuple[str, Expression | None]:
        written = f.get("kind", "real")
        if isinstance(written, Fields):
            return "periodic", self.formula(written, "periodic")
        if written == "quaternion":
            self._unit_of_rotation(f)
            return "quaternion", None
        if written != "angle":
            return "real", None
        unit = f.get("unit")
        if unit is not None and unit != "rad":
            at = self.walker.value_place(path_text((*f.path, "unit")), f.place)
            self.problems.add(
                at,
                f"a value of kind angle has the unit rad, not {unit!r}",
                "convert it, or write `kind: {periodic: 360}`",
            )
        return "angle", Expression(Call("mul", (Number(Fraction(2)), Name("pi"))), "2*pi", f.at("kind"))

    def _unit_of_rotation(self, f: Fields) -> None:
        unit = f.get("unit")
        if unit not in (None, "", "1", "-", "rad"):
            at = self.walker.value_place(path_text((*f.path, "unit")), f.place)
            text = f"the rotation error of a quaternion is in rad, not in {unit!r}"
            self.problems.add(at, text, "convert std or var, and leave `unit` out")

    def variance(self, f: Fields, covered: bool, needed: bool = True, more: tuple[str, ...] = ()) -> Expression | None:
        """std squared, or var (or one of `more`): exactly one of them, or none where a matrix covers it."""
        given = [key for key in ("std", "var", *more) if key in f]
        if covered:
            return None
        choices = ", ".join(f"`{key}`" for key in ("std", "var", *more))
        if len(given) > 1:
            listed = " and ".join(f"`{key}`" for key in given)
            self.problems.add(f.places[given[1]], f"{listed} are given both", f"write exactly one of {choices}")
        if not given:
            if needed and not f.bad:
                if not self.mistaken(f):
                    self.problems.add(f.place, f"one of {choices} is missing", "write `std: 0` where it is exact")
                return self.bad(f.place)
            return self.bad(f.place) if f.bad else None
        expression: Expression = self.formula(f, given[0])
        if given[0] not in ("std", "root_density") or expression.tree == BAD:
            return expression
        return Expression(Call("pow", (expression.tree, Number(Fraction(2)))), expression.text, expression.place)

    def both(self, holder: Fields, matrix_key: str, written: Any, rotations: Iterable[RawRotation] = ()) -> None:
        """A full covariance beside single variances: one mistake, whoever has them."""
        if matrix_key not in holder:
            return
        more = ("density", "root_density")
        listed = [*entries(written), *((r.name, r.fields) for r in rotations)]
        given = [(n, key) for n, f in listed for key in ("std", "var", *more) if key in f]
        if given:
            words = ", ".join(f"`{key}` of {short(name)}" for name, key in given[:6])
            text = f"`{matrix_key}` is given, and {words} too"
            self.problems.add(holder.at(matrix_key), text, "give the variances in one of the two")

    def mistaken(self, f: Fields) -> bool:
        """Whether an unknown key has been reported here, which was probably meant for the missing one."""
        prefix = path_text(f.path) + "."
        return any(
            m.place.path.startswith(prefix) and m.message.startswith("unknown key") for m in self.problems.mistakes
        )
