"""Which functions of a filter are emitted as loops: `unroll`, within `flash`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

from kfgen.filters.base import FilterCode
from kfgen.ir.footprint import predicted
from kfgen.ir.program import Call, For, Function, walk

MARGIN = 1.25  # what a prediction may be wrong by: within it a choice still fits
LOOPS, STRAIGHT = "loops", "unrolled"

# Measured with gcc 12 on a Cortex-M4F: small functions that stay functions are smaller and no slower.
LOOPING = (
    "Recommended with gcc, for these loops in small functions:",
    "  -O2 -fno-inline -fno-tree-pre -fno-reorder-blocks",
)


def choose(
    straight: FilterCode, looped: FilterCode, budget: int | None, loops: Collection[str], unrolled: Collection[str],
    rates: Mapping[str, float], scalar: str,
) -> FilterCode:  # fmt: skip
    """The functions of two forms of a filter, loops where straight-line code would exceed the budget in bytes.

    What is called least becomes loops first, of equals what saves most; nothing does that saves nothing, and what in
    the end need not be loops is not. loops, unrolled: functions that are these in any case. rates: calls a prediction,
    where they are not 1. Where nothing is sure to fit, all become loops if loops are what is smaller, so that `auto`
    then takes what `none` takes. Whether it is predicted to exceed the budget is told by whoever judges budgets.
    """
    names = [f.name for f in straight.functions if _counted(f) and _unmasked(f.name) not in unrolled]
    everything = set(names)
    rolled = forced = {name for name in names if _unmasked(name) in loops}
    if budget is None:
        return mixed(straight, looped, rolled)

    def flash(chosen: set[str]) -> int:
        functions = with_privates(mixed(straight, looped, chosen)).functions
        return predicted([f for f in functions if f.private or f.name == "init" or _counted(f)], scalar)

    def rate(name: str) -> float:
        return rates.get(_unmasked(name), 1.0)

    def fits(chosen: set[str]) -> bool:
        return flash(chosen) * MARGIN <= budget

    while not fits(rolled):
        found = flash(rolled)
        sizes = {name: flash(rolled | {name}) for name in names if name not in rolled}
        smaller = {name: size for name, size in sizes.items() if size < found}
        if not smaller:  # perhaps all together, which share private functions
            if flash(everything) < found:
                rolled = everything
            break
        rolled = rolled | {min(smaller, key=lambda name: (rate(name), smaller[name]))}
    if fits(rolled):
        for name in sorted(rolled - forced, key=lambda name: (-rate(name), names.index(name))):
            if fits(rolled - {name}):
                rolled = rolled - {name}
    elif flash(everything) <= flash(forced):
        rolled = everything
    return mixed(straight, looped, rolled)


def _unmasked(name: str) -> str:
    """The function that a masked update goes with."""
    return name.removesuffix("_masked") if name.startswith("update_") else name


def told(code: FilterCode, rolled: Collection[str]) -> FilterCode:
    """With the form of each function, for the build's table, and the compiler's flags for it. rolled: what was to
    become loops, where there is something to loop over."""
    forms = {
        f.name: LOOPS if f.name in rolled and any(isinstance(s, For) for s in walk(f.body)) else STRAIGHT
        for f in code.functions if _counted(f)
    }  # fmt: skip
    return replace(code, forms=forms, notes=LOOPING if set(forms.values()) == {LOOPS} else code.notes)


def with_privates(code: FilterCode) -> FilterCode:
    """With the private functions that are called and not among the functions, each before the first that calls it."""
    out: list[Function] = []

    def add(function: Function) -> None:
        for callee in _callees(function):
            add(callee)
        if function.name not in {known.name for known in out}:
            out.append(function)

    for function in code.functions:
        add(function)
    return replace(code, functions=tuple(out))


def mixed(straight: FilterCode, looped: FilterCode, rolled: set[str]) -> FilterCode:
    """Functions by name from either. Where all that is called in a step is loops, the rest is what goes with these."""
    if all(f.name in rolled for f in straight.functions if _counted(f)):
        return told(looped, rolled)
    other = {f.name: f for f in looped.functions}
    functions = tuple(other[f.name] if f.name in rolled else f for f in straight.functions if not f.private)
    constants = {**straight.constants, **looped.constants} if rolled else straight.constants
    return told(replace(straight, functions=functions, constants=constants), rolled)


def _callees(function: Function) -> Iterator[Function]:
    for statement in walk(function.body):
        if isinstance(statement, Call):
            yield statement.callee


def _counted(function: Function) -> bool:
    return function.name == "predict" or function.name.startswith("update_")
