"""The campaign itself: what is right passes, a planted fault is found, specs are made smaller, a run goes on."""

from __future__ import annotations

import numpy as np
import pytest

from tests.campaign.batch import Work, built, spec_of, work
from tests.campaign.compare import compare
from tests.campaign.generate import text_of
from tests.campaign.hostile import compile_batch, run
from tests.campaign.minimise import minimised
from tests.campaign.oracle_points import oracle
from tests.campaign.state import Failure, Result, State

SPEC = {
    "kfgen": 1, "name": "planted", "scalar": "double", "dt": 0.1,
    "states": {"x0": {"init": 0, "std": 1}, "x1": {"init": 0.5, "std": 0.5}, "x2": {"init": 0, "std": 1}},
    "inputs": {"u0": {"range": [-2, 2]}},
    "noise": {"w0": {"std": 0.1}},
    "dynamics": {"f": {"x0": "0.9*x0 + 0.1*x1 + 0.05*sin(x1)", "x1": "0.8*x1 + 0.1*u0 + 0.3*w0", "x2": "0.5*x2"},
                 "Q": {"x0": 0.01, "x2": 0.1}},
    "measurements": {"m0": {"z": {"z0": {"h": "x0 + 0.1*x1**2/(1 + x1**2)", "std": 0.3}}},
                     "m1": {"z": {"z0": {"h": "x2", "std": 0.3}, "z1": {"h": "x1 - x2", "std": 1}}}},
    "filter": {"type": "ekf", "covariance": "ud", "robust": "huber"},
}  # fmt: skip
FAULT = ("{ return PLANTED_NOT_FINITE; }", "{ kf->nis += 1.0; return PLANTED_NOT_FINITE; }")


def test_hostile_calls_find_a_planted_fault(needs, tmp_path):
    needs("gcc")
    made = built(SPEC)
    told = run(compile_batch(tmp_path / "right", {"planted": (made, SPEC)}), 0, 0, 300, 20.0)
    assert told.failures == []
    assert min(told.ok, told.refused) > 1000
    wrong = made.files["planted.c"].replace(*FAULT)
    program = compile_batch(tmp_path / "wrong", {"planted": (made, SPEC)}, {"planted.c": wrong})
    ((kind, _, segment, _),) = run(program, 0, 0, 300, 20.0).failures
    assert kind == "an error has changed the filter"
    assert f"FAILED: {kind}" in run(program, 0, segment, 1, 20.0, trace=True).text


def test_a_sanitizer_ends_a_run_with_a_report(needs, tmp_path):
    needs("gcc")
    made = built(SPEC)
    wrong = made.files["planted.c"].replace("kf->nis = nis;", "kf->nis = nis; kf->x[2 + (int)(nis > 3)] += 0;")
    told = run(compile_batch(tmp_path, {"planted": (made, SPEC)}, {"planted.c": wrong}), 0, 0, 300, 20.0)
    assert told.failures[0][0] == "sanitizer: index N out of bounds for type 'planted_real_t [N]'"


def test_tracks_tell_a_filter_from_another(needs):
    from kfgen.native import load_filters

    needs("gcc")
    other = {**SPEC, "filter": {"type": "ekf", "covariance": "ud"}}
    kf = load_filters([built(SPEC)], flags=["-O0", "-ffp-contract=off"])[0]
    assert compare(kf, SPEC, 1)[0] == []
    assert compare(kf, SPEC, 1)[1] > 40
    assert any("second oracle differs from the filter" in kind for kind in compare(kf, other, 1)[0])


@pytest.mark.parametrize("kind", ["kf", "ekf", "iekf", "ekf2", "ukf"])
def test_the_oracle_is_the_kalman_filter_where_all_is_linear(kind):
    """Every type then gives the same x and P: those of P^-1 + H^T R^-1 H."""
    f = {"x0": "x0 + 0.1*x1", "x1": "0.9*x1 + w0"}
    data = {**SPEC, "states": {"x0": {"init": 1, "std": 2}, "x1": {"init": 0, "std": 1}}, "inputs": {},
            "dynamics": {"f": f, "Q": {"x0": 0.01}}, "filter": {"type": kind},
            "measurements": {"m": {"z": {"a": {"h": "x0", "std": 0.5}, "b": {"h": "x0 - x1", "std": 1}}}}}  # fmt: skip
    kf = oracle(data)
    kf.predict(np.empty(0), 0.1)
    F, H = np.array([[1, 0.1], [0, 0.9]]), np.array([[1.0, 0], [1, -1]])
    P = F @ np.diag([4.0, 1]) @ F.T + np.diag([0.01, 0.01])
    x, z = F @ [1.0, 0], np.array([3.0, -1])
    kf.update("m", z, np.empty(0), [0, 1])
    after = np.linalg.inv(np.linalg.inv(P) + H.T @ np.diag([4.0, 1]) @ H)
    np.testing.assert_allclose(kf.P, after, rtol=1e-12)
    np.testing.assert_allclose(kf.x, x + after @ H.T @ np.diag([4.0, 1]) @ (z - H @ x), rtol=1e-12)


def test_minimising_keeps_what_fails():
    small = minimised(SPEC, lambda data: "u0" in str(data["dynamics"]), 20.0)
    assert list(small["states"]) == ["x1"]
    assert small["dynamics"]["f"] == {"x1": "0.1*u0"}
    assert len(small["measurements"]) == 1
    assert "robust" not in small["filter"]


def test_every_seed_is_the_same_spec_again():
    for seed in range(40):
        assert text_of(spec_of(seed)) == text_of(spec_of(seed))


def test_a_batch_ends_in_a_state_that_goes_on(needs, tmp_path):
    needs("gcc")
    state = State(tmp_path)
    state.add(work(4, Work(size=1, seconds=0.2, smaller=0)))
    path = state.keep(Failure("one kind", 7, SPEC, "segment 3, call 4", "predict\n"))
    state.add(Result(0, {"calls": 5}, kinds={"one kind": 1}))
    again = State(tmp_path)
    assert again.next_batches(4) == [1, 2, 3, 5]
    assert again.totals["counts"]["calls"] == state.totals["counts"]["calls"] > 1000
    assert "one kind" in again.report()
    assert path.read_text().startswith("# one kind\n# seed 7, segment 3, call 4\nkfgen: 1\n")
