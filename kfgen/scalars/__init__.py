"""Scalar types: how a number of the program is spelled in C, and computed in Python to the same bits."""

from __future__ import annotations

from kfgen.scalars.base import Scalar
from kfgen.scalars.floating import DOUBLE, FLOAT

SCALARS: dict[str, Scalar] = {each.name: each for each in (FLOAT, DOUBLE)}

__all__ = ["SCALARS", "Scalar"]
