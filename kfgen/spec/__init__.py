"""Reading a spec: `load` and `loads` return a `Spec` or raise a SpecError that lists every mistake."""

from __future__ import annotations

from kfgen.scalar_names import DOUBLE, FLOAT
from kfgen.spec.loading import load, loads, warnings, with_scalar
from kfgen.spec.tree import Call, Expression, Name, Number, Tree
from kfgen.spec.types import (
    Adaptive,
    Code,
    Component,
    Constant,
    Covariance,
    Definition,
    Dynamics,
    Filter,
    Fixed,
    Gate,
    Group,
    Imm,
    Initialize,
    Input,
    Matrix,
    Mode,
    Noise,
    Output,
    Parameter,
    Range,
    Robust,
    Rotation,
    Sensor,
    SigmaPoints,
    Spec,
    State,
    Step,
)

__all__ = [
    "DOUBLE", "FLOAT", "Adaptive", "Call", "Code", "Component", "Constant", "Covariance", "Definition", "Dynamics",
    "Expression", "Filter", "Fixed", "Gate", "Group", "Imm", "Initialize", "Input", "Matrix", "Mode", "Name", "Noise",
    "Number", "Output", "Parameter", "Range", "Robust", "Rotation", "Sensor", "SigmaPoints", "Spec", "State", "Step",
    "Tree", "load", "loads", "warnings", "with_scalar",
]  # fmt: skip
