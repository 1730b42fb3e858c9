"""Spec -> symbolic model: f, h, Q, R as SymPy expressions, and their derivatives."""

from kfgen.model.model import Model, build_model

__all__ = ["Model", "build_model"]
