"""Checked raw data -> the frozen dataclasses of `types.py`, with the documented defaults filled in.

What is wrong beyond a single key (both std and var, a missing variance) is said here, where the keys are
at hand; what needs values or names is said by the rules, on the finished spec.
"""

from kfgen.spec.builders.spec import Builder

__all__ = ["Builder"]
