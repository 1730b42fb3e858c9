"""The reference's automatic differentiation against mpmath's numerical derivatives."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from kfgen.reference.dual import Dual, jacobian, values, variables
from kfgen.reference.evaluate import Closure, Scope
from kfgen.reference.integrators import INTEGRATORS
from kfgen.reference.manifold import Manifold
from kfgen.spec.expressions import parse

NAMES = ("x", "y")


def closure(text: str) -> tuple[Scope, Closure]:
    scope = Scope({}, NAMES)
    return scope, scope.compile(parse(text))


def evaluate(text: str, *point: float, order: int = 2) -> Dual:
    """The expression at (x, y) with derivatives by both; constants become Duals without any."""
    _, formula = closure(text)
    result = formula(variables([float(v) for v in point], order))
    if isinstance(result, Dual):
        return result
    return Dual(float(result), np.zeros(len(point)), np.zeros((len(point), len(point))))


def mp_derivatives(f, x: float, y: float) -> tuple[float, np.ndarray, np.ndarray]:
    with mpmath.workdps(60):
        point = (mpmath.mpf(x), mpmath.mpf(y))
        first = [mpmath.diff(f, point, order) for order in ((1, 0), (0, 1))]
        xx, xy, yy = (mpmath.diff(f, point, order) for order in ((2, 0), (1, 1), (0, 2)))
        gradient = np.array([float(d) for d in first])
        return float(f(*point)), gradient, np.array([[xx, xy], [xy, yy]], dtype=float)


m = mpmath
SMOOTH = [
    ("sin(x)", lambda x, y: m.sin(x)),
    ("cos(x)", lambda x, y: m.cos(x)),
    ("tan(x)", lambda x, y: m.tan(x)),
    ("asin(x/9)", lambda x, y: m.asin(x / 9)),
    ("acos(x/9)", lambda x, y: m.acos(x / 9)),
    ("atan(x)", lambda x, y: m.atan(x)),
    ("atan2(y, x)", lambda x, y: m.atan2(y, x)),
    ("atan2(y, 2)", lambda x, y: m.atan2(y, 2)),
    ("atan2(2, x)", lambda x, y: m.atan2(2, x)),
    ("sinh(x)", lambda x, y: m.sinh(x)),
    ("cosh(x)", lambda x, y: m.cosh(x)),
    ("tanh(x)", lambda x, y: m.tanh(x)),
    ("exp(x)", lambda x, y: m.exp(x)),
    ("log(x**2)", lambda x, y: m.log(x**2)),
    ("sqrt(x**2 + y**2)", lambda x, y: m.sqrt(x**2 + y**2)),
    ("hypot(x, y)", lambda x, y: m.hypot(x, y)),
    ("hypot(x, 3)", lambda x, y: m.hypot(x, 3)),
    ("abs(x)*y", lambda x, y: abs(x) * y),
    ("sign(x)*x*y", lambda x, y: m.sign(x) * x * y),
    ("min(x*y, x + y)", lambda x, y: min(x * y, x + y)),
    ("max(x*y, x + y)", lambda x, y: max(x * y, x + y)),
    ("floor(x)*y", lambda x, y: m.floor(x) * y),
    ("where(x < y, x*y, x**2)", lambda x, y: x * y if x < y else x**2),
    ("where(not (x < y) or x > 100, x*y, x**2)", lambda x, y: x * y if x >= y else x**2),
    ("table(x, [-3, 0.5, 2], [1, 2, -4])*y", lambda x, y: y * table_mp(x)),
    ("x*y", lambda x, y: x * y),
    ("x/y", lambda x, y: x / y),
    ("3/y", lambda x, y: 3 / y),
    ("x/3", lambda x, y: x / 3),
    ("3 - x", lambda x, y: 3 - x),
    ("x**3", lambda x, y: x**3),
    ("x**(-2)", lambda x, y: x**-2),
    ("(x**2)**1.5", lambda x, y: (x**2) ** m.mpf("1.5")),
    ("abs(x)**0.5", lambda x, y: abs(x) ** m.mpf("0.5")),
    ("2**x", lambda x, y: m.mpf(2) ** x),
    ("(x**2)**y", lambda x, y: (x**2) ** y),
    ("(1 + x**2)**(y/2)", lambda x, y: (1 + x**2) ** (y / 2)),
    ("exp(-x**2/2)*sin(3*y + 1)/(2 + cos(x*y))", lambda x, y: (
        m.exp(-(x**2) / 2) * m.sin(3 * y + 1) / (2 + m.cos(x * y)))),
    ("sqrt(1 + tanh(x)**2*exp(y)) - atan2(sin(y), x + 7)", lambda x, y: (
        m.sqrt(1 + m.tanh(x) ** 2 * m.exp(y)) - m.atan2(m.sin(y), x + 7))),
]  # fmt: skip


def table_mp(x):
    knots, heights = (m.mpf(-3), m.mpf("0.5"), m.mpf(2)), (1, 2, -4)
    if x < knots[0]:
        return heights[0]
    for i in range(2):
        if x < knots[i + 1]:
            return heights[i] + (x - knots[i]) * (heights[i + 1] - heights[i]) / (knots[i + 1] - knots[i])
    return heights[-1]


@pytest.mark.parametrize(("text", "function"), SMOOTH, ids=[text for text, _ in SMOOTH])
@pytest.mark.parametrize("point", [(0.7, 1.9), (-2.3, 0.4), (1.25, -3.5), (-4.1, -0.6), (3.3, 5.2)])
def test_value_gradient_hessian(text, function, point):
    value, gradient, hessian = mp_derivatives(function, *point)
    got = evaluate(text, *point)
    assert got.value == pytest.approx(value, rel=1e-14, abs=1e-15)
    np.testing.assert_allclose(got.gradient, gradient, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(got.hessian, hessian, rtol=1e-11, atol=1e-12)
    first = evaluate(text, *point, order=1)
    assert first.value == got.value
    np.testing.assert_array_equal(first.gradient, got.gradient)


@pytest.mark.parametrize(
    ("text", "point", "value", "gradient"),
    [
        ("abs(x)", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("sqrt(x)", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("x**0.5", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("sqrt(x**2 + y**2)", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("hypot(x, y)", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("atan2(y, x)", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("sign(x)", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("min(x, 2*x)", (0.0, 0.0), 0.0, (1.0, 0.0)),
        ("max(x, 2*x)", (0.0, 0.0), 0.0, (1.0, 0.0)),
        ("min(y, x)", (1.0, 1.0), 1.0, (0.0, 1.0)),
        ("max(y, x)", (1.0, 1.0), 1.0, (0.0, 1.0)),
        ("floor(x)", (2.0, 0.0), 2.0, (0.0, 0.0)),
        ("x**0", (0.0, 0.0), 1.0, (0.0, 0.0)),
        ("x**1", (0.0, 0.0), 0.0, (1.0, 0.0)),
        ("x**2", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("table(x, [0, 1, 3], [5, 6, 0])", (-1.0, 0.0), 5.0, (0.0, 0.0)),
        ("table(x, [0, 1, 3], [5, 6, 0])", (0.0, 0.0), 5.0, (1.0, 0.0)),
        ("table(x, [0, 1, 3], [5, 6, 0])", (1.0, 0.0), 6.0, (-3.0, 0.0)),
        ("table(x, [0, 1, 3], [5, 6, 0])", (3.0, 0.0), 0.0, (-3.0, 0.0)),
        ("table(x, [0, 1, 3], [5, 6, 0])", (9.0, 0.0), 0.0, (0.0, 0.0)),
        # only the selected branch may be undefined
        ("where(x > 0, log(x), x)", (-2.0, 0.0), -2.0, (1.0, 0.0)),
        ("where(x > 0, sqrt(x)/x, 0)", (0.0, 0.0), 0.0, (0.0, 0.0)),
        ("where(x > 0 and 1/x < 9, x, 3*x)", (0.0, 0.0), 0.0, (3.0, 0.0)),
        ("min(1/x, y)", (0.0, 4.0), 4.0, (0.0, 1.0)),
    ],
)
@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")
def test_singular_points(text, point, value, gradient):
    got = evaluate(text, *point)
    assert got.value == value
    np.testing.assert_array_equal(got.gradient, gradient)
    assert np.all(np.isfinite(got.hessian))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1/x", math.inf), ("-1/x", -math.inf), ("x/x", math.nan), ("log(x)", -math.inf),
        ("log(x - 1)", math.nan),
        ("sqrt(x - 1)", math.nan), ("asin(x + 2)", math.nan), ("acos(x - 2)", math.nan),
        ("exp(x + 1000)", math.inf),
        ("sinh(x - 1000)", -math.inf), ("cosh(x - 1000)", math.inf), ("(x - 1)**0.3", math.nan),
        ("x**(-1)", math.inf), ("(x - 10)**63*(x - 10)**63*1e300", math.inf), ("sin(1/x)", math.nan),
        ("cos(1/x)", math.nan), ("tan(1/x)", math.nan), ("floor(1/x)", math.inf), ("min(x, x/x)", math.nan),
        ("max(x/x, x)", math.nan), ("table(x/x, [0, 1], [2, 3])", math.nan), ("sign(x/x)", math.nan),
        ("(x - 1e200)**3", -math.inf), ("1e300*1e300*(x + 1)", math.inf),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")
def test_poles_are_infinities_and_never_raise(text, value):
    _, formula = closure(text)
    np.testing.assert_equal(formula([0.0, 0.0]), value)
    np.testing.assert_equal(evaluate(text, 0.0, 0.0).value, value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.5*0.1**2", 0.005), ("0.1 + 0.2", 0.3), ("sin(pi/6)", 0.5), ("sqrt(0.04)", 0.2),
        ("(1/3)*3", 1.0), ("log(exp(2))", 2.0), ("hypot(3, 4)", 5.0), ("2**0.5", math.sqrt(2)),
        ("min(1/3, 0.3)", 0.3), ("floor(-0.5)", -1.0), ("where(1/3 < 0.3, 1, 2)", 2.0), ("sign(-0.1)", -1.0),
        ("table(0.3, [0, 1], [0, 10])", 3.0), ("table(pi, [0, 4], [0, 4])", math.pi), ("abs(-0.1)", 0.1),
        ("(1e200)**64/(1e200)**64", 1.0), ("max(e, pi)", math.pi),
    ],
)  # fmt: skip
def test_constants_fold_exactly(text, value):
    _, formula = closure(text)
    assert formula([0.0, 0.0]) == pytest.approx(value, rel=0, abs=0)


def test_definitions_are_lazy_and_shared():
    from kfgen.errors import Place
    from kfgen.spec.tree import Expression

    scope = Scope({}, NAMES)
    for name, text in (("root", "sqrt(x)"), ("twice", "2*root"), ("half", "1/2")):
        scope.define(name, Expression(parse(text), text, Place()))
    formula = scope.compile(parse("where(x > 0, twice*root, half)"))

    def at(x: float) -> float:
        environment = scope.empty()
        environment[:2] = [x, 0.0]
        return formula(environment)

    assert at(4.0) == 8.0
    assert at(-1.0) == 0.5


@pytest.mark.parametrize("integrator", ["euler", "midpoint", "rk4"])
def test_integrators_are_differentiated_exactly(integrator):
    """Through the stages of a pendulum with damping: against the same method in 60 digits."""
    scope = Scope({}, ("q", "w", "u"))
    q_dot, w_dot = scope.compile(parse("w")), scope.compile(parse("-9.81*sin(q) - 0.3*w*abs(w) + u*cos(q)"))

    def step(q, w, u, h=0.05):
        def f(x):
            environment = [*x, u]
            return [q_dot(environment), w_dot(environment)]

        return INTEGRATORS[integrator](f, [q, w], h, Manifold(["q", "w"], []))

    def mp_step(q, w, u):
        def f(a, b):
            return b, -m.mpf("9.81") * m.sin(a) - m.mpf("0.3") * b * abs(b) + u * m.cos(a)

        h = m.mpf("0.05")
        k1 = f(q, w)
        if integrator == "euler":
            return q + h * k1[0], w + h * k1[1]
        k2 = f(q + h / 2 * k1[0], w + h / 2 * k1[1])
        if integrator == "midpoint":
            return q + h * k2[0], w + h * k2[1]
        k3 = f(q + h / 2 * k2[0], w + h / 2 * k2[1])
        k4 = f(q + h * k3[0], w + h * k3[1])
        return tuple(
            a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip((q, w), k1, k2, k3, k4, strict=True)
        )

    point = (0.8, -1.3, 2.0)
    after = step(*variables(point))
    with mpmath.workdps(50):
        exact = [mp_step(*(m.mpf(v) for v in point))[i] for i in range(2)]
        rows = [
            [
                m.diff(lambda *p, i=i: mp_step(*p)[i], point, tuple(int(j == k) for k in range(3)))
                for j in range(3)
            ]
            for i in range(2)
        ]
    np.testing.assert_allclose(values(after), np.array(exact, dtype=float), rtol=1e-14)
    np.testing.assert_allclose(jacobian(after, 3), np.array(rows, dtype=float), rtol=1e-11, atol=1e-13)
