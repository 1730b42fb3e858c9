"""Formulas of a spec as MathML, by SymPy's printer, with their names, constants too, as they are written."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from functools import partial
from typing import Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE

from kfgen.model.functions import KfFunction
from kfgen.spec.tree import Call, Expression, Name, Number, Tree

_ENTITIES = {"&InvisibleTimes;": "&#x22C5;", "&ExponentialE;": "e", "&ImaginaryI;": "i"}


class Literal(sympy.Symbol):  # type: ignore[misc] # SymPy has no types
    """A number that is to stand as it is written: x/1.2 is not 0.8333 x."""

    @property
    def precedence(self) -> float:
        """3e-5 is a product, in brackets under a power."""
        between = (PRECEDENCE["Mul"] + PRECEDENCE["Pow"]) / 2
        return between if "e" in self.name else float(PRECEDENCE["Atom"])


class Cases(KfFunction):
    """where(condition, a, b)."""


class Named(KfFunction):
    """A function under the name that is its first argument, a symbol."""


def _element(dom: Any, tag: str, *children: Any) -> Any:
    made = dom.createElement(tag)
    for child in children:
        made.appendChild(child)
    return made


def _named_call(printer: Any, expression: Any) -> Any:
    """f(a, b), f with an index where its name has one."""
    dom = printer.dom
    row = dom.createElement("mrow")

    def sign(text: str) -> None:
        mark = dom.createElement("mo")
        mark.appendChild(dom.createTextNode(text))
        row.appendChild(mark)

    row.appendChild(printer._print(expression.args[0]))
    for i, argument in enumerate(expression.args[1:]):
        sign("," if i else "(")
        row.appendChild(printer._print(argument))
    sign(")")
    return row


def _literal(printer: Any, expression: Any) -> Any:
    """A number, 3e-5 as 3 x 10^-5."""
    element, text = partial(_element, printer.dom), printer.dom.createTextNode
    digits, _, exponent = expression.name.partition("e")
    if not exponent:
        return element("mn", text(digits))
    ten = element("mn", text("10"))
    power = element("msup", ten, element("mn", text(str(int(exponent)).replace("-", "\N{MINUS SIGN}"))))
    if digits == "1":
        return power
    return element("mrow", element("mn", text(digits)), element("mo", text("·")), power)


def _cases(printer: Any, expression: Any) -> Any:
    """Cases as cases, a line each."""
    condition, yes, no = expression.args
    element, text = partial(_element, printer.dom), printer.dom.createTextNode
    lines = [(printer._print(yes), printer._print(condition)), (printer._print(no), element("mtext"))]
    lines[1][1].appendChild(text("otherwise"))
    rows = [element("mtr", *(element("mtd", cell) for cell in line)) for line in lines]
    return element("mrow", element("mo", text("{")), element("mtable", *rows))


def mathml(expression: Expression | Tree) -> str:
    """The MathML of a formula, without the tag around it."""
    tree = expression.tree if isinstance(expression, Expression) else expression
    return printed(symbolic(tree))


def printed(expression: Any) -> str:
    printer = MathMLPresentationPrinter()
    printer._print_Literal = partial(_literal, printer)
    printer._print_Cases = partial(_cases, printer)
    printer._print_Named = partial(_named_call, printer)
    text: str = printer.doprint(expression)
    text = text.replace("<mo><</mo>", "<mo>&lt;</mo>").replace("<mo>></mo>", "<mo>&gt;</mo>")
    text = re.sub(r"<mo>([()])</mo>", r'<mo stretchy="false">\1</mo>', text)
    text = text.replace("<mo>-</mo>", "<mo>&#x2212;</mo>")
    for name, plain in _ENTITIES.items():
        text = text.replace(name, plain)
    return text


def equation(left: str, expression: Expression | Tree) -> str:
    """A row `left = formula`; left is MathML."""
    return f"{left}<mo>=</mo><mrow>{mathml(expression)}</mrow>"


def name(text: str, suffix: str = "") -> str:
    """A name, with an index where it has an underscore, and a suffix as a further index."""
    return (
        printed(sympy.Symbol(text))
        if not suffix
        else f"<msub><mrow>{printed(sympy.Symbol(text))}</mrow>{suffix}</msub>"
    )


def word(text: str) -> str:
    return f"<mtext>{html.escape(text)}</mtext>"


def symbolic(tree: Tree) -> Any:
    """A tree as a SymPy expression of its own names; numbers stay as they are written."""
    if isinstance(tree, Number):
        if tree.value.denominator == 1 and abs(tree.value) < 10**6:
            return sympy.Integer(tree.value.numerator)
        return Literal(f"{float(tree.value):.15g}", positive=True)
    if isinstance(tree, Name):
        return sympy.pi if tree.name == "pi" else sympy.Symbol(tree.name)
    assert isinstance(tree, Call)
    if tree.op == "table":
        return sympy.Function("table")(symbolic(tree.args[0]))
    if tree.op in _PARTS:
        return _part(tree)
    return _CALLS[tree.op](*[symbolic(argument) for argument in tree.args])


_PARTS = {"rotation": ("R", 2), "rotation_vector": ("log", 1), "from_rotation_vector": ("exp", 1)}
"""Functions of which a tree has one entry: how they are called, and how many indices come first."""


def _part(tree: Call) -> Any:
    """One entry of a rotation's matrix, vector or quaternion; in terms of the whole where that has a name."""
    called, indices = _PARTS[tree.op]
    place = "".join(str(index.value + 1) for index in tree.args[:indices] if isinstance(index, Number))
    rest = tree.args[indices:]
    letters = "wxyz"[-len(rest) :]
    of = {each.name.rpartition("_")[0] if isinstance(each, Name) else "" for each in rest}
    if len(of) == 1 and of != {""} and [each.name[-1] for each in rest if isinstance(each, Name)] == list(letters):
        return _named(f"{called}_{place}")(sympy.Symbol(of.pop()))
    return _named(f"{called}_{place}")(*(symbolic(each) for each in rest))


def _named(text: str) -> Callable[..., Any]:
    return lambda *arguments: Named(sympy.Symbol(text), *arguments)


_CALLS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
    "pow": lambda a, b: a**b, "neg": lambda a: -a,
    "lt": lambda a, b: sympy.Lt(a, b, evaluate=False), "le": lambda a, b: sympy.Le(a, b, evaluate=False),
    "gt": lambda a, b: sympy.Gt(a, b, evaluate=False), "ge": lambda a, b: sympy.Ge(a, b, evaluate=False),
    "and": lambda a, b: sympy.And(a, b, evaluate=False), "or": lambda a, b: sympy.Or(a, b, evaluate=False),
    "not": lambda a: sympy.Not(a, evaluate=False),
    "sqrt": sympy.sqrt, "hypot": lambda a, b: sympy.sqrt(a**2 + b**2), "abs": sympy.Abs, "floor": sympy.floor,
    "exp": sympy.exp, "log": sympy.log, "where": Cases,
    **{op: getattr(sympy, op) for op in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{op: _named(op) for op in ("asin", "acos", "atan", "atan2", "sign", "min", "max")},
}  # fmt: skip


def plain(text: str) -> str:
    """A formula's text on one line."""
    return re.sub(r"\s+", " ", text).strip()
