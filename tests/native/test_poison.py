"""Whatever enters the estimate is guarded, and a function tests what it reads and nothing else.

NaN and infinity in every parameter, input and component, in every function of every form: the status is the
reference's, and after an error the struct is bit for bit what it was. Numbers near the end of the range may be refused
or not, but what is stored is finite.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from calling import Calls, refused
from poison import cases

from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.override import override
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.spec.types import Spec
from kfgen.status import ERROR, Status

BAD = (math.nan, math.inf, -math.inf)
LARGE = {"float": (1e38, 3e38, 1e20, 1e-38), "double": (1e308, 1e200, 1e-308)}
Call = tuple[dict[str, np.ndarray], dict[str, float]]  # arguments, parameters
KINDS = [(kind, "float") for kind in ("kf", "ekf", "ukf", "steady")]
LONG = [("iekf", "float"), ("ekf2", "float"), ("imm", "float"), ("ekf", "double"), ("imm", "double")]
KINDS += [pytest.param(*case, marks=pytest.mark.long) for case in LONG]


def built(kind: str, scalar: str) -> Iterator[tuple[str, Spec, NativeFilter]]:
    """Filters of one's own, as init leaves them."""
    return ((label, spec, kf.copy()) for label, spec, kf in _built(kind, scalar))


@cache
def _built(kind: str, scalar: str) -> list[tuple[str, Spec, NativeFilter]]:
    texts = dict(cases(kind))
    specs = [replace(override(loads(text), scalar), name=f"poison_{i}") for i, text in enumerate(texts.values())]
    filters = load_filters([build(spec) for spec in specs], flags=("-O0",))
    return list(zip(texts, specs, filters, strict=True))


class Subject:
    """A filter some steps on, and its reference in the spec's state."""

    def __init__(self, spec: Spec, kf: NativeFilter) -> None:
        self.kf, self.calls, self.ref = kf, Calls(kf), reference(spec)
        self.steps = ["predict", *self.calls.updates]
        for name in self.steps:
            assert self.calls(name) < ERROR, name
        self.good = kf.copy()
        kind = kf.struct.ffi.typeof(kf.struct.data[0])
        self.places = np.array(list(places(kind, 0)), dtype=int) // np.dtype(kf.struct.value.dtype).itemsize

    def is_finite(self) -> bool:
        """Whether all that is stored is, the caller's parameters apart."""
        numbers = np.frombuffer(bytes(self.kf), dtype=self.kf.struct.value.dtype)
        return bool(np.isfinite(numbers[self.places]).all())

    def is_sound(self, status: int, before: bytes) -> bool:
        """One error and nothing changed, or all that is stored is finite (but for a nis that is beyond a gate)."""
        if status >= ERROR:
            return status in (Status.NOT_FINITE, Status.NOT_POSITIVE) and bytes(self.kf) == before
        return status == Status.GATED or self.is_finite()

    def reset(self, parameters: Mapping[str, float] | None = None) -> bytes:
        struct = self.kf.struct
        struct.ffi.memmove(struct.data, self.good.struct.data, len(bytes(self.good)))
        for name, value in (parameters or {}).items():
            self.kf.parameters[name] = value
        return bytes(self.kf)

    def expected(self, name: str, arguments: Mapping[str, np.ndarray], parameters: Mapping[str, float]) -> int:
        """What the reference says."""
        ref = self.ref
        ref.init()
        for key, value in parameters.items():
            ref.parameters[key] = value
        given: dict[str, Any] = {**self.calls.vectors[name], **arguments}
        given |= {key: float(given[key][0]) for key in ("dt",) if key in given}
        given |= {key: int(given[key][0]) for key in ("mask",) if key in given}
        return ref.predict(**given) if name == "predict" else ref.update(self.calls.updates[name], **given)

    def poisoned(self, name: str, values: tuple[float, ...]) -> Iterator[Call]:
        """Calls with one number of this function's, or one parameter, replaced; under every mask."""
        vectors = self.calls.vectors[name]
        masks: list[dict[str, np.ndarray]] = [{}]
        if "mask" in vectors:
            masks = [{"mask": np.array([mask])} for mask in range(1, int(vectors["mask"][0]) + 1)]
        for mask in masks:
            for value in values:
                yield from ((dict(mask), {parameter: value}) for parameter in self.kf.parameters)
                for key in [key for key in ("u", "z", "dt") if key in vectors]:
                    for i in range(len(vectors[key])):
                        wrong = vectors[key].copy()
                        wrong[i] = value
                        yield {**mask, key: wrong}, {}


def places(kind: Any, offset: int) -> Iterator[int]:
    """Where the reals of a struct's type begin, in bytes, the caller's parameters apart."""
    if kind.kind == "struct":
        for name, field in kind.fields:
            if name != "parameters":
                yield from places(field.type, offset + field.offset)
    elif kind.kind == "array":
        size = {"float": 4, "double": 8}.get(kind.item.cname)
        yield from () if size is None else range(offset, offset + kind.length * size, size)
    elif kind.cname in ("float", "double"):
        yield offset


@pytest.mark.parametrize(("kind", "scalar"), KINDS)
def test_what_is_read_is_tested(kind, scalar):
    wrong = []
    for label, spec, kf in built(kind, scalar):
        it = Subject(spec, kf)
        for name in it.steps:
            for arguments, parameters in it.poisoned(name, BAD):
                before = it.reset(parameters)
                status, expected = it.calls(name, **arguments), it.expected(name, arguments, parameters)
                failed = status >= ERROR
                fine = bytes(kf) == before if failed else it.is_finite()
                if not fine or (max(status, expected) >= ERROR and status != expected):
                    wrong.append(f"{label}: {name} {arguments} {parameters}: {status:#x} for {expected:#x}, {fine}")
    assert not wrong, f"{len(wrong)}\n" + "\n".join(wrong[:20])


@pytest.mark.parametrize(("kind", "scalar"), KINDS)
def test_what_is_stored_is_finite(kind, scalar):
    """Numbers, states and covariances as large as the type holds, or as small."""
    wrong = []
    for label, spec, kf in built(kind, scalar):
        it = Subject(spec, kf)
        large = LARGE[scalar]
        values = (*large, *(-v for v in large), *(v**0.5 for v in large), 100.0, -100.0, 0.0)

        for name in it.steps:
            for arguments, parameters in it.poisoned(name, values):
                before = it.reset(parameters)
                status = it.calls(name, **arguments)
                if not it.is_sound(status, before):
                    wrong.append(f"{label}: {name} {arguments} {parameters}: {status:#x}")
            if not kf.struct.has("set_covariance"):
                continue
            n = len(kf.states)
            for size in large:
                for correlation in (0.0, 0.999):
                    P = np.full((n, n), correlation * size)
                    np.fill_diagonal(P, size)
                    it.reset()
                    if it.calls("set_covariance", P=P.ravel()) < ERROR:
                        before, status = bytes(kf), it.calls(name)
                        if not it.is_sound(status, before):
                            wrong.append(f"{label}: {name} {size} {correlation}: {status:#x}")
    assert not wrong, f"{len(wrong)}\n" + "\n".join(wrong[:20])


@pytest.mark.parametrize("kind", ["ekf", "imm", "steady"])
def test_setters(kind):
    for _, spec, kf in built(kind, "float"):
        calls = Calls(kf)
        n = len(kf.states)
        for name, key in (("set_state", "x"), ("set_covariance", "P")):
            good = calls.vectors.get(name, {}).get(key, np.zeros(0)) if kf.struct.has(name) else np.zeros(0)
            for i in range(len(good)):
                for bad in BAD:
                    wrong = good.copy()
                    wrong[i] = bad
                    if not calls.leaves(name, key, i):
                        refused(calls, Status.NOT_FINITE, name, **{key: wrong})
        if not kf.struct.has("set_sqrt_covariance"):
            continue
        for i, j in zip(*np.tril_indices(n), strict=True):
            for bad in (*BAD, 1e30):  # of which P would be infinite
                S, before = np.eye(n), bytes(kf)
                S[i, j] = bad
                assert kf.set_sqrt_covariance(S) == Status.NOT_FINITE, spec.filter
                assert bytes(kf) == before


def test_first_error():
    """NOT_FINITE before NOT_POSITIVE, whatever is wrong beside."""
    for label, spec, kf in built("ekf", "float"):
        it = Subject(spec, kf)
        for parameters in ({"q": math.nan, "rho": 1e3}, {"sigma": math.nan, "rho": 100.0}):
            for name in it.steps:
                changed = {"dt": np.array([-1.0])} if "dt" in it.calls.vectors[name] else {}
                before = it.reset(parameters)
                status = it.calls(name, **changed)
                assert status == it.expected(name, changed, parameters) or status < ERROR, (label, name)
                assert status < ERROR or bytes(kf) == before


KNOWN = """
kfgen: 1
name: known
states: {x: {init: 0, std: 1}, v: {init: 0, std: 1}}
dynamics: {f: {}}
measurements: {m: {z: {y: {h: 0.3*x + 0.7*v, std: 0}}}}
filter: {type: ukf, adaptive: true, covariance: FORM}
"""


@pytest.mark.parametrize("scalar", ["float", "double"])
def test_what_is_known_exactly_is_skipped(scalar):
    """A second exact measurement that contradicts the first makes no anomaly of rounding."""
    for form in ("full", "ud", "sqrt"):
        (kf,) = load_filters([build(override(loads(KNOWN.replace("FORM", form)), scalar))], flags=("-O0",))
        assert kf.update("m", [1]) < Status.GLITCH_SMALL
        P = kf.P
        assert kf.update("m", [2]) == 0
        assert kf.nis == 0
        assert (kf.P == P).all(), form
