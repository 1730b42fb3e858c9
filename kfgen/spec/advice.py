"""What is allowed but probably not meant: warnings, which stop nothing."""

from __future__ import annotations

from fractions import Fraction

from kfgen.errors import Mistake
from kfgen.scalar_names import DOUBLE
from kfgen.spec.constants import NotConstant, environment_of, value
from kfgen.spec.operations import NoValue, less
from kfgen.spec.types import Spec


def warnings(spec: Spec) -> list[Mistake]:
    """The warnings of a valid spec, in the order of its lines."""
    found: list[Mistake] = []
    known = environment_of(spec)
    for chosen in [m.filter for m in spec.imm.modes] if spec.imm else [spec.filter]:
        points = chosen.sigma_points
        if points is None or points.alpha is None or spec.scalar == DOUBLE:
            continue
        try:
            alpha = value(points.alpha.tree, known)
        except (NotConstant, NoValue):
            continue
        if less(alpha, Fraction(1, 20)):
            text = f"alpha below 0.05 makes weights that {spec.scalar} cannot carry"
            found.append(Mistake(points.alpha.place, text, "choose alpha between 0.05 and 1, or `scalar: double`"))
    return sorted(set(found))  # modes may share a filter
