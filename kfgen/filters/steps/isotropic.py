"""Noise that is the same in all directions stays so when it is turned: R s^2 I R^T = s^2 I."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from fractions import Fraction

from kfgen.filters.algebra.attitude import Attitude
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import is_zero
from kfgen.ir.nodes import Node
from kfgen.ir.trace import Trace, Value

Columns = list[tuple[Vector, Value]]
Factors = tuple[Fraction, tuple[Node, ...]]
"""A product: of a constant and of other nodes, in the order of their making."""


def turned_back(t: Trace, columns: Columns, attitudes: Iterable[Attitude]) -> Columns:
    """The same covariance from columns that no R takes part in: three of one weight whose rows are rows of R, or of
    R^T, times numbers, are the numbers alone."""
    known = [attitude.rows for attitude in attitudes]
    known += [[list(row) for row in zip(*R, strict=True)] for R in known]
    out: Columns = []
    k = 0
    while k < len(columns):
        triple = columns[k : k + 3]
        found = None
        if len(triple) == 3 and len({d.node for _, d in triple}) == 1:
            found = next((c for R in known if (c := _without(t, [w for w, _ in triple], R)) is not None), None)
        if found is None:
            out.append(columns[k])
            k += 1
        else:
            out += [(w, triple[0][1]) for w in found]
            k += 3
    return out


def _without(t: Trace, columns: Sequence[Vector], R: list[list[Value]]) -> list[Vector] | None:
    """Columns C with C C^T = G G^T for G = C R."""
    out: list[Vector] = [[t.zero] * len(columns[0]) for _ in range(3)]
    for place, row in enumerate(zip(*columns, strict=True)):
        if all(is_zero(v) for v in row):
            continue
        i, factor = next(((i, c) for i in range(3) if (c := _common(t, row, R[i])) is not None), (0, None))
        if factor is None:
            return None
        out[i][place] = factor
    return out


def _common(t: Trace, row: Sequence[Value], of: Sequence[Value]) -> Value | None:
    """c with row = c times another row, if that shows."""
    ratios = {_ratio(_factors(a.node), _factors(b.node)) for a, b in zip(row, of, strict=True)}
    ratio = ratios.pop() if len(ratios) == 1 else None
    if ratio is None:
        return None
    value = t.one
    for node in ratio[1]:
        value = value * t.wrapped(node)
    return value * ratio[0]


def _ratio(a: Factors, b: Factors) -> Factors | None:
    left = Counter(a[1])
    left.subtract(Counter(b[1]))
    if b[0] == 0 or any(count < 0 for count in left.values()):
        return None
    return a[0] / b[0], tuple(sorted(left.elements(), key=lambda node: node.serial))


def _factors(node: Node) -> Factors:
    if node.constant is not None:
        return node.constant, ()
    if node.op == "neg":
        constant, rest = _factors(node.args[0])
        return -constant, rest
    if node.op == "mul":
        (a, left), (b, right) = (_factors(each) for each in node.args)
        return a * b, (*left, *right)
    return Fraction(1), (node,)


def separated(Q: Rows, columns: Columns) -> tuple[Rows, Columns]:
    """Columns of a single entry as variances in Q (n, n)."""
    Q, out = [list(row) for row in Q], []
    for w, d in columns:
        entries = [i for i, v in enumerate(w) if not is_zero(v)]
        if len(entries) == 1:
            (i,) = entries
            Q[i][i] = Q[i][i] + w[i] * w[i] * d
        else:
            out.append((w, d))
    return Q, out
