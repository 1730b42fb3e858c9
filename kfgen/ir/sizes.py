"""Bytes on a Cortex-M4F, by scalar and kind; written by `python -m tests.benchmarks.calibrate`."""

from __future__ import annotations

from collections.abc import Mapping

FLASH: Mapping[str, Mapping[str, float]] = {
    "float": {
        "abs": 48.66,
        "argument": 4.73,
        "assign": 5.91,
        "branch": 119.94,
        "call": 0.0,
        "compare": 0.0,
        "constant": 6.84,
        "div": 0.0,
        "finite": 18.44,
        "flag": 34.01,
        "function": 0.0,
        "guard": 0.0,
        "if": 66.33,
        "index": 3.59,
        "indexed": 2.71,
        "library": 8.05,
        "load": 3.9,
        "loop": 11.44,
        "neg": 0.0,
        "product": 4.38,
        "reload": 0.07,
        "select": 16.94,
        "spill": 0.0,
        "sqrt": 0.0,
        "store": 2.66,
        "term": 2.16,
        "variable": 3.37,
        "other": 8.0,
    },
    "double": {
        "abs": 0.0,
        "argument": 0.0,
        "assign": 0.0,
        "branch": 166.96,
        "call": 0.0,
        "compare": 0.0,
        "constant": 10.22,
        "div": 4.34,
        "finite": 26.13,
        "flag": 22.33,
        "function": 11.91,
        "guard": 5.26,
        "if": 2.0,
        "index": 4.02,
        "indexed": 6.96,
        "library": 47.96,
        "load": 0.0,
        "loop": 9.06,
        "neg": 0.0,
        "product": 15.79,
        "reload": 0.0,
        "select": 35.17,
        "spill": 0.0,
        "sqrt": 0.0,
        "store": 4.53,
        "term": 8.44,
        "variable": 19.4,
        "other": 8.0,
    },
}

STACK: Mapping[str, Mapping[str, float]] = {
    "float": {
        "base": 0.0,
        "live": 1.63,
        "beyond": 3.51,
        "kept": 0.4,
        "calls": 15.62,
        "loop": 10.91,
    },
    "double": {
        "base": 10.54,
        "live": 7.59,
        "beyond": 9.49,
        "kept": 5.53,
        "calls": 0.0,
        "loop": 10.22,
    },
}

WIDTH: Mapping[str, int] = {"float": 4, "double": 8}
