"""The oracle: dense textbook filters in numpy float64, built from a spec's expression trees.

It shares nothing with the generator but the spec: derivatives are its own (forward-mode automatic
differentiation), and so is every formula.
"""

from kfgen.reference.build import reference
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.imm import ReferenceImm
from kfgen.reference.log import Run
from kfgen.reference.status import Status

__all__ = ["ReferenceFilter", "ReferenceImm", "Run", "Status", "reference"]
