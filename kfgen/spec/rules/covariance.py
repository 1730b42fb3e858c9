"""Variances and covariance matrices: sign, size, symmetry, positive semidefinite where they are constant."""

from __future__ import annotations

import random
from fractions import Fraction

from kfgen.errors import Place
from kfgen.spec.contexts import Context
from kfgen.spec.matrices import close, is_semidefinite, smallest_eigenvalue, worst_pair
from kfgen.spec.operations import Value, apply
from kfgen.spec.problems import short
from kfgen.spec.raw import BAD, key_of
from kfgen.spec.rules.facts import Facts, Model, show
from kfgen.spec.tree import Call, Expression, Number
from kfgen.spec.types import Matrix, Noise

Known = dict[str, Value]


def check(facts: Facts) -> None:
    for model in facts.models():
        _initial(facts, model)
        _process(facts, model)
        for sensor in model.measurements:
            known = facts.known(model.context)
            path = sensor.place.path
            names = list(sensor.errors)
            variances = [component.variance for component in sensor.components]
            for variance in [*variances, *(v for r in sensor.rotations for v in r.variances)]:
                _variance(facts, variance, known)
            if sensor.R is not None:
                of = "coordinate of the residual" if sensor.rotations else "component"
                _matrix(facts, sensor.R, names, of, f"{path}.R", model.context, known)
            _noises(facts, sensor.noise, sensor.noise_covariance, f"{path}.noise_covariance", model.context)


def _coordinate(model: Model) -> str:
    """What P has one row for; a quaternion has three of the error."""
    return "error coordinate" if model.rotations else "state"


def _variance(facts: Facts, expression: Expression | None, known: Known) -> Value | None:
    """Its value where it is constant and not negative."""
    if expression is None or expression.tree == BAD:
        return None
    tree = expression.tree
    rooted = key_of(expression.place.path) in ("std", "root_density")
    if rooted and isinstance(tree, Call) and tree.op == "pow" and tree.args[1] == Number(Fraction(2)):
        root = facts.tree(tree.args[0], known)
        if root is not None and root < 0:
            text = f"the standard deviation {show(root)} is negative"
            facts.add(expression.place, text, f"write {show(-root)}, or 0 where it is exact")
            return None
        return facts.tree(tree, known)
    number = facts.tree(tree, known)
    if number is not None and number < 0:
        text = f"the variance {show(number)} is negative"
        facts.add(expression.place, text, "write a variance of at least 0, or `std`")
        return None
    return number


def _initial(facts: Facts, model: Model) -> None:
    names = list(model.errors)
    known = facts.folded
    if model.P0 is not None:
        path = f"{model.prefix}P0" if facts.written(f"{model.prefix}P0") else "P0"
        _matrix(facts, model.P0, names, _coordinate(model), path, model.context, known)
        return
    variances = {name: _variance(facts, variance, known) for name, variance in model.variances.items()}
    seen: dict[frozenset[str], Place] = {}
    entries: dict[tuple[str, str], Value] = {}
    complete = all(v is not None for v in variances.values())
    for covariance in model.covariances:
        place = covariance.value.place
        pair = frozenset((covariance.first, covariance.second))
        if not pair <= variances.keys():
            complete = False
            continue
        if len(pair) == 1:
            facts.add(place, f"this is the variance of {short(covariance.first)}", "write it as `var` of the state")
            complete = False
        elif pair in seen:
            text = f"the covariance of {short(covariance.first)} and {short(covariance.second)} stands twice"
            facts.add(place, text, f"remove one of them (the first is in line {seen[pair].line})")
            complete = False
        seen[pair] = place
        number = facts.value(covariance.value, known)
        complete = complete and number is not None
        entries[covariance.first, covariance.second] = entries[covariance.second, covariance.first] = number
    if not complete or not entries:
        return
    rows = [[variances[a] if a == b else entries.get((a, b), Fraction(0)) for b in names] for a in names]
    first = model.covariances[0].value.place
    place = facts.at(f"{model.prefix}covariances", "covariances", otherwise=first)
    hint = "make the covariances smaller: |c| <= std1*std2"
    _semidefinite(facts, rows, names, place, "the initial covariance", hint)


def _process(facts: Facts, model: Model) -> None:
    known = facts.known(model.context)
    Q = model.dynamics.Q
    if isinstance(Q, tuple):
        names = list(model.errors)
        _matrix(facts, Q, names, _coordinate(model), f"{model.dynamics.place.path}.Q", model.context, known)
    else:
        for expression in Q.values():
            _variance(facts, expression, known)
    own = f"{model.prefix}noise_covariance"
    path = own if facts.written(own) else "noise_covariance"
    _noises(facts, model.noise, model.noise_covariance, path, model.context)


def _noises(facts: Facts, noises: tuple[Noise, ...], matrix: Matrix | None, path: str, context: Context) -> None:
    known = facts.known(context)
    for noise in noises:
        _variance(facts, noise.variance, known)
    if matrix is None:
        return
    if not noises:
        if not facts.written(path.removesuffix("_covariance")):
            facts.add(facts.at(path), "`noise_covariance` is given, but there is no `noise`", "name the noises")
        return
    _matrix(facts, matrix, [noise.name for noise in noises], "noise", path, context, known)


def _matrix(facts: Facts, matrix: Matrix, names: list[str], of: str, path: str, context: Context, known: Known) -> None:
    """A full covariance: square, of the right size, symmetric, positive semidefinite where it is constant."""
    size = len(names)
    key = path.rpartition(".")[2]
    place = facts.at(path, otherwise=matrix[0][0].place if matrix and matrix[0] else None)
    if not names:
        return
    for i, row in enumerate(matrix):
        if len(row) != len(matrix[0]):
            at = facts.walker.value_place(f"{path}[{i}]", place)
            text = f"row {i + 1} has {len(row)} entries, row 1 has {len(matrix[0])}"
            facts.add(at, text, f"write {size} rows of {size} numbers")
            return
    if len(matrix) != size or len(matrix[0]) != size:
        head, _, tail = of.partition(" of ")
        plural = of if size == 1 else f"{head}s of {tail}" if tail else f"{head}s"
        text = f"`{key}` is {len(matrix)} x {len(matrix[0]) if matrix else 0}, but there are {size} {plural}"
        facts.add(place, text, f"write {size} rows of {size} numbers, in the order {', '.join(names[:8])}")
        return
    if any(entry.tree == BAD for row in matrix for entry in row):
        return
    values = [[facts.value(entry, known) for entry in row] for row in matrix]
    if not _symmetric(facts, matrix, values, context, known):
        return
    if all(number is not None for row in values for number in row):
        _semidefinite(facts, values, names, place, f"`{key}`", "a covariance has no negative eigenvalue")
        return
    for i in range(size):
        variance = values[i][i]
        if variance is not None and variance < 0:
            facts.add(matrix[i][i].place, f"the variance {show(variance)} is negative", "write a variance >= 0")


def _symmetric(facts: Facts, matrix: Matrix, values: list[list[Value]], context: Context, known: Known) -> bool:
    for i, row in enumerate(matrix):
        for j in range(i):
            a, b = values[i][j], values[j][i]
            if row[j].tree == matrix[j][i].tree:
                continue
            if a is None or b is None:
                a, b = _probe(facts, (row[j], matrix[j][i]), context, known)
                if a is None or b is None:
                    continue
            if not close(a, b):
                first, second = short(matrix[j][i].text), short(row[j].text)
                where = f"row {j + 1}, column {i + 1}"
                text = f"the matrix is not symmetric: {where} has {first}, here stands {second}"
                facts.add(row[j].place, text, "write the same in both")
                return False
    return True


def _probe(facts: Facts, pair: tuple[Expression, Expression], context: Context, known: Known) -> list[Value | None]:
    """The values of two formulas at a random point: equal formulas may be written differently."""
    draw = random.Random(1)
    point: Known = dict(known)
    for name in sorted(context.uses(pair[0]) | context.uses(pair[1])):
        point.setdefault(name, Fraction(draw.randint(100, 900), 997))
    for definition in context.let:
        if definition.name not in point and (number := facts.tree(definition.value.tree, point)) is not None:
            point[definition.name] = number
    return [facts.tree(entry.tree, point) for entry in pair]


def _semidefinite(
    facts: Facts, rows: list[list[Value]], names: list[str], place: Place, what: str, hint: str
) -> None:
    if is_semidefinite(rows):
        return
    smallest = smallest_eigenvalue(rows)
    text = f"{what} is not positive semidefinite"
    text += f": its smallest eigenvalue is {show(smallest)}" if smallest is not None else ""
    pair = worst_pair(rows)
    if pair is not None:
        i, j = pair
        limit = apply("sqrt", [apply("mul", [rows[i][i], rows[j][j]])])
        text += f"; the covariance of {short(names[i])} and {short(names[j])} is {show(rows[i][j])}"
        hint = f"it may be at most {show(limit)} in size, the root of their variances' product"
    facts.add(place, text, hint)
