"""Formulas and specs with rotations, put together in Python: for what the spec's text is not in question."""

from __future__ import annotations

from fractions import Fraction

from kfgen.errors import NOWHERE
from kfgen.spec.tree import Call, Expression, Name, Number


class F:
    """A formula."""

    def __init__(self, tree):
        self.tree = tree

    def __add__(self, other):
        return F(Call("add", (self.tree, formula(other).tree)))

    def __sub__(self, other):
        return F(Call("sub", (self.tree, formula(other).tree)))

    def __rsub__(self, other):
        return formula(other) - self

    def __mul__(self, other):
        return F(Call("mul", (self.tree, formula(other).tree)))

    def __neg__(self):
        return F(Call("neg", (self.tree,)))

    __radd__, __rmul__ = __add__, __mul__

    @property
    def expression(self):
        return Expression(self.tree, "", NOWHERE)


def formula(v):
    if isinstance(v, F):
        return v
    return F(Name(v)) if isinstance(v, str) else F(Number(Fraction(str(v))))


def call(op, *arguments):
    return F(Call(op, tuple(formula(argument).tree for argument in arguments)))


def vector(name, parts="xyz"):
    return [formula(f"{name}_{part}") for part in parts]


def quaternion(name):
    return vector(name, "wxyz")


def rotate(q, v):
    return [sum((call("rotation", i, j, *q) * v[j] for j in range(1, 3)), call("rotation", i, 0, *q) * v[0])
            for i in range(3)]  # fmt: skip


def unrotate(q, v):
    return rotate([q[0], *(-part for part in q[1:])], v)


def product(p, q):
    a, b, c, d = p
    w, x, y, z = q
    return [a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w]  # fmt: skip


def turned_by(d):
    """The quaternion of a rotation vector."""
    return [call("from_rotation_vector", k, *d) for k in range(4)]


def rotation_vector(q):
    return [call("rotation_vector", k, *q) for k in range(3)]


def expressions(names, formulas):
    """name -> expression."""
    return {name: formula(each).expression for name, each in zip(names, formulas, strict=True)}
