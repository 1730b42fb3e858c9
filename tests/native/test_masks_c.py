"""Masked updates in the emitted C: what they leave out does not exist, and may hold anything.

That a masked update is the update of a smaller sensor is the reference's to say; see test_options_c.
"""

from __future__ import annotations

import itertools
import math
import re
from functools import cache

import numpy as np
import pytest
from calling import Calls
from scipy.stats import chi2
from variants import FORMS, TURN, built, spec_with

from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.status import ERROR, Status

OPTIONS = ["type: ekf", "type: iekf", "type: ekf2, robust: huber, adapt_R: 0.05, adapt_Q: 0.02"]
INITIALIZED = re.sub(r" +gate: .*\n", "", TURN).replace(
    "dynamics:", "initialize: {from: fix, states: {x: px, y: area}}\ndynamics:"
)


@cache
def _filters(text: str) -> dict[tuple[str, str], NativeFilter]:
    keys = [(form, OPTIONS[0]) for form in FORMS]
    keys += [("full-joseph", OPTIONS[1]), ("ud-bierman", OPTIONS[2]), ("sqrt", OPTIONS[2])]
    keys = keys if text == TURN else keys[2:5:2]
    return built({key: spec_with(text, key[1], key[0]) for key in keys})


def filters(text: str = TURN) -> dict[tuple[str, str], NativeFilter]:
    found = {key: kf.copy() for key, kf in _filters(text).items()}
    for kf in found.values():
        kf.init()
    return found


def started(text: str = TURN) -> dict[tuple[str, str], NativeFilter]:
    found = filters(text)
    for kf in found.values():
        kf.predict([0.1])
        assert kf.update("fix", [4.1, 3.6, 1.6]) < ERROR
        kf.predict([0.1])
    return found


def test_an_empty_mask_does_nothing():
    nothing = np.full(3, math.nan)
    for key, kf in started().items():
        before, calls = bytes(kf), Calls(kf)
        for mask in (0, 0b1000, 0xFFFFFFF8):
            assert calls("update_fix_masked", z=nothing, mask=np.array([mask])) == 0, key
            assert bytes(kf) == before, key
        assert kf.update("fix", nothing, mask=[False] * 3) == 0


def test_a_full_mask_is_the_plain_update():
    random = np.random.default_rng(3)
    for key, kf in filters().items():
        other = kf.copy()
        for _ in range(6):
            z = random.normal([4, 3.5, 1.5], 0.7)
            for each in (kf, other):
                each.predict([0.1])
            assert kf.update("fix", z, mask=0b111) == other.update("fix", z)
            sigma = np.sqrt(other.P.diagonal())
            assert np.max(np.abs(kf.x - other.x) / sigma) < 1e-12, key
            assert np.max(np.abs(kf.P - other.P) / np.outer(sigma, sigma)) < 1e-12, key
            assert kf.nis == pytest.approx(other.nis, rel=1e-11)
            assert kf.log_likelihood == pytest.approx(other.log_likelihood, rel=1e-11)
            if "adapt" in key[1]:
                np.testing.assert_allclose(kf.R["fix"], other.R["fix"], rtol=1e-12)
                np.testing.assert_allclose(kf.Q, other.Q, rtol=1e-11, atol=1e-14)


def test_bits_beyond_the_components_are_ignored():
    for key, kf in started().items():
        calls, start = Calls(kf), kf.copy()
        z = np.array([4.3, math.nan, 1.2])
        assert calls("update_fix_masked", z=z, mask=np.array([0b101])) == 0
        after = bytes(kf)
        assert after != bytes(start)
        kf.struct.ffi.memmove(kf.struct.data, start.struct.data, len(after))
        assert calls("update_fix_masked", z=z, mask=np.array([0xFFFFFFF8 | 0b101])) == 0
        assert bytes(kf) == after, key


def test_only_partial_sensors_take_a_mask():
    kf = filters()["ud-bierman", OPTIONS[0]]
    assert not kf.struct.has("update_course_masked")
    with pytest.raises(TypeError, match="partial"):
        kf.update("course", [3.0, 0.6], mask=1)
    with pytest.raises(TypeError, match="mask"):
        reference(kf.spec).update("course", [3.0, 0.6], mask=1)


def test_the_gate_counts_what_is_used():
    """nis on either side of the quantile for as many degrees of freedom as there are bits."""
    for (form, options), kf in filters().items():
        for used in itertools.chain.from_iterable(itertools.combinations(range(3), k) for k in (1, 2, 3)):
            limit = chi2.ppf(0.99, len(used))
            statuses = set()
            for size in np.linspace(0, 3, 60):
                kf.init()
                status = kf.update("fix", np.array([4, 3.5, 1.5]) + size, mask=sum(1 << i for i in used))
                gated = status == Status.GATED
                assert gated == (kf.nis > limit), (form, options, used, kf.nis)
                statuses.add(gated)
            assert statuses == {True, False}, (form, options, used)


def test_initialize_wants_its_components():
    """The first reading that holds them sets the state; what else is masked out may be anything."""
    for key, kf in filters(INITIALIZED).items():
        ref, calls = reference(kf.spec), Calls(kf)
        z = np.array([5.0, math.nan, 6.0])
        assert calls("update_fix_masked", z=np.array([4.1, 3.4, math.nan]), mask=np.array([0b011])) == 0
        assert ref.update("fix", [4.1, 3.4, math.nan], mask=0b011) == 0  # an update like any other
        np.testing.assert_allclose(kf.x, ref.x, rtol=1e-12)
        assert kf.nis > 0
        before, P = bytes(kf), kf.P
        assert calls("update_fix_masked", z=z, mask=np.array([0b111])) == Status.NOT_FINITE
        assert bytes(kf) == before
        assert calls("update_fix_masked", z=z, mask=np.array([0b101])) == 0
        np.testing.assert_allclose(kf.x, [5.0, 6.0, ref.x[2]], rtol=1e-12)
        assert kf.nis == 0
        np.testing.assert_array_equal(kf.P, P)
        assert calls("update_fix_masked", z=z, mask=np.array([0b101])) == 0  # from now on an update
        assert kf.nis >= 0
        assert (kf.P.diagonal() <= P.diagonal()).all(), key
        assert (kf.P.diagonal() < P.diagonal())[:2].all(), key
        kf.init()
        assert kf.update("fix", [7.0, 0.0, 8.0]) == 0  # the whole vector, too
        np.testing.assert_array_equal(kf.x[:2], [7.0, 8.0])
