"""Spec -> symbolic model: f, h, Q, R as SymPy expressions, and their derivatives."""

from kfgen.model.builder import build_model
from kfgen.model.model import Model

__all__ = ["Model", "build_model"]
