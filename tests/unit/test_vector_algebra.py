"""Formulas with vectors, matrices and quaternions, written out, have the values that numpy and scipy give them."""

from __future__ import annotations

import math
import random
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation as Scipy

from kfgen.spec.constants import value
from kfgen.spec.expressions import parse_source
from kfgen.spec.lexer import ExpressionError
from kfgen.spec.shaping.expand import Expander
from kfgen.spec.shaping.extents import NUMBER, ROTATION, Extent, Shaped, matrix, suffixes, vector
from kfgen.spec.tree import Call, Name, Tree

EXTENTS = {"s": NUMBER, "c": NUMBER, "u": vector(2), "w": vector(2), "a": vector(3), "b": vector(3), "k": vector(5),
           "q": ROTATION, "r": ROTATION, "M": matrix(3, 3),
           "N": matrix(2, 3), "yaw": NUMBER, "ra": vector(3), "rb": vector(3)}  # fmt: skip

properties = settings(max_examples=300, derandomize=True, deadline=None, database=None)


class Table:
    """Names of known shapes; definitions are kept, or refused."""

    def __init__(self, defining: bool = True) -> None:
        self.defining = defining
        self.made: list[tuple[str, Tree]] = []

    def value(self, name: str) -> Shaped:
        extent = EXTENTS[name]
        if extent == NUMBER:
            return Shaped(NUMBER, (Name(name),))
        return Shaped(extent, tuple(Name(f"{name}_{s}") for s in suffixes(extent)))

    def define(self, tree: Tree) -> Tree | None:
        if not self.defining or not isinstance(tree, Call) or tree.op in ("lt", "le", "gt", "ge", "and", "or", "not"):
            return None
        self.made.append((f"made_{len(self.made)}", tree))
        return Name(self.made[-1][0])


def numbers(draw: random.Random) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, extent in EXTENTS.items():
        shape = {"number": (), "matrix": (extent.rows, extent.columns)}.get(extent.kind, (extent.rows,))
        found[name] = np.array([draw.uniform(-2, 2) for _ in range(extent.size)]).reshape(shape)
        if extent == ROTATION:
            found[name] /= np.linalg.norm(found[name])
    return found


def evaluated(text: str, given_: dict[str, Any], defining: bool = True) -> tuple[Extent, np.ndarray]:
    table = Table(defining)
    found = Expander(table, parse_source(text)).whole()
    environment: dict[str, Any] = {}
    for name, numbers_ in given_.items():
        if EXTENTS[name] == NUMBER:
            environment[name] = Fraction(float(numbers_))
        else:
            flat = np.ravel(numbers_)
            parts = suffixes(EXTENTS[name])
            environment |= {f"{name}_{s}": Fraction(float(x)) for s, x in zip(parts, flat, strict=True)}
    for name, tree in table.made:
        environment[name] = value(tree, environment)
    return found.extent, np.array([float(value(part, environment)) for part in found.parts])


# --- numpy's side


def turn(q: np.ndarray) -> Scipy:
    return Scipy.from_quat([q[1], q[2], q[3], q[0]])


def quaternion(rotation: Scipy) -> np.ndarray:
    x, y, z, w = rotation.as_quat()
    return np.array([w, x, y, z])


FORMULAS = {
    "a + b - 2*a": lambda v: v["a"] + v["b"] - 2 * v["a"],
    "-a*s/c": lambda v: -v["a"] * v["s"] / v["c"],
    "s*M": lambda v: v["s"] * v["M"],
    "M @ a": lambda v: v["M"] @ v["a"],
    "N @ M @ a": lambda v: v["N"] @ v["M"] @ v["a"],
    "N @ M": lambda v: v["N"] @ v["M"],
    "M + transpose(M)": lambda v: v["M"] + v["M"].T,
    "dot(a, b)": lambda v: v["a"] @ v["b"],
    "dot(k, k)": lambda v: v["k"] @ v["k"],
    "cross(a, b + a)": lambda v: np.cross(v["a"], v["b"] + v["a"]),
    "norm(a)": lambda v: np.linalg.norm(v["a"]),
    "normalize(k)": lambda v: v["k"] / np.linalg.norm(v["k"]),
    "skew(a) @ b": lambda v: np.cross(v["a"], v["b"]),
    "diag(a) @ b": lambda v: v["a"] * v["b"],
    "diag(M)": lambda v: np.diag(v["M"]),
    "outer(u, a)": lambda v: np.outer(v["u"], v["a"]),
    "[s, c, 1] + a": lambda v: np.array([v["s"], v["c"], 1]) + v["a"],
    "[u, w] @ [1, 2]": lambda v: np.array([v["u"], v["w"]]) @ np.array([1, 2]),
    "[[1, 2, 3], a] @ b": lambda v: np.array([[1, 2, 3], v["a"]]) @ v["b"],
    "a.x + b[2] - M[1, 2] + N[0][1] + k.5": lambda v: v["a"][0] + v["b"][2] - v["M"][1, 2] + v["N"][0, 1] + v["k"][4],
    "M[1]": lambda v: v["M"][1],
    "min(a, b)": lambda v: np.minimum(v["a"], v["b"]),
    "max(a, s)": lambda v: np.maximum(v["a"], v["s"]),
    "abs(a - b)": lambda v: np.abs(v["a"] - v["b"]),
    "where(s < c, a, b)": lambda v: v["a"] if v["s"] < v["c"] else v["b"],
    "where(s < c, a, 0)": lambda v: v["a"] if v["s"] < v["c"] else 0 * v["a"],
    "table(a, [-1, 0, 1], [1, 3, 2])": lambda v: np.interp(v["a"], [-1, 0, 1], [1, 3, 2]),
    "table(s, [-1, 1], [a, b])": lambda v: np.array([np.interp(v["s"], [-1, 1], e) for e in np.c_[v["a"], v["b"]]]),
    "q*r": lambda v: quaternion(turn(v["q"]) * turn(v["r"])),
    "q*r*conjugate(q)": lambda v: quaternion(turn(v["q"]) * turn(v["r"]) * turn(v["q"]).inv()),
    "rotate(q, a)": lambda v: turn(v["q"]).apply(v["a"]),
    "unrotate(q*r, a - b)": lambda v: (turn(v["q"]) * turn(v["r"])).inv().apply(v["a"] - v["b"]),
    "rotation(q)": lambda v: turn(v["q"]).as_matrix(),
    "rotation(q) @ a": lambda v: turn(v["q"]).apply(v["a"]),
    "rotation_vector(q)": lambda v: turn(v["q"]).as_rotvec(),
    "from_rotation_vector(a)": lambda v: quaternion(Scipy.from_rotvec(v["a"])),
    "yaw(q)": lambda v: turn(v["q"]).as_euler("ZYX")[0],
    "pitch(q)": lambda v: turn(v["q"]).as_euler("ZYX")[1],
    "roll(q)": lambda v: turn(v["q"]).as_euler("ZYX")[2],
    "from_euler(a.x, a.y, a.z)": lambda v: quaternion(Scipy.from_euler("ZYX", v["a"][::-1])),
    "yaw + yaw(q)": lambda v: v["yaw"] + turn(v["q"]).as_euler("ZYX")[0],
    "q + r": lambda v: v["q"] + v["r"],
    "-q": lambda v: -v["q"],
    "normalize(q*2)": lambda v: v["q"],
    "where(q.w < 0, -q, q)": lambda v: -v["q"] if v["q"][0] < 0 else v["q"],
    "+".join(["a"] * 40) + "-b": lambda v: 40 * v["a"] - v["b"],
    "*".join(["s"] * 15 + ["a"] + ["c"] * 15): lambda v: v["s"] ** 15 * v["a"] * v["c"] ** 15,
    "a" + "/s*c" * 15: lambda v: v["a"] * (v["c"] / v["s"]) ** 15,
}  # fmt: skip


@pytest.mark.parametrize("text", FORMULAS)
def test_values(text: str) -> None:
    for seed in range(5):
        given_ = numbers(random.Random(seed))
        for defining in (True, False):
            extent, found = evaluated(text, given_, defining)
            wanted = np.ravel(FORMULAS[text](given_))
            if extent == ROTATION and "+" not in text and found @ wanted < 0:
                wanted = -wanted  # the same rotation
            assert found == pytest.approx(wanted, rel=1e-11, abs=1e-11), text


@properties
@given(st.randoms(use_true_random=False))
def test_rotation_between(draw: random.Random) -> None:
    a = [draw.choice([0.0, 1.0, -1.0, draw.uniform(-2, 2), draw.uniform(-1e-3, 1e-3)]) for _ in range(3)]
    b = draw.choice([[-x for x in a], a, [2 * x for x in a], [draw.uniform(-2, 2) for _ in range(3)]])
    given_ = {"a": np.array(a), "b": np.array(b)}
    _, q = evaluated("rotation_between(a, b)", given_)
    assert np.linalg.norm(q) == pytest.approx(1, abs=1e-12)
    lengths = np.linalg.norm(a), np.linalg.norm(b)
    if min(lengths) == 0:
        assert q == pytest.approx([1, 0, 0, 0])
        return
    assert turn(q).apply(np.array(a) / lengths[0]) == pytest.approx(np.array(b) / lengths[1], abs=3e-5)
    angle = math.acos(max(-1.0, min(1.0, np.dot(a, b) / lengths[0] / lengths[1])))
    assert turn(q).magnitude() == pytest.approx(angle, abs=3e-5), "the shortest"


@properties
@given(st.randoms(use_true_random=False))
def test_triad(draw: random.Random) -> None:
    def some() -> np.ndarray:
        return np.array([draw.choice([0.0, 1.0, -1.0, draw.uniform(-2, 2)]) for _ in range(3)])

    ra, rb = some(), some()
    truth = Scipy.random(random_state=draw.randrange(1000))
    if draw.random() < 0.3:
        truth = Scipy.from_rotvec(math.pi * np.eye(3)[draw.randrange(3)])
    a, b = truth.inv().apply(ra), truth.inv().apply(rb) * 3 + draw.uniform(-1, 1) * truth.inv().apply(ra)
    given_ = {"a": a, "b": b, "ra": ra, "rb": rb}
    _, q = evaluated("triad(a, b, ra, rb)", given_)
    assert np.all(np.isfinite(q))
    assert np.linalg.norm(q) == pytest.approx(1, abs=1e-9)
    if np.linalg.norm(ra) < 1e-9:
        return
    assert turn(q).apply(a) == pytest.approx(ra, abs=1e-4)
    across = np.cross(ra, rb)
    if np.linalg.norm(across) > 1e-3:
        assert turn(q).apply(b) @ across == pytest.approx(0, abs=1e-3), "b in the plane of ra and rb"
        level = np.cross(across, ra)
        assert turn(q).apply(b) @ level > 0, "on the side of rb"


@pytest.mark.parametrize("text", ["normalize(a)", "norm(a)", "rotation_between(a, a)", "from_rotation_vector(a)",
                                  "triad(a, a, a, a)", "yaw(from_rotation_vector(a))"])  # fmt: skip
def test_finite_where_a_norm_is_0(text: str) -> None:
    _, found = evaluated(text, {"a": np.zeros(3)})
    assert np.all(np.isfinite(found))


OPERATORS = ["+", "-", "*", "/", "@"]
FUNCTIONS = ["dot", "cross", "outer", "rotate", "unrotate", "min", "max", "hypot", "atan2"]
SINGLE = ["norm", "normalize", "skew", "transpose", "diag", "conjugate", "rotation", "rotation_vector", "yaw",
          "from_rotation_vector", "abs", "sin", "-"]  # fmt: skip


def some_formula(draw: random.Random, level: int) -> str:
    if level == 0 or draw.random() < 0.15:
        return draw.choice([*EXTENTS, "2", "[1, 2, 3]", "a.x", "q.w", "M[0]", "k[4]", "[a, b, a]", "u.y"])
    kind = draw.randrange(4)
    if kind == 0:
        return f"({some_formula(draw, level - 1)} {draw.choice(OPERATORS)} {some_formula(draw, level - 1)})"
    if kind == 1:
        return f"{draw.choice(FUNCTIONS)}({some_formula(draw, level - 1)}, {some_formula(draw, level - 1)})"
    if kind == 2:
        return f"{draw.choice(SINGLE)}({some_formula(draw, level - 1)})"
    return f"[{some_formula(draw, level - 1)}, {some_formula(draw, level - 1)}]"


@settings(max_examples=1500, derandomize=True, deadline=None, database=None)
@given(st.randoms(use_true_random=False))
def test_any_formula_has_a_shape_or_a_mistake_with_a_cure(draw: random.Random) -> None:
    text = some_formula(draw, 4)
    try:
        found = Expander(Table(draw.random() < 0.5), parse_source(text)).whole()
    except ExpressionError as error:
        mistake = error
    else:
        assert len(found.parts) == found.extent.size
        return
    assert mistake.message
    assert mistake.hint, (text, mistake.message)
    assert 0 <= mistake.offset < len(text)


@pytest.mark.parametrize("defining", [True, False])
def test_nothing_blows_up(defining: bool) -> None:
    for text in ("*".join(["q"] * 200), "rotate(q, " * 90 + "a" + ")" * 90, "M @ " * 200 + "a",
                 "normalize(a + " * 45 + "a" + ")" * 45, "cross(a, " * 90 + "a" + ")" * 90):  # fmt: skip
        table = Table(defining)
        try:
            Expander(table, parse_source(text)).whole()
        except ExpressionError as error:
            mistake = error.hint
        else:
            mistake = "let"
        assert "let" in mistake
        assert len(table.made) < 3000
