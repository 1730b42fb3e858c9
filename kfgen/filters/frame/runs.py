"""Runs of numbers that are alike: neighbours of one array, or equal constants, are handled by a loop."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from kfgen.filters.algebra.linalg import Vector
from kfgen.ir.trace import Array, Trace, Value

LEAST = 4  # neighbours from which on a loop is shorter

Put = Callable[[int | Value, Value], None]


@dataclass(frozen=True)
class Run:
    """Positions start .. stop - 1 hold `value`, or what `array` (a local, or a field of the struct) has at
    position + shift."""

    start: int
    stop: int
    value: Value
    array: str = ""
    local: bool = False
    shift: int = 0

    def at(self, t: Trace, i: int | Value) -> Value:
        """The number at a position."""
        if not self.array:
            return self.value
        place = i + self.shift
        return Array(t, self.array)[place] if self.local else t.element(self.array, place)


def runs(t: Trace, values: Mapping[int, Value], local: bool = False) -> Iterator[Run]:
    """What is at the positions, ascending. What has been given a name is a run of its own.

    local: only entries of local arrays make longer ones.
    """
    found: Run | None = None
    for i in sorted(values):
        new = _single(t, i, values[i])
        if local and not new.local:
            new = replace(new, array=f"?{i}")
        if found is not None and found.stop == i and _continues(found, new):
            found = replace(found, stop=i + 1)
            continue
        if found is not None:
            yield found
        found = new
    if found is not None:
        yield found


def put(t: Trace, target: Put, values: Mapping[int, Value] | Vector, local: bool = False) -> None:
    """target(i, value) for every position, in loops where there are runs."""
    given = values if isinstance(values, Mapping) else dict(enumerate(values))
    numbers = {i: t.value(v) for i, v in given.items()}
    common = None if local else _common(numbers)
    if common is not None:
        with t.loop("i", min(numbers), max(numbers) + 1) as counter:
            target(counter, common)
        numbers = {i: v for i, v in numbers.items() if v.constant != common.constant}
    for run in runs(t, numbers, local):
        if run.stop - run.start < LEAST:
            for i in range(run.start, run.stop):
                target(i, numbers[i])
            continue
        with t.loop("i", run.start, run.stop) as counter:
            target(counter, run.at(t, counter))


def summed(t: Trace, values: list[Value]) -> list[Value]:
    """Numbers of the same sum: runs of local arrays are added up in loops, those of the same range in one."""
    out: list[Value] = []
    arrays: dict[tuple[int, int], list[str]] = {}
    for run in runs(t, dict(enumerate(values)), local=True):
        if run.stop - run.start < LEAST:
            out += values[run.start : run.stop]
        else:
            arrays.setdefault((run.start + run.shift, run.stop + run.shift), []).append(run.array)
    for (start, stop), names in arrays.items():
        total = t.variable(t.unique("check"), 0)
        with t.loop("i", start, stop) as i:
            terms = [Array(t, name)[i] for name in names]
            total.set(sum(terms, total.get()))
        out.append(total.get())
    return out


def _common(numbers: Mapping[int, Value]) -> Value | None:
    """A constant that most of the positions have, all of them in a row, but for neighbours that are alike."""
    counts = Counter(v.constant for v in numbers.values() if v.constant is not None)
    if not counts or len(numbers) != max(numbers) + 1 - min(numbers):
        return None
    constant, count = counts.most_common(1)[0]
    if count < 2 * LEAST - 1 or 2 * count < len(numbers):
        return None
    places = [i for i, v in numbers.items() if v.constant == constant]
    if places[-1] - places[0] + 1 == count:  # a run as it is
        return None
    return numbers[places[0]]


def _single(t: Trace, i: int, value: Value) -> Run:
    node = value.node
    index = node.args[0].constant if node.op in ("read", "element") and node.args else None
    if index is None or node in t.names:
        return Run(i, i + 1, value)
    return Run(i, i + 1, value, node.data, node.op == "read", int(index) - i)


def _continues(run: Run, new: Run) -> bool:
    if run.array or new.array:
        return (run.array, run.local, run.shift) == (new.array, new.local, new.shift)
    return run.value.constant is not None and run.value.constant == new.value.constant
