"""The whitelist parser: text of an expression -> tree. Nothing is ever evaluated.

A small operator-precedence parser over ASCII tokens, with Python's precedence: `or`, `and`, `not`,
comparison, `+ -`, `* /`, unary minus, `**` (to the right). What is not in the grammar cannot be said.
"""

from __future__ import annotations

from kfgen.spec.lexer import ExpressionError, Token, number, tokenize
from kfgen.spec.problems import did_you_mean, short
from kfgen.spec.tree import FUNCTIONS, Call, Name, Number, Tree

MAX_LENGTH = 10_000
MAX_NODES = 2_000
MAX_NESTING = 100
MAX_DEPTH = 200  # of a finished tree: later stages recurse over it
MAX_EXPONENT = 64
_CHAIN = 24  # longer sums and products become balanced trees

_COMPARISONS = {"<": "lt", "<=": "le", ">": "gt", ">=": "ge"}
_ARITHMETIC = {"+": "add", "-": "sub", "*": "mul", "/": "div"}
_OR, _AND, _NOT, _COMPARISON, _SUM, _PRODUCT, _UNARY, _POWER = range(1, 9)
_LEVELS = {
    "or": _OR, "and": _AND, **dict.fromkeys(_COMPARISONS, _COMPARISON), "+": _SUM, "-": _SUM, "*": _PRODUCT,
    "/": _PRODUCT, "**": _POWER,
}  # fmt: skip
_INVERSE = {"add": "sub", "sub": "add", "mul": "div", "div": "mul"}
_CONDITIONS = frozenset(("lt", "le", "gt", "ge", "and", "or", "not"))
_OTHER_NAMES = {
    "ln": "log", "arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2", "fabs": "abs",
    "sgn": "sign", "fmin": "min", "fmax": "max", "if": "where", "select": "where", "interp": "table",
}  # fmt: skip
_OTHER_CALLS = {
    "pow": "write `a**b`", "square": "write `a**2`", "sq": "write `a**2`", "log10": "write `log(a)/log(10)`",
    "log2": "write `log(a)/log(2)`", "cbrt": "write `a**(1/3)`", "exp2": "write `2**a`",
    "ceil": "write `-floor(-a)`", "radians": "write `a*pi/180`", "degrees": "write `a*180/pi`",
}  # fmt: skip


def parse(text: str, condition: bool = False) -> Tree:
    """The tree of an expression; `condition` where a comparison is asked for instead of a number."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(0, f"the expression is longer than {MAX_LENGTH} characters", "split it with `let`")
    tree = _Parser(tokenize(text)).whole(condition)
    if _depth(tree) > MAX_DEPTH:
        raise ExpressionError(0, "the expression is nested too deeply", "split it with `let`")
    return tree


def is_condition(tree: Tree) -> bool:
    return isinstance(tree, Call) and tree.op in _CONDITIONS


class _Parser:
    def __init__(self, tokens: list[Token]) -> None:
        self.tokens = tokens
        self.next = 0
        self.nodes = 0
        self.nesting = 0

    @property
    def token(self) -> Token:
        return self.tokens[self.next]

    def take(self) -> Token:
        token = self.tokens[self.next]
        self.next += 1
        return token

    def at(self, *words: str) -> bool:
        return self.token.kind in ("op", "name") and self.token.text in words

    def made(self, tree: Tree, offset: int) -> Tree:
        self.nodes += 1
        if self.nodes > MAX_NODES:
            hint = "split it with `let`"
            raise ExpressionError(offset, f"the expression has more than {MAX_NODES} nodes", hint)
        return tree

    def enter(self, offset: int) -> None:
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            hint = "split it with `let`"
            raise ExpressionError(offset, f"the expression is nested deeper than {MAX_NESTING}", hint)

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

    def unexpected(self, token: Token) -> ExpressionError:
        if token.kind == "end":
            return ExpressionError(token.offset, "the expression ends too early")
        if token.text == ")":
            return ExpressionError(token.offset, "`)` has no matching `(`")
        if token.text == "[":
            return ExpressionError(token.offset, "`[` stands only in `table(x, [...], [...])`")
        if token.kind in ("name", "number") or token.text == "(":
            hint = "there are no conditional expressions; write `where(condition, a, b)`"
            if token.text in ("if", "else", "for", "lambda", "in", "is"):
                return ExpressionError(token.offset, f"`{token.text}` is not allowed", hint)
            return ExpressionError(token.offset, f"an operator is missing before {short(token.text)}")
        return ExpressionError(token.offset, f"unexpected `{token.text}`")

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
        else:
            raise self.unexpected(token)
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
        terms: list[tuple[str, Tree]] = [("", first)]
        while _LEVELS.get(self.token.text) == level:
            token = self.take()
            right = self.expression(level + 1)
            self.numbers(token, first, right)
            terms.append((_ARITHMETIC[token.text], self.made(right, token.offset)))  # counts the operator
        return _chain(terms)

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

    def unclosed(self, opening: Token) -> None:
        if self.token.kind == "end":
            raise ExpressionError(opening.offset, f"`{opening.text}` is not closed", "close it")
        raise self.unexpected(self.token)

    def name(self, token: Token) -> Tree:
        if token.text in FUNCTIONS:
            hint = f"write `{token.text}(...)`"
            raise ExpressionError(token.offset, f"the function `{token.text}` has no arguments", hint)
        return self.made(Name(token.text), token.offset)

    def call(self, token: Token) -> Tree:
        name = token.text
        if name not in FUNCTIONS:
            hint = _OTHER_CALLS.get(name) or (
                f"did you mean `{_OTHER_NAMES[name]}`?" if name in _OTHER_NAMES else did_you_mean(name, FUNCTIONS)
            )
            raise ExpressionError(token.offset, f"there is no function {short(name)}", hint)
        opening = self.take()
        self.enter(token.offset)
        arguments = self.table(token) if name == "table" else self.arguments(name, opening)
        self.nesting -= 1
        wanted = FUNCTIONS[name]
        if wanted is not None and len(arguments) != wanted:
            hint = "write `atan2(y, x)`" if name == "atan" else ""
            if name in ("min", "max", "hypot") and len(arguments) > 2:
                hint = f"nest them: `{name}(a, {name}(b, c))`"
            text = f"`{name}` takes {wanted} argument{'s' if wanted > 1 else ''}, not {len(arguments)}"
            raise ExpressionError(token.offset, text, hint)
        return self.made(Call(name, tuple(arguments)), token.offset)

    def arguments(self, name: str, opening: Token) -> list[Tree]:
        found: list[Tree] = []
        while not (self.at(")") and not found):
            start = self.token.offset
            found.append(self.wanted(name == "where" and not found, start))
            if self.at(","):
                self.take()
                continue
            if self.at(")"):
                break
            self.unclosed(opening)
        self.take()
        return found

    def table(self, token: Token) -> list[Tree]:
        """x, [x1, ...], [y1, ...]: flat, as Call stores it."""
        found = [self.wanted(False, self.token.offset)]
        lengths: list[int] = []
        for _ in range(2):
            if not self.at(","):
                break
            self.take()
            if not self.at("["):
                raise ExpressionError(self.token.offset, "`table` wants a list here", "write `[0, 1, 2]`")
            opening = self.take()
            before = len(found)
            while True:
                found.append(self.wanted(False, self.token.offset))
                if self.at("]"):
                    break
                if not self.at(","):
                    self.unclosed(opening)
                self.take()
            self.take()
            lengths.append(len(found) - before)
        if len(lengths) != 2 or not self.at(")"):
            hint = "write `table(x, [x1, x2], [y1, y2])`"
            raise ExpressionError(token.offset, "`table` takes a value and two lists", hint)
        self.take()
        if lengths[0] != lengths[1]:
            text = f"the lists of `table` have {lengths[0]} and {lengths[1]} entries"
            raise ExpressionError(token.offset, text, "make them equally long")
        if lengths[0] < 2:
            raise ExpressionError(token.offset, "`table` needs at least two points")
        return found


def _chain(terms: list[tuple[str, Tree]]) -> Tree:
    """a + b - c ...: from the left, as in Python; a long chain as a balanced, shallow tree."""
    if len(terms) <= _CHAIN:
        tree = terms[0][1]
        for op, term in terms[1:]:
            tree = Call(op, (tree, term))
        return tree
    middle = len(terms) // 2
    op = terms[middle][0]
    right = [("", terms[middle][1]), *terms[middle + 1 :]]
    if op in ("sub", "div"):
        right = [right[0], *((_INVERSE[o], term) for o, term in right[1:])]
    return Call(op, (_chain(terms[:middle]), _chain(right)))


def _depth(tree: Tree) -> int:
    depth, level = 0, [tree]
    while level:
        depth += 1
        level = [a for node in level if isinstance(node, Call) for a in node.args]
    return depth
