"""The view of a filter, put together from its tables and functions."""

from __future__ import annotations

from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version

import sympy

from kfgen.emit import fixed_point, header, struct
from kfgen.emit.data import Data, ScalarView, SensorView, View
from kfgen.emit.fixed_point import FixedPoint
from kfgen.emit.functions import FunctionMaker
from kfgen.emit.text import WIDTH, fill, safe
from kfgen.filters.base import FilterCode
from kfgen.ir.names import LIBRARY_NAMES
from kfgen.ir.nodes import Constants, Table
from kfgen.scalars import Scalar


def package_version() -> str:
    try:
        return version("kfgen")
    except PackageNotFoundError:
        return "0"


def make_view(code: FilterCode, scalar: Scalar, overridden: bool, fixed: FixedPoint | None = None) -> View:
    """The view of a filter; overridden: the scalar is not the spec's own."""
    spec = code.model.spec
    name, NAME = spec.name, spec.name.upper()
    labels: list[tuple[Table | Constants, str]] = [*code.tables.items(), *code.lookups.items()]
    tables = {table: f"{name}_{label}" for table, label in labels}
    maker = FunctionMaker(code, scalar, tables, fixed is not None)
    functions = tuple(maker.make(f) for f in code.functions)
    text = "\n".join(line for f in functions for line in f.body)
    calls_math = "wrap" in maker.helpers or any(f"{f}(" in text for f in LIBRARY_NAMES)
    description = [line for part in spec.description.strip().split("\n") for line in fill(safe(part), WIDTH - 4)]
    description = description if any(description) else []
    reference = [*header.reference(code)]
    if fixed is not None:
        reference.append(Data(title="", lines=()))
        reference.append(Data(title="value of raw 1, range reckoned with, and bits above it", lines=fixed.table))
    return View(
        name=name,
        NAME=NAME,
        guard=f"{NAME}_H_INCLUDED",
        command=f"{name}.yaml" + (f" --scalar {scalar.name}" if overridden else ""),
        title=description[0] if description else code.description,
        description=tuple(description[1:]),
        filter=code.description,
        version=package_version(),
        sympy=sympy.__version__,
        sha256=spec.sha256,
        ram=struct.ram(scalar, code.blocks, len(spec.parameters)),
        scalar=ScalarView(
            scalar.name, None if fixed is None else fixed.fraction_bits, scalar.c_type, scalar.helpers,
            scalar.literal(Fraction(0)), scalar.literal(Fraction(1)), scalar.function("ceil"),
        ),
        states=header.indices(NAME, spec.states),
        state_table=tuple(header.state_table(code)),
        reference=tuple(reference),
        cost_table=tuple(header.cost_table(maker.costs)),
        advice=code.notes,
        inputs=header.members(spec.inputs),
        sensors=tuple(
            SensorView(s.name, s.name.upper(), len(s.components), header.members(s.fields)) for s in spec.measurements
        ),
        parameters=header.members(spec.parameters),
        outputs=header.members(spec.outputs),
        modes=struct.modes(name, code.blocks),
        fields=struct.fields(name, code.blocks, bool(spec.parameters)),
        statuses=tuple(header.statuses()),
        functions=functions,
        constants=tuple(header.index_tables(code)),
        tables=tuple(header.number_tables(code, scalar, tables)),
        helpers=tuple(sorted(maker.helpers)),
        units=() if fixed is None else fixed_point.units(fixed),
        routines=None if fixed is None else fixed_point.routines(fixed, maker.helpers),
        uses_math=fixed is None and calls_math,
    )  # fmt: skip
