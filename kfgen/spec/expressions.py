"""The whitelist parser: text of an expression -> tree. Nothing is ever evaluated.

A small operator-precedence parser over ASCII tokens, with Python's precedence: `or`, `and`, `not`,
comparison, `+ -`, `* / @`, unary minus, `**` (to the right). What is not in the grammar cannot be said.

What is parsed is the source: it may hold vectors (`list`, `part.x`, `index`, `matmul`, functions of vectors, and
`chain`, a long sum or product), of which `shaping` makes trees of numbers, as soon as the shapes of names are known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from kfgen.spec.calls import MAX_NESTING as MAX_NESTING
from kfgen.spec.calls import MAX_NODES as MAX_NODES
from kfgen.spec.calls import Calls
from kfgen.spec.lexer import ExpressionError, Token, number, tokenize
from kfgen.spec.tree import FUNCTIONS, OPERATORS, Call, Number, Tree

MAX_LENGTH = 10_000
MAX_DEPTH = 200  # of a finished tree: later stages recurse over it
MAX_EXPONENT = 64
LONG = 24  # longer sums and products become balanced trees

_COMPARISONS = {"<": "lt", "<=": "le", ">": "gt", ">=": "ge"}
_ARITHMETIC = {"+": "add", "-": "sub", "*": "mul", "/": "div", "@": "matmul"}
_OR, _AND, _NOT, _COMPARISON, _SUM, _PRODUCT, _UNARY, _POWER = range(1, 9)
_LEVELS = {
    "or": _OR, "and": _AND, **dict.fromkeys(_COMPARISONS, _COMPARISON), "+": _SUM, "-": _SUM, "*": _PRODUCT,
    "/": _PRODUCT, "@": _PRODUCT, "**": _POWER,
}  # fmt: skip
_INVERSE = {"add": "sub", "sub": "add", "mul": "div", "div": "mul"}
_CONDITIONS = frozenset(("lt", "le", "gt", "ge", "and", "or", "not"))


@dataclass(frozen=True, slots=True)
class Source:
    """What was parsed, and where its nodes stand in the text (by id)."""

    tree: Tree
    offsets: dict[int, int]


def parse_source(text: str, condition: bool = False, free: bool = False) -> Source:
    """An expression as it is written; `condition` where a comparison is asked for instead of a number.

    free: a name may be that of a function, where components of sensors stand.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(0, f"the expression is longer than {MAX_LENGTH} characters", "split it with `let`")
    parser = _Parser(tokenize(text), free)
    tree = parser.whole(condition)
    if depth(tree) > MAX_DEPTH:
        raise ExpressionError(0, "the expression is nested too deeply", "split it with `let`")
    return Source(tree, parser.offsets)


def parse(text: str, condition: bool = False) -> Tree:
    """The tree of an expression of numbers alone."""
    source = parse_source(text, condition)

    def plain(tree: Tree) -> Tree:
        if not isinstance(tree, Call):
            return tree
        args = tuple(map(plain, tree.args))
        if tree.op.startswith("chain "):
            return balanced(list(zip(["", *tree.op.split()[1:]], args, strict=True)))
        if tree.op not in OPERATORS and tree.op not in FUNCTIONS:
            raise ExpressionError(source.offsets[id(tree)], "a vector is no number", "write its parts")
        return replace(tree, args=args)

    return plain(source.tree)


def is_condition(tree: Tree) -> bool:
    return isinstance(tree, Call) and tree.op in _CONDITIONS


class _Parser(Calls):
    def whole(self, condition: bool) -> Tree:
        if self.token.kind == "end":
            raise ExpressionError(0, "the expression is empty", "write a number or an expression")
        start = self.token.offset
        tree = self.wanted(condition, start)
        if self.token.kind != "end":
            raise self.unexpected(self.token)
        return tree

    def wanted(self, condition: bool, start: int) -> Tree:
        """An expression that must be a number, or must be a condition."""
        tree = self.expression(0)
        if condition and not is_condition(tree):
            raise ExpressionError(start, "a condition is wanted here", "write a comparison: `a > b`")
        if not condition and is_condition(tree):
            hint = "write `where(condition, a, b)`"
            raise ExpressionError(start, "a condition is not a number", hint)
        return tree

    def expression(self, level: int) -> Tree:
        """All that binds at least as tightly as a level. One frame per nesting: the stack stays shallow."""
        token = self.take()
        if token.kind == "number":
            tree: Tree = self.made(number(token.text, token.offset), token.offset)
        elif token.text == "(":
            self.enter(token.offset)
            tree = self.expression(0)
            if not self.at(")"):
                self.unclosed(token)
            self.take()
            self.nesting -= 1
        elif token.text in ("-", "+"):
            self.enter(token.offset)
            operand = self.expression(_UNARY)
            self.nesting -= 1
            self.numbers(token, operand)
            tree = operand if token.text == "+" else self.made(Call("neg", (operand,)), token.offset)
        elif token.text == "not" and level <= _NOT:
            self.enter(token.offset)
            operand = self.expression(_NOT)
            self.nesting -= 1
            if not is_condition(operand):
                raise ExpressionError(token.offset, "`not` wants a condition", "write `not (a > b)`")
            tree = self.made(Call("not", (operand,)), token.offset)
        elif token.kind == "name" and token.text not in ("and", "or", "not"):
            tree = self.call(token) if self.at("(") else self.name(token)
        elif token.text == "[":
            tree = self.listed(token)
        else:
            raise self.unexpected(token)
        if self.at(".", "["):
            tree = self.parts(tree)
        while (binding := _LEVELS.get(self.token.text, -1)) >= level:
            tree = self.chain(tree, binding) if binding in (_SUM, _PRODUCT) else self.infix(tree, binding)
        return tree

    def infix(self, left: Tree, level: int) -> Tree:
        """One operator and its right side: a power, a comparison, `and`, `or`."""
        token = self.take()
        if level == _POWER:
            self.enter(token.offset)
            start = self.token.offset
            exponent = self.expression(_UNARY)
            self.nesting -= 1
            self.numbers(token, left, exponent)
            self.small(exponent, start)
            return self.made(Call("pow", (left, exponent)), token.offset)
        right = self.expression(level + 1)
        if level == _COMPARISON:
            if is_condition(left) or is_condition(right):
                raise ExpressionError(token.offset, f"`{token.text}` compares numbers, not conditions")
            if self.at(*_COMPARISONS):
                hint = "write `a < b and b < c`"
                raise ExpressionError(self.token.offset, "comparisons cannot be chained", hint)
            return self.made(Call(_COMPARISONS[token.text], (left, right)), token.offset)
        if not is_condition(left) or not is_condition(right):
            hint = "write a comparison on both sides"
            raise ExpressionError(token.offset, f"`{token.text}` joins conditions, not numbers", hint)
        return self.made(Call(token.text, (left, right)), token.offset)

    def chain(self, first: Tree, level: int) -> Tree:
        """`+ -`, or `* /`, from the left to the right."""
        terms: list[tuple[str, Tree, int]] = [("", first, 0)]
        while _LEVELS.get(self.token.text) == level:
            token = self.take()
            right = self.expression(level + 1)
            self.numbers(token, first, right)
            terms.append((_ARITHMETIC[token.text], right, token.offset))
        if len(terms) > LONG:
            made = Call(" ".join(["chain", *(op for op, _, _ in terms[1:])]), tuple(term for _, term, _ in terms))
            for _, _, offset in terms[1:]:  # each operator counts
                self.made(made, offset)
            return made
        tree = first
        for op, term, offset in terms[1:]:
            tree = self.made(Call(op, (tree, term)), offset)
        return tree

    def numbers(self, token: Token, *operands: Tree) -> None:
        if any(is_condition(operand) for operand in operands):
            hint = "write `where(condition, a, b)`"
            raise ExpressionError(token.offset, f"`{token.text}` wants numbers, not conditions", hint)

    def small(self, exponent: Tree, start: int) -> None:
        """A literal integer exponent has a limit; one that is computed is checked once it has a value."""
        literal = exponent.args[0] if isinstance(exponent, Call) and exponent.op == "neg" else exponent
        if isinstance(literal, Number) and literal.value.denominator == 1 and literal.value > MAX_EXPONENT:
            text = f"an integer exponent may be at most {MAX_EXPONENT} in size"
            raise ExpressionError(start, text, "use a smaller one")


def balanced(terms: list[tuple[str, Tree]]) -> Tree:
    """a + b - c ...: from the left, as in Python; a long chain as a balanced, shallow tree. The first op is empty."""
    if len(terms) <= LONG:
        tree = terms[0][1]
        for op, term in terms[1:]:
            tree = Call(op, (tree, term))
        return tree
    middle = len(terms) // 2
    op = terms[middle][0]
    right = [("", terms[middle][1]), *terms[middle + 1 :]]
    if op in ("sub", "div"):
        right = [right[0], *((_INVERSE[o], term) for o, term in right[1:])]
    return Call(op, (balanced(terms[:middle]), balanced(right)))


def depth(tree: Tree) -> int:
    found, level = 0, [tree]
    while level:
        found += 1
        level = [a for node in level if isinstance(node, Call) for a in node.args]
    return found
