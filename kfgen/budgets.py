"""What a filter will take of a Cortex-M4F, predicted, and the budgets of its spec: `code: {flash, ram, stack}`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from kfgen.errors import Mistake
from kfgen.filters.base import FilterCode
from kfgen.ir import footprint
from kfgen.scalars import Scalar
from kfgen.spec.types import Spec

TITLES = {"flash": "flash", "ram": "RAM", "stack": "stack"}
_CURES = {
    "flash": "allow more, or choose a smaller form (covariance: full with update: standard is the smallest)",
    "ram": "allow more, or keep less (fewer states or parameters; adapt_R and adapt_Q keep a matrix each)",
    "stack": "allow more, or choose a form that works on fewer numbers at once (update: bierman, standard)",
}


@dataclass(frozen=True)
class Prediction:
    """Bytes. flash: by function, `constants` for the tables, `routines` for those of fixed point; stack: by function,
    what it calls included.

    Both hold what `kfgen cost` measures: init, predict, the updates, and the private functions that they share.
    ram: by field of the struct.
    """

    flash: Mapping[str, int]
    stack: Mapping[str, int]
    ram: Mapping[str, int]
    size: int  # of the struct

    @property
    def totals(self) -> dict[str, int]:
        """flash, ram, stack."""
        return {"flash": sum(self.flash.values()), "ram": self.size, "stack": max(self.stack.values(), default=0)}


def predict(spec: Spec, code: FilterCode, scalar: Scalar, size: int, routines: Iterable[str] = ()) -> Prediction:
    """The prediction for a filter whose struct has `size` bytes. routines: of fixed point, that its file holds."""
    names = {"init", "predict", *(f"update_{sensor.name}" for sensor in spec.measurements)}
    counted = [function for function in code.functions if function.private or function.name in names]
    flash = {function.name: footprint.predicted([function], scalar.name) for function in counted}
    tables = sum(3 * (len(table.x) + 1) for table in code.tables) + sum(len(each.numbers) for each in code.lookups)
    if tables:
        flash["constants"] = tables * scalar.size
    shared = footprint.predicted_routines(routines)
    if shared:
        flash["routines"] = shared
    public = [function for function in counted if not function.private]
    stack = {function.name: footprint.predicted_stack(function, scalar.name) for function in public}
    widths = {"real": scalar.size, "uint32": 4, "bool": 1}
    ram = {block.name: widths.get(block.kind, scalar.size) * (block.size or 1) for block in code.blocks}
    if spec.parameters:
        ram["parameters"] = len(spec.parameters) * scalar.size
    return Prediction(flash, stack, ram, size)


def exceeded(spec: Spec, prediction: Prediction) -> list[Mistake]:
    """One mistake for each budget that the prediction exceeds: by how much, and where it goes."""
    mistakes = []
    for key, size in prediction.totals.items():
        budget = getattr(spec.code, key)
        if budget is None or size <= budget:
            continue
        parts: Mapping[str, int] = getattr(prediction, key)
        largest = sorted(parts.items(), key=lambda part: -part[1])
        if key == "stack":
            told = [f"{name} {part}, {part - budget} too many" for name, part in largest if part > budget]
        else:
            told = [f"{name} {part}" for name, part in largest if part]
        about = "" if key == "ram" else "about "
        message = (
            f"{about}{size} bytes of {TITLES[key]} on a Cortex-M4F, {size - budget} more than the budget of {budget} "
            f"({'; '.join(told)})"
        )
        mistakes.append(Mistake(spec.code.places.get(key, spec.place), message, _CURES[key]))
    return mistakes
