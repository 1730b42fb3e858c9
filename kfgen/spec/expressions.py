"""The whitelist parser: text of an expression -> tree. Nothing is ever evaluated.

A small operator-precedence parser over ASCII tokens, with Python's precedence: `or`, `and`, `not`,
comparison, `+ -`, `* /`, unary minus, `**` (to the right). What is not in the grammar cannot be said.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

from kfgen.spec.problems import did_you_mean, short
from kfgen.spec.tree import FUNCTIONS, Call, Name, Number, Tree

MAX_LENGTH = 10_000
MAX_NODES = 2_000
MAX_NESTING = 100
MAX_DEPTH = 300  # of a finished tree: later stages recurse over it
MAX_EXPONENT = 64
_MAX_DIGITS = 1_000
_CHAIN = 24  # longer sums and products become balanced trees

_TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<op>\*\*|<=|>=|==|!=|//|[-+*/()\[\],<>])",
    re.ASCII,
)
_COMPARISONS = {"<": "lt", "<=": "le", ">": "gt", ">=": "ge"}
_BINARY = {"+": ("add", 5), "-": ("sub", 5), "*": ("mul", 6), "/": ("div", 6)}
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


class ExpressionError(Exception):
    """What is wrong with the text, at which character, and what to write instead."""

    def __init__(self, offset: int, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.offset, self.message, self.hint = offset, message, hint


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str  # number, name, op, end
    text: str
    offset: int


def parse(text: str, condition: bool = False) -> Tree:
    """The tree of an expression; `condition` where a comparison is asked for instead of a number."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            0, f"the expression is longer than {MAX_LENGTH} characters", "split it with `let`"
        )
    tree = _Parser(_tokens(text)).whole(condition)
    if _depth(tree) > MAX_DEPTH:
        raise ExpressionError(0, "the expression is nested too deeply", "split it with `let`")
    return tree


def is_condition(tree: Tree) -> bool:
    return isinstance(tree, Call) and tree.op in _CONDITIONS


def positions(text: str, name: str) -> list[int]:
    """The offsets of a name in the text of an expression."""
    return [m.start() for m in _TOKEN.finditer(text) if m.lastgroup == "name" and m.group() == name]


# --- tokens


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    i = 0
    while i < len(text):
        if text[i] in " \t\r\n":
            i += 1
            continue
        match = _TOKEN.match(text, i)
        if match is None:
            raise _bad_character(text, i)
        kind, word = str(match.lastgroup), match.group()
        if kind == "number":
            _check_number_end(text, i, match.end())
        elif word in ("==", "!="):
            hint = "compare with a tolerance: `abs(a - b) < 1e-9`"
            raise ExpressionError(i, f"`{word}` is not allowed", hint)
        elif word == "//":
            raise ExpressionError(i, "`//` is not allowed", "write `floor(a/b)`")
        tokens.append(_Token(kind, word, i))
        i = match.end()
    tokens.append(_Token("end", "", len(text)))
    return tokens


def _bad_character(text: str, i: int) -> ExpressionError:
    c = text[i]
    hints = {
        "^": "write `**` for a power", "%": "write `a - b*floor(a/b)`",
        "=": "write `<` or `>`; there is no `==`",
        "&": "write `and`", "|": "write `or`", "!": "write `not`", "~": "write `not`", "×": "write `*`",
        "·": "write `*`", "−": "write `-`", "–": "write `-`", "÷": "write `/`", "²": "write `**2`",
        "π": "write `pi`", "√": "write `sqrt(...)`", "?": "write `where(condition, a, b)`",
        ".": "there are no attributes; write the function's plain name", "{": "use parentheses",
    }  # fmt: skip
    shown = f"`{c}`" if c.isprintable() and not c.isspace() else f"U+{ord(c):04X}"
    hint = hints.get(c, "" if c.isascii() else "expressions are plain ASCII")
    return ExpressionError(i, f"the character {shown} may not stand in an expression", hint)


def _check_number_end(text: str, start: int, end: int) -> None:
    if end >= len(text) or not (text[end].isalnum() or text[end] in "_."):
        return
    tail = re.compile(r"[\w.]*").match(text, start)
    word = tail.group() if tail else text[start : end + 1]
    if re.match(r"0[xXoObB]", word):
        raise ExpressionError(start, f"{short(word)} is not a decimal number", "write it in decimal")
    if "_" in word and re.fullmatch(r"[\d_.eE]+", word):
        hint = f"write {word.replace('_', '')}"
        raise ExpressionError(start, f"the number {short(word)} has underscores", hint)
    if re.fullmatch(r"[\d.]+(?:[eE]\d+)?[jJ]", word):
        raise ExpressionError(start, f"{short(word)} is a complex number", "only real numbers are allowed")
    if text[end] == ".":
        raise ExpressionError(start, f"{short(word)} is not a number")
    if re.match(r"[eE](?:\W|\Z)", text[end:]):
        raise ExpressionError(start, f"{short(word)} has no digits in its exponent")
    if re.fullmatch(r"[\d.]+[kMGmun]", word):
        raise ExpressionError(end, f"{short(word)} has a suffix", "write the power of ten: 1e3")
    hint = f"write `{text[start:end]}*{word[end - start :]}`" if len(word) < 40 else ""
    raise ExpressionError(end, f"an operator is missing in {short(word)}", hint)


def number(text: str, offset: int = 0) -> Number:
    """An exact decimal, bounded to what a double can hold."""
    mantissa, _, exponent = text.lower().partition("e")
    digits = mantissa.replace(".", "").strip("0")
    if len(mantissa) > _MAX_DIGITS or len(exponent) > 12:
        if not digits:
            return Number(Fraction(0))
        raise ExpressionError(offset, f"the number {short(text)} is too long or out of range")
    if not digits:
        return Number(Fraction(0))
    power = int(exponent) if exponent else 0
    leading = len(mantissa.partition(".")[0].lstrip("0")) or (
        len(mantissa.partition(".")[2].lstrip("0")) - len(mantissa.partition(".")[2])
    )
    if not -310 <= power + leading <= 309:
        hint = "use a number between 1e-308 and 1.7e308"
        raise ExpressionError(offset, f"the number {short(text)} is out of range", hint)
    return Number(Fraction(text))


# --- grammar


class _Parser:
    def __init__(self, tokens: list[_Token]) -> None:
        self.tokens = tokens
        self.next = 0
        self.nodes = 0
        self.nesting = 0

    @property
    def token(self) -> _Token:
        return self.tokens[self.next]

    def take(self) -> _Token:
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
        tree = self.disjunction()
        if condition and not is_condition(tree):
            raise ExpressionError(start, "a condition is wanted here", "write a comparison: `a > b`")
        if not condition and is_condition(tree):
            hint = "write `where(condition, a, b)`"
            raise ExpressionError(start, "a condition is not a number", hint)
        return tree

    def unexpected(self, token: _Token) -> ExpressionError:
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

    # conditions

    def logic(self, left: Tree, op: str, right: Tree, offset: int) -> Tree:
        if not is_condition(left) or not is_condition(right):
            hint = "write a comparison on both sides"
            raise ExpressionError(offset, f"`{op}` joins conditions, not numbers", hint)
        return self.made(Call(op, (left, right)), offset)

    def disjunction(self) -> Tree:
        tree = self.conjunction()
        while self.at("or"):
            offset = self.take().offset
            tree = self.logic(tree, "or", self.conjunction(), offset)
        return tree

    def conjunction(self) -> Tree:
        tree = self.negation()
        while self.at("and"):
            offset = self.take().offset
            tree = self.logic(tree, "and", self.negation(), offset)
        return tree

    def negation(self) -> Tree:
        if not self.at("not"):
            return self.comparison()
        offset = self.take().offset
        self.enter(offset)
        tree = self.negation()
        self.nesting -= 1
        if not is_condition(tree):
            raise ExpressionError(offset, "`not` wants a condition", "write `not (a > b)`")
        return self.made(Call("not", (tree,)), offset)

    def comparison(self) -> Tree:
        left = self.sum(5)
        if not self.at(*_COMPARISONS):
            return left
        token = self.take()
        right = self.sum(5)
        if is_condition(left) or is_condition(right):
            raise ExpressionError(token.offset, f"`{token.text}` compares numbers, not conditions")
        if self.at(*_COMPARISONS):
            hint = "write `a < b and b < c`"
            raise ExpressionError(self.token.offset, "comparisons cannot be chained", hint)
        return self.made(Call(_COMPARISONS[token.text], (left, right)), token.offset)

    # arithmetic

    def arithmetic(self, op: str, *operands: Tree, offset: int) -> None:
        if any(is_condition(operand) for operand in operands):
            hint = "write `where(condition, a, b)`"
            raise ExpressionError(offset, f"`{op}` wants numbers, not conditions", hint)

    def sum(self, level: int) -> Tree:
        """A chain of `+ -` (level 5) or of `* /` (level 6)."""
        terms: list[tuple[str, Tree]] = [("", self.sum(6) if level == 5 else self.unary())]
        while self.token.kind == "op" and _BINARY.get(self.token.text, ("", 0))[1] == level:
            token = self.take()
            right = self.sum(6) if level == 5 else self.unary()
            self.arithmetic(token.text, terms[0][1], right, offset=token.offset)
            self.made(right, token.offset)  # counts the operator
            terms.append((_BINARY[token.text][0], right))
        return _chain(terms)

    def unary(self) -> Tree:
        if not self.at("-", "+"):
            return self.power()
        token = self.take()
        self.enter(token.offset)
        operand = self.unary()
        self.nesting -= 1
        self.arithmetic(token.text, operand, offset=token.offset)
        return operand if token.text == "+" else self.made(Call("neg", (operand,)), token.offset)

    def power(self) -> Tree:
        base = self.atom()
        if not self.at("**"):
            return base
        offset = self.take().offset
        self.enter(offset)
        start = self.token.offset
        exponent = self.unary()
        self.nesting -= 1
        self.arithmetic("**", base, exponent, offset=offset)
        literal = exponent.args[0] if isinstance(exponent, Call) and exponent.op == "neg" else exponent
        if isinstance(literal, Number) and literal.value.denominator == 1 and literal.value > MAX_EXPONENT:
            raise ExpressionError(start, f"an integer exponent may be at most {MAX_EXPONENT} in size")
        return self.made(Call("pow", (base, exponent)), offset)

    def atom(self) -> Tree:
        token = self.take()
        if token.kind == "number":
            return self.made(number(token.text, token.offset), token.offset)
        if token.text == "(":
            self.enter(token.offset)
            tree = self.disjunction()
            if not self.at(")"):
                if self.token.kind == "end":
                    raise ExpressionError(token.offset, "`(` is not closed", "add `)`")
                raise self.unexpected(self.token)
            self.take()
            self.nesting -= 1
            return tree
        if token.kind == "name" and token.text not in ("and", "or", "not"):
            return self.call(token) if self.at("(") else self.name(token)
        raise self.unexpected(token)

    def name(self, token: _Token) -> Tree:
        if token.text in FUNCTIONS:
            hint = f"write `{token.text}(...)`"
            raise ExpressionError(token.offset, f"the function `{token.text}` has no arguments", hint)
        return self.made(Name(token.text), token.offset)

    def call(self, token: _Token) -> Tree:
        name = token.text
        if name not in FUNCTIONS:
            hint = _OTHER_CALLS.get(name) or (
                f"did you mean `{_OTHER_NAMES[name]}`?"
                if name in _OTHER_NAMES
                else did_you_mean(name, FUNCTIONS)
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

    def arguments(self, name: str, opening: _Token) -> list[Tree]:
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

    def unclosed(self, opening: _Token) -> None:
        if self.token.kind == "end":
            raise ExpressionError(opening.offset, f"`{opening.text}` is not closed", "close it")
        raise self.unexpected(self.token)

    def table(self, token: _Token) -> list[Tree]:
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
