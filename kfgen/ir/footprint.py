"""Flash and stack that a program will take on a Cortex-M4F, predicted from its statements.

A linear model: every kind of operation has a number of bytes. What the registers cannot hold counts beside the
operations: a value that is made while too many others are still needed goes to the stack and comes back.

The bytes are in `sizes.py`, fitted by `python -m tests.benchmarks.calibrate` to what arm-none-eabi-gcc makes, with the
flags that an emitted header recommends, of all filters of the repository in all their forms.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from kfgen.ir import sizes
from kfgen.ir.nodes import BOOL, INT, Node
from kfgen.ir.program import Assign, Call, Declare, Flag, For, Function, Guard, If, Let, Statement, Store, roots, walk

REGISTERS = 24  # that hold numbers, of 32: the others are needed to compute
LIBRARY = {"float": 40, "double": 96, "q": 40}  # bytes of stack of newlib's functions, of soft double's, of ours
CROWDED = 100  # numbers beyond the registers, from which on the flags were measured to pay
KEPT = 14  # of these, those that outlast a call
_CALLS = {"sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "pow", "floor"}
_BRANCHES = {"wrap", "segment", "table"}
_SELECTIONS = {"min": 1, "max": 1, "sign": 2}
_FREE = {"variable", "counter", "const"}


@dataclass
class Traits:
    """What a function is made of. counts: kind of operation -> how many stand in its text."""

    counts: Counter[str] = field(default_factory=Counter)
    live: int = 0  # the most numbers that are needed later, at any place
    spilled: int = 0  # those that are made where there are more than registers
    reloaded: int = 0  # reads of numbers at such places
    arrays: int = 0  # numbers in local arrays
    kept: int = 0  # the most numbers that outlast a call of a function
    looped: bool = False

    @property
    def kinds(self) -> Counter[str]:
        """The counts by kinds that have a size of their own: in loops compilers do otherwise."""
        return Counter({f"{kind}, looped" if self.looped else kind: n for kind, n in self.counts.items()})


def traits(function: Function) -> Traits:
    """What a function is made of."""
    found = Traits()
    counts = found.counts
    counts["function"] = 1
    counts["argument"] = len(function.arguments)
    constants: set[Node] = set()
    loads: set[Node] = set()
    for statement in walk(function.body):
        found.looped |= isinstance(statement, For)
        _statement(statement, counts)
        if isinstance(statement, Declare) and statement.size is not None:
            found.arrays += statement.size
        for root in roots(statement):
            _expression(root, counts, constants, loads)
    counts["constant"] = len({node.data for node in constants})
    counts["load"] += len(loads)
    _liveness(function.body, found)
    counts["spill"] = found.spilled
    counts["reload"] = found.reloaded
    return found


def _statement(statement: Statement, counts: Counter[str]) -> None:
    match statement:
        case Store():
            counts["store"] += 1
        case Assign(index=index):
            counts["assign" if index is not None else "variable"] += 1
        case Guard(before=before):
            counts["guard"] += 1
            counts["store"] += len(before)
        case Flag():
            counts["flag"] += 1
        case For():
            counts["loop"] += 1
        case If():
            counts["if"] += 1
        case Call(args=args):
            counts["call"] += 1
            counts["argument"] += len(args)


def _expression(root: Node, counts: Counter[str], constants: set[Node], loads: set[Node]) -> None:
    stack = [root]
    while stack:
        node = stack.pop()
        stack += node.args
        op = node.op
        if op == "const":
            if node.kind not in (INT, BOOL):
                constants.add(node)
        elif node.kind == INT:
            counts["index"] += op not in _FREE
        elif op in ("field", "element"):
            if op == "element" and node.args[0].constant is None:
                counts["indexed"] += 1
            else:
                loads.add(node)
        elif op in ("read", "lookup", "slope"):
            counts["indexed"] += bool(node.args)
        elif op == "sum":
            counts["term"] += len(node.data)
            counts["product"] += sum(1 for _, factors in node.data if factors == 2)
        elif op in ("add", "sub", "mul"):
            counts["product" if op == "mul" else "term"] += 1
        elif op in _CALLS:
            counts["library"] += 1
        elif op in _BRANCHES:
            counts["branch"] += 1
        elif op in _SELECTIONS:
            counts["select"] += _SELECTIONS[op]
        elif op == "abs":
            counts["term"] += 1
        elif op in ("lt", "le", "and", "or", "not", "bit", "signs", "some"):
            counts["compare"] += 1
        elif op not in _FREE:
            counts[op] += 1  # div, sqrt, neg, abs, select, finite, ...


def _liveness(body: list[Statement], found: Traits) -> None:
    """How many named numbers are needed later, statement by statement."""
    order = list(walk(body))
    last: dict[str, int] = {}
    calls: list[int] = []
    used: list[set[str]] = []
    for place, statement in enumerate(order):
        names: set[str] = set()
        used.append(names)
        called = isinstance(statement, Call)
        stack = list(roots(statement))
        while stack:
            node = stack.pop()
            if node.op == "variable":
                names.add(node.data)
            called |= node.op in _CALLS
            stack += node.args
        for name in names:
            last[name] = place
        if called:
            calls.append(place)
    ends: Counter[int] = Counter()
    live = 0
    ranges: list[tuple[int, int]] = []
    for place, statement in enumerate(order):
        live -= ends[place]
        if isinstance(statement, Let) and statement.node.kind not in (INT, BOOL) and statement.name in last:
            end = last[statement.name]
            live += 1
            ends[end] += 1
            ranges.append((place, end))
            found.spilled += live > REGISTERS
        found.reloaded += len(used[place]) if live > REGISTERS else 0
        found.live = max(found.live, live)
    for place in calls:
        across = sum(1 for start, end in ranges if start < place < end)
        found.kept = max(found.kept, across)


def crowded(functions: Iterable[Function]) -> bool:
    """Whether so many numbers are needed at once that gcc's schedulers do harm (measured: up to 26 % of the flash)."""
    return sum(traits(function).spilled for function in functions) >= CROWDED


def _bytes(found: Traits, table: Mapping[str, float]) -> float:
    return sum(table.get(kind, table["other"]) * count for kind, count in found.kinds.items())


def predicted(functions: Iterable[Function], scalar: str = "float") -> int:
    """Bytes of code of these functions, together."""
    table = sizes.FLASH[_family(scalar)]
    return round(sum(max(_bytes(traits(function), table), 8.0) for function in functions))


def _family(scalar: str) -> str:
    """The row of a table: all fixed-point types share one."""
    return scalar if scalar in sizes.FLASH else "q"


def predicted_routines(routines: Iterable[str]) -> int:
    """Bytes of the routines of fixed point that a filter's file holds."""
    return round(sum(sizes.ROUTINES.get(routine, 0) for routine in routines))


def stack_traits(found: Traits) -> list[float]:
    """What the stack of a function is proportional to, in the order of `sizes.STACK`'s rows."""
    calls = found.counts["library"] + found.counts["call"]
    beyond = max(0, found.live - REGISTERS)
    return [1, min(found.live, REGISTERS), beyond, min(found.kept, KEPT), calls > 0, found.counts["loop"]]


def predicted_stack(function: Function, scalar: str = "float") -> int:
    """Bytes of stack of a function, with the functions that it calls: the filter's own and the libraries'."""
    found = traits(function)
    family = _family(scalar)
    table = sizes.STACK[family]
    own = sum(size * each for size, each in zip(table.values(), stack_traits(found), strict=True))
    own += sizes.WIDTH[family] * found.arrays
    called = {id(s.callee): s.callee for s in walk(function.body) if isinstance(s, Call)}
    below = [predicted_stack(each, scalar) for each in called.values()]
    if found.counts["library"] or family != "float":
        below.append(LIBRARY[family])
    return round(own + max(below, default=0))
