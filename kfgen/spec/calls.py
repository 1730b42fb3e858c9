"""What stands in parentheses and brackets in an expression: calls, tables, lists, indices; and the limits of all."""

from __future__ import annotations

from kfgen.spec.lexer import ExpressionError, Token, number
from kfgen.spec.problems import did_you_mean, short
from kfgen.spec.tree import FUNCTIONS, VECTOR_FUNCTIONS, Call, Name, Tree

MAX_NODES = 2_000
MAX_NESTING = 100

_OTHER_NAMES = {
    "ln": "log", "arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2", "fabs": "abs",
    "sgn": "sign", "fmin": "min", "fmax": "max", "if": "where", "select": "where", "interp": "table",
}  # fmt: skip
_OTHER_CALLS = {
    "pow": "write `a**b`", "square": "write `a**2`", "sq": "write `a**2`", "log10": "write `log(a)/log(10)`",
    "log2": "write `log(a)/log(2)`", "cbrt": "write `a**(1/3)`", "exp2": "write `2**a`",
    "ceil": "write `-floor(-a)`", "radians": "write `a*pi/180`", "degrees": "write `a*180/pi`",
}  # fmt: skip


class Calls:
    """The tokens of an expression, and all that stands in parentheses and brackets; the operators are a subclass's."""

    def __init__(self, tokens: list[Token], free: bool = False) -> None:
        """free: names that are those of functions are names where no `(` follows."""
        self.tokens = tokens
        self.free = free
        self.next = 0
        self.nodes = 0
        self.nesting = 0
        self.offsets: dict[int, int] = {}  # id of a node -> where it stands; the nodes live in the tree

    def wanted(self, condition: bool, start: int) -> Tree:
        raise NotImplementedError

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
        self.offsets[id(tree)] = offset
        if self.nodes > MAX_NODES:
            hint = "split it with `let`"
            raise ExpressionError(offset, f"the expression has more than {MAX_NODES} nodes", hint)
        return tree

    def enter(self, offset: int) -> None:
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            hint = "split it with `let`"
            raise ExpressionError(offset, f"the expression is nested deeper than {MAX_NESTING}", hint)

    def unexpected(self, token: Token) -> ExpressionError:
        if token.kind == "end":
            return ExpressionError(token.offset, "the expression ends too early")
        if token.text == ")":
            return ExpressionError(token.offset, "`)` has no matching `(`")
        if token.text == "]":
            return ExpressionError(token.offset, "`]` has no matching `[`")
        if token.kind in ("name", "number") or token.text == "(":
            hint = "there are no conditional expressions; write `where(condition, a, b)`"
            if token.text in ("if", "else", "for", "lambda", "in", "is"):
                return ExpressionError(token.offset, f"`{token.text}` is not allowed", hint)
            return ExpressionError(token.offset, f"an operator is missing before {short(token.text)}")
        return ExpressionError(token.offset, f"unexpected `{token.text}`")

    def unclosed(self, opening: Token) -> None:
        if self.token.kind == "end":
            raise ExpressionError(opening.offset, f"`{opening.text}` is not closed", "close it")
        raise self.unexpected(self.token)

    def name(self, token: Token) -> Tree:
        if token.text in FUNCTIONS and not self.free:
            hint = f"write `{token.text}(...)`"
            raise ExpressionError(token.offset, f"the function `{token.text}` has no arguments", hint)
        return self.made(Name(token.text), token.offset)

    def call(self, token: Token) -> Tree:
        name = token.text
        if name not in FUNCTIONS and name not in VECTOR_FUNCTIONS:
            known = [*FUNCTIONS, *VECTOR_FUNCTIONS]
            hint = _OTHER_CALLS.get(name) or (
                f"did you mean `{_OTHER_NAMES[name]}`?" if name in _OTHER_NAMES else did_you_mean(name, known)
            )
            raise ExpressionError(token.offset, f"there is no function {short(name)}", hint)
        opening = self.take()
        self.enter(token.offset)
        arguments = self.table(token) if name == "table" else self.arguments(name, opening)
        self.nesting -= 1
        wanted = FUNCTIONS[name] if name in FUNCTIONS else VECTOR_FUNCTIONS[name]
        if wanted is not None and len(arguments) != wanted:
            hint = "write `atan2(y, x)`" if name == "atan" else ""
            if name in ("min", "max", "hypot") and len(arguments) > 2:
                hint = f"nest them: `{name}(a, {name}(b, c))`"
            text = f"`{name}` takes {wanted} argument{'s' if wanted > 1 else ''}, not {len(arguments)}"
            raise ExpressionError(token.offset, text, hint)
        return self.made(Call(name, tuple(arguments)), token.offset)

    def listed(self, opening: Token) -> Tree:
        """[a, b, c]: a vector; of lists a matrix."""
        self.enter(opening.offset)
        if self.at("]"):
            raise ExpressionError(opening.offset, "the list is empty", "write a list of numbers: `[0, 0, 1]`")
        found = self.entries(opening)
        self.nesting -= 1
        return self.made(Call("list", tuple(found)), opening.offset)

    def entries(self, opening: Token) -> list[Tree]:
        """What stands between a bracket that is taken and the one that closes it."""
        found: list[Tree] = []
        while True:
            found.append(self.wanted(False, self.token.offset))
            if self.at("]"):
                break
            if not self.at(","):
                self.unclosed(opening)
            self.take()
        self.take()
        return found

    def parts(self, tree: Tree) -> Tree:
        """What follows an operand: `.x`, `[0]`, `[0, 1]`."""
        while self.at(".", "["):
            token = self.take()
            if token.text == ".":
                part = self.take()
                tree = self.made(Call(f"part.{part.text}", (tree,)), token.offset)
                continue
            indices = [self.index()]
            while self.at(",") and len(indices) < 2:
                self.take()
                indices.append(self.index())
            if not self.at("]"):
                self.unclosed(token)
            self.take()
            tree = self.made(Call("index", (tree, *indices)), token.offset)
        return tree

    def index(self) -> Tree:
        token = self.take()
        if token.kind != "number" or not token.text.isdigit():
            raise ExpressionError(token.offset, "an index is a whole number from 0", "write `v[0]`, `M[0, 1]`")
        return number(token.text, token.offset)

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
            entries = self.entries(self.take())
            found += entries
            lengths.append(len(entries))
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
