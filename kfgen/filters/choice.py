"""Which functions of a filter are emitted as loops: `unroll`, within `flash`."""

from __future__ import annotations

from collections.abc import Collection, Iterator
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


def choose(straight: FilterCode, looped: FilterCode, budget: int, loops: bool, scalar: str) -> FilterCode:
    """The functions of two forms of a filter, loops where straight-line code would exceed the budget in bytes.

    Those that save most become loops first; none does that saves nothing. loops: all of them are. Where nothing is
    sure to fit, all become loops if loops are what is smaller, so that `auto` then takes what `none` takes. Whether it
    is predicted to exceed the budget is told by whoever judges budgets.
    """
    names = [f.name for f in straight.functions if _counted(f)]
    everything = set(names)
    rolled = everything if loops else set[str]()

    def flash(chosen: set[str]) -> int:
        functions = with_privates(_mixed(straight, looped, chosen)).functions
        return predicted([f for f in functions if f.private or f.name == "init" or _counted(f)], scalar)

    while flash(rolled) * MARGIN > budget:
        found = flash(rolled)
        sizes = {name: flash(rolled | {name}) for name in names if name not in rolled}
        smaller = {name: size for name, size in sizes.items() if size < found}
        if not smaller:  # perhaps all together, which share private functions
            if flash(everything) < found:
                rolled = everything
            break
        rolled = rolled | {min(smaller, key=lambda name: smaller[name])}
    if flash(rolled) * MARGIN > budget and flash(everything) <= flash(set()):
        rolled = everything
    return _mixed(straight, looped, rolled)


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


def _mixed(straight: FilterCode, looped: FilterCode, rolled: set[str]) -> FilterCode:
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
