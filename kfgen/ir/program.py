"""Statements and functions: the straight-line (and looped) program that is printed, run and counted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from kfgen.ir.nodes import Node


@dataclass(slots=True)
class Section:
    """A comment that heads the statements after it."""

    text: str


@dataclass(slots=True)
class Let:
    """A constant local: name = node. point: of fixed point, the value of its raw 1 is 2^point."""

    node: Node
    name: str
    point: int | None = None


@dataclass(slots=True)
class Declare:
    """A local array of reals, or (size None) a variable with its first value. point: as that of a Let."""

    name: str
    size: int | None
    value: Node | None = None
    kind: str = "real"
    point: int | None = None


@dataclass(slots=True)
class Assign:
    """array[index] = node, or name = node where index is None."""

    name: str
    index: Node | None
    node: Node


@dataclass(slots=True)
class Store:
    """A field of the filter: kf->name[index] = node (index None: kf->name)."""

    name: str
    index: Node | None
    node: Node


@dataclass(slots=True)
class Guard:
    """Where the condition holds the function ends with this status and nothing has been changed.

    before: stores that are made all the same (nis of a gated update). Status is a list of flag names.
    """

    condition: Node
    status: str
    before: list[Store] = field(default_factory=list)
    why: str = ""


@dataclass(slots=True)
class Flag:
    """Where the condition holds a warning is added to the status that the function returns."""

    condition: Node
    flag: str


@dataclass(slots=True)
class For:
    """for (variable = start; variable < stop; variable++), or downwards from stop - 1 to start."""

    variable: str
    start: Node
    stop: Node
    body: list[Statement]
    down: bool = False


@dataclass(slots=True)
class If:
    """Runs the body where the condition holds; for actions, never for values. rare: all but never."""

    condition: Node
    body: list[Statement]
    rare: bool = False


@dataclass(slots=True)
class Slice:
    """A part of an array, from offset on, handed to a function."""

    array: str
    offset: Node


@dataclass(slots=True)
class Call:
    """A private function of the filter is run. args: `kf` and `u` by name, parts of arrays, numbers.

    The flags of one that returns a status are added to those of the caller.
    """

    callee: Function
    args: list[str | Slice | Node]


Statement = Call | Section | Let | Declare | Assign | Store | Guard | Flag | For | If


@dataclass(slots=True)
class Argument:
    """An argument of a function: a struct or array behind a pointer, or a number."""

    name: str
    type: str
    pointer: bool
    constant: bool = True
    doc: str = ""
    size: int | None = None  # arrays: type name[size]


@dataclass(slots=True)
class Function:
    """An emitted function: its body is scheduled (every shared value has its Let)."""

    name: str
    arguments: list[Argument]
    body: list[Statement]
    doc: str
    returns: str = "status"  # status | void
    private: bool = False  # static in the C, called by others
    notes: list[str] = field(default_factory=list)


def roots(statement: Statement) -> list[Node]:
    """The nodes that a statement itself evaluates (not those of its body)."""
    match statement:
        case Let(node=node):
            return [node]
        case Assign(index=index, node=node) | Store(index=index, node=node):
            return [node] if index is None else [index, node]
        case Declare(value=value):
            return [] if value is None else [value]
        case Guard(condition=condition, before=before):
            return [condition] + [n for store in before for n in roots(store)]
        case Flag(condition=condition) | If(condition=condition):
            return [condition]
        case For(start=start, stop=stop):
            return [start, stop]
        case Call(args=args):
            slices = [a.offset for a in args if isinstance(a, Slice)]
            return slices + [a for a in args if isinstance(a, Node)]
        case Section():
            return []


def mapped(statement: Statement, new: Callable[[Node], Node]) -> Statement:
    """The statement with `new` of each node that it itself evaluates."""
    match statement:
        case Let(node=node, name=name, point=point):
            return Let(new(node), name, point)
        case Store(name=name, index=index, node=node):
            return Store(name, None if index is None else new(index), new(node))
        case Assign(name=name, index=index, node=node):
            return Assign(name, None if index is None else new(index), new(node))
        case Declare(value=value):
            return replace(statement, value=None if value is None else new(value))
        case Guard(condition=condition, before=before):
            stores = [replace(store, node=new(store.node)) for store in before]
            return replace(statement, condition=new(condition), before=stores)
        case Flag(condition=condition) | If(condition=condition):
            return replace(statement, condition=new(condition))
        case For(start=start, stop=stop):
            return replace(statement, start=new(start), stop=new(stop))
        case Call(args=args):
            given = [
                replace(a, offset=new(a.offset)) if isinstance(a, Slice) else new(a) if isinstance(a, Node) else a
                for a in args
            ]
            return replace(statement, args=given)
        case Section():
            return statement


def flags_of(body: list[Statement]) -> set[str]:
    """The warnings that statements may raise, and the functions that they call."""
    out: set[str] = set()
    for statement in walk(body):
        if isinstance(statement, Flag):
            out.add(statement.flag)
        elif isinstance(statement, Call) and statement.callee.returns == "status":
            out |= flags_of(statement.callee.body)
    return out


def walk(body: list[Statement]) -> Iterator[Statement]:
    """Every statement, those inside loops included."""
    for statement in body:
        yield statement
        if isinstance(statement, For | If):
            yield from walk(statement.body)
