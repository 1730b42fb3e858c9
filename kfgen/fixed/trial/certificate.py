"""What is known of overflow: of every operation of the integer program whether it can, and whether it came near.

Proved: intervals show that the result fits, whatever the filter is given, where it is plain C, or anywhere in the box
that the spec declares. Guarded: only runs have shown it; the operation saturates and says so, and in the probing runs
its result stayed below NEAR of what its format holds. At risk: it came closer than that, or saturated.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass

from kfgen.fixed.arithmetic.limits import INSIDE, LIMIT
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.fixed.program.nodes import nodes_of
from kfgen.ir.nodes import Node
from kfgen.ir.program import Function

NEAR = 7 / 8
_PLAIN = frozenset({"add", "sub", "mul", "neg", "q_fma"})
_CLIPPED = frozenset({"q_mac", "q_fit"})


@dataclass(frozen=True)
class Certificate:
    """Of one function: how many operations are proved, guarded, at risk. run: whether the probing run called it."""

    function: str
    proved: int
    guarded: int
    at_risk: int
    run: bool


def saturates(node: Node) -> bool:
    """Whether an operation of the integer program may clip its result."""
    if node.op == "q_shift" and node.data[0] > 0:
        return False
    return node.op.startswith("q_") and node.op not in Fixed.silent_ops


def certify(
    functions: Iterable[Function], peaks: Mapping[int, int], fitting: Container[int] = ()
) -> tuple[Certificate, ...]:
    """peaks: id of a node that saturates -> the largest size of its result in the probing runs. fitting: ids of those
    that fit anywhere in the declared box."""
    out = []
    for f in functions:
        operations = {id(node): node for node in nodes_of(f.body) if node.kind == "real"}.values()
        all_ = [node for node in operations if saturates(node)]
        clipping = [node for node in all_ if id(node) not in fitting]
        near = sum(peaks.get(id(node), 0) > NEAR * _limit(node) for node in clipping)
        run = not clipping or any(id(node) in peaks for node in clipping)
        plain = sum(node.op in _PLAIN or (node.op == "q_shift" and node.data[0] > 0) for node in operations)
        plain += len(all_) - len(clipping)
        out.append(Certificate(f.name, plain, len(clipping) - near, near, run))
    return tuple(out)


def lines(certificates: Iterable[Certificate], widest: Mapping[str, tuple[float, float]] | None = None
          ) -> tuple[str, ...]:  # fmt: skip
    """A table to print. widest: how far runs have gone in each quantity, from its least value to its largest."""
    rows = [c for c in certificates if c.proved or c.guarded or c.at_risk]
    width = max((len(c.function) for c in rows), default=0)
    width = max(width, len("operations"))
    head = f"{'operations':<{width}}  proved  guarded  at risk"
    return (head, *(
        f"{c.function:<{width}}  {c.proved:>6}  {c.guarded:>7}  {c.at_risk if c.run else 'not run':>7}" for c in rows
    ), *_extent(widest or {}))  # fmt: skip


def _extent(widest: Mapping[str, tuple[float, float]]) -> tuple[str, ...]:
    """Which runs the second and third column rest on."""
    if not widest:
        return ()
    spans = [f"{name} {low:.4g}" if low == high else f"{name} {low:.4g} to {high:.4g}"
             for name, (low, high) in widest.items()]  # fmt: skip
    return (f"guarded by runs, the widest of which had {', '.join(spans)}",)


def _limit(node: Node) -> int:
    return INSIDE if node.op in _CLIPPED else LIMIT
