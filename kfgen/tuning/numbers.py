"""The numbers of a spec that can be tuned: where they stand, what they are, and how a new one is written in."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction

from kfgen.errors import KfgenError, Place
from kfgen.spec.constants import environment_of, value
from kfgen.spec.expressions import parse
from kfgen.spec.lexer import ExpressionError, tokenize
from kfgen.spec.parts import expressions
from kfgen.spec.tree import Expression, Tree, names
from kfgen.spec.types import Constant, Parameter, Range, Spec

_NOISE = re.compile(r"(\.(std|var|density|root_density)(\[\d+\])*$)|(\bQ\b)|(\bR\b)|(noise_covariance)")
START = re.compile(r"(^|\.)(states|covariances|P0)\b")
_FIRST = re.compile(r"^initialize\b.*\.var\b")
_OFF_DIAGONAL = re.compile(r"\[(\d+)\]\[(\d+)\]$")
_DIGITS = 6  # of a number that is written


@dataclass(frozen=True)
class Slot:
    """A number that may change.

    path: as it was asked for. place: where it stands. value: in the spec. literal: which of the numbers in its text,
    None for all of it. positive: tuned in its logarithm. limits: between which it stays. noise: whether it is a noise's
    size. twin: place and literal of the entry of a matrix that has to be the same.
    """

    path: str
    place: Place
    value: float
    literal: int | None
    positive: bool
    limits: tuple[float, float]
    noise: bool
    twin: tuple[Place, int | None] | None = None

    @property
    def spots(self) -> list[tuple[Place, int | None]]:
        """Where it is written, and which number of the text it is there."""
        return [(self.place, self.literal), *([] if self.twin is None else [self.twin])]


def plain_path(path: str) -> str:
    """A path as people write it: `Q[0][1]`, and a parameter's `value` left out."""
    path = re.sub(r"\.(\d+)(?=\.|$)", r"[\1]", path)
    return re.sub(r"\.value(?=$|\[)", "", path)


def names_at(spec: Spec, place: Place) -> tuple[str, ...]:
    """The parameters or constants whose value stands at a place: of a vector perhaps several."""
    entries: tuple[Parameter | Constant, ...] = (*spec.parameters, *spec.constants)
    return tuple(each.name for each in entries if each.value.place == place)


def _of_part(spec: Spec, path: str) -> str:
    """The path of a part of a vector that is asked for by its name, `parameters.field.x` or `.field_x`."""
    top, _, rest = path.partition(".")
    if top not in ("parameters", "constants"):
        return path
    entries: Sequence[Parameter | Constant] = spec.parameters if top == "parameters" else spec.constants
    for each in entries:
        if each.name == rest.replace(".", "_") and len(names_at(spec, each.value.place)) == 1:
            return plain_path(each.value.place.path)
    return path


def written(spec: Spec) -> dict[str, Expression]:
    """Path -> the formula that stands there, of all that stand in the file."""
    found = {plain_path(each.place.path): each for each in expressions(spec) if each.place.path and each.place.line}
    # the period of an angle is 2 pi, and a range is for scaling only
    found = {path: each for path, each in found.items() if not path.endswith(".kind") and ".range[" not in path}
    return {path: found[path] for path in sorted(found, key=lambda p: (found[p].place.line, found[p].place.column))}


def slot_of(spec: Spec, asked: str, known: Mapping[str, Expression] | None = None) -> Slot:
    """The number at a path, or at the only path that ends so. KfgenError says why there is none."""
    known = written(spec) if known is None else known
    path = _of_part(spec, plain_path(asked))
    if path not in known:
        ending = [each for each in known if each.endswith(f".{path}")]
        if len(ending) != 1:
            raise KfgenError(_unknown(asked, ending, known))
        path = ending[0]
    expression = known[path]
    top = path.partition(".")[0]
    if top in ("dt", "fixed", "code", "imm") and not path.startswith("imm.modes."):
        raise KfgenError(f"{asked} cannot be tuned: code is generated for the number itself")
    literal = _literal(asked, expression)
    if top in ("parameters", "constants"):
        literal = None  # it is known by its name
    number = _number(spec, expression, literal)
    crossed = _off_diagonal(path)
    noise, limits = _is_noise(spec, path, expression) and not crossed, _range(spec, expression)
    positive = number > 0 and not crossed and (noise or _sized(path) or limits[0] >= 0)
    if noise and number < 0:
        raise KfgenError(f"{asked} is {number:g}: a noise cannot be negative")
    if number == 0 and _sized(path) and not crossed:
        raise KfgenError(f"{asked} is 0, which switches it off: write a number above 0 to start from")
    twin = known.get(_OFF_DIAGONAL.sub(r"[\2][\1]", path)) if crossed else None
    other = None if twin is None else (twin.place, _literal(asked, twin))
    return Slot(asked, expression.place, number, literal, positive, limits, noise, other)


def default_slots(spec: Spec) -> list[Slot]:
    """All noises whose sizes stand in the spec as numbers, not those of the start."""
    known, found = written(spec), []
    for path in known:
        if not (_is_noise(spec, path, known[path]) and not START.search(path) and not _off_diagonal(path)):
            continue
        try:
            slot = slot_of(spec, path, known)
        except KfgenError:  # a formula without a number of its own, a noise that is switched off
            continue
        if slot.value > 0:
            found.append(slot)
    return found


def _unknown(asked: str, ending: list[str], known: Mapping[str, Expression]) -> str:
    if ending:
        return f"--free: `{asked}` may be {', '.join(ending[:6])}; write the whole path"
    close = get_close_matches(asked, known, 1) or [p for p in known if p.rpartition(".")[2] == asked.rpartition(".")[2]]
    hint = f"; did you mean `{close[0]}`?" if close else f" (it has: {', '.join(list(known)[:12])}, ...)"
    return f"--free: the spec has no number at `{asked}`{hint}"


def _literal(asked: str, expression: Expression) -> int | None:
    """Which number of a formula is meant; None for the whole, where it has no names."""
    try:
        tree = parse(expression.text)
        tokens = tokenize(expression.text)
    except ExpressionError:
        raise KfgenError(f"{asked}: `{expression.text}` cannot be tuned; name a number of it as a parameter") from None
    used = [name for name in names(tree) if name not in ("pi", "e")]
    if not used:
        return None
    numbers = [i for i, token in enumerate(tokens) if token.kind == "number"]
    free = [k for k, i in enumerate(numbers) if not (i and tokens[i - 1].text == "**")]
    if len(free) == 1:
        return free[0]
    if not free:
        raise KfgenError(f"{asked}: `{expression.text}` has no number of its own; free what it is made of: "
                         f"{', '.join(dict.fromkeys(used))}")  # fmt: skip
    raise KfgenError(
        f"{asked}: `{expression.text}` has several numbers; give the one that is meant a name, in parameters"
    )


def _number(spec: Spec, expression: Expression, literal: int | None) -> float:
    if literal is None:
        return float(value(parse(expression.text), environment_of(spec)))
    numbers = [token.text for token in tokenize(expression.text) if token.kind == "number"]
    return float(Fraction(numbers[literal]))


def _sized(path: str) -> bool:
    return bool(_NOISE.search(path) or _FIRST.search(path))


def _off_diagonal(path: str) -> bool:
    match = _OFF_DIAGONAL.search(path)
    return match is not None and match.group(1) != match.group(2)


def _is_noise(spec: Spec, path: str, expression: Expression) -> bool:
    """Whether the number is the size of a noise: by its key, or, for a name, by where alone it is used."""
    if path.partition(".")[0] not in ("parameters", "constants"):
        return _runs(path)
    named = set(names_at(spec, expression.place))
    used = [plain_path(each.place.path) for each in expressions(spec) if named & _reach(spec, each.tree)]
    return bool(used) and all(_runs(each) for each in used if each != path)


def _runs(path: str) -> bool:
    """Whether it is the size of what goes on, not of the start."""
    return _sized(path) and not START.search(path) and not _FIRST.search(path)


def _reach(spec: Spec, tree: Tree) -> set[str]:
    """The names in a tree, constants seen through."""
    constants = {constant.name: constant.value.tree for constant in spec.constants}
    found: set[str] = set()
    pending = list(names(tree))
    while pending:
        name = pending.pop()
        if name not in found:
            found.add(name)
            pending += names(constants[name]) if name in constants else ()
    return found


def _range(spec: Spec, expression: Expression) -> tuple[float, float]:
    given: Range | None = next((p.range for p in spec.parameters if p.value.place == expression.place), None)
    if given is None:
        return -math.inf, math.inf
    known = environment_of(spec)
    return float(value(given[0].tree, known)), float(value(given[1].tree, known))
