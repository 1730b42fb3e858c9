"""Emitted banks against the reference, other implementations, and each other. A failure here is the algorithm's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from banks import DYNAMICS, OPEN, SENSORS, START, TOP, Pair

from kfgen.generate import build
from kfgen.native import NativeFilter, compile_many, load_filters
from kfgen.override import override
from kfgen.spec import loads
from kfgen.status import ERROR, Status
from tests.oracle.imm_banks import TURNING, bank
from tests.oracle.problems import IMM3
from tests.recorded import peer_rows


def pairs(texts: Mapping[str, str], scalar: str = "double") -> dict[str, Pair]:
    """Banks with their references, by one call of the compiler."""
    specs = [replace(override(loads(text), scalar), name=f"bank_{k}") for k, text in enumerate(texts.values())]
    made = [build(spec) for spec in specs]
    filters = load_filters(made, flags=["-O0"])
    return {key: Pair(*each) for key, *each in zip(texts, specs, made, filters, strict=True)}


# peers ---------------------------------------------------------------------------------------------------

BIERMAN, UKF = "type: ekf", "type: ukf, covariance: ud, sequential: false"
KAPPA0 = f"{UKF}, sigma_points: {{kind: julier, kappa: 0, redraw: false}}"
MATCHES = [
    (BIERMAN, BIERMAN, "filterpy_imm3_imm"),
    (BIERMAN, BIERMAN, "yafl_imm3_imm_bierman"),
    ("type: kf, update: joseph", "type: ekf, covariance: full", "yafl_imm3_imm_bierman"),
    ("type: ekf, covariance: sqrt", "type: iekf, iterations: 2", "filterpy_imm3_imm"),
    ("type: ekf, covariance: full, update: standard", "type: ekf2", "filterpy_imm3_imm"),
    ("type: ukf, covariance: full", "type: ukf, covariance: sqrt", "filterpy_imm3_imm"),
    (BIERMAN, KAPPA0, "yafl_imm3_imm_ekf_ukf_kappa0"),
]


def peer(name: str) -> np.ndarray:
    return peer_rows(name)


def test_peers():
    """|dx| relative to max(|x|, 1e-3 of the largest |x_i| in the run), |dP_ij| to sqrt(P_ii P_jj), mu: 1e-8."""
    first, second, rest = IMM3.split("{type: ekf}")
    specs = [loads(f"{first}{{{cv}}}{second}{{{ca}}}{rest}") for cv, ca, _ in MATCHES]
    inputs = peer("in_imm3")
    for kf, match in zip(compile_many(specs, flags=["-O0"]), MATCHES, strict=True):
        result = {int(row[0]): row[1:] for row in peer(match[2])}
        largest = np.max(np.abs([row[:3] for row in result.values()]), axis=0)
        worst = 0.0
        for row, z in enumerate(inputs):
            assert kf.predict() == kf.update("position", z) == 0
            if row in result:
                x, P, mu = result[row][:3], result[row][3:12].reshape(3, 3), result[row][12:]
                sigma = np.sqrt(P.diagonal())
                worst = max(
                    worst,
                    np.max(np.abs(kf.x - x) / np.maximum(np.abs(x), 1e-3 * largest)),
                    np.max(np.abs(kf.P - P) / np.outer(sigma, sigma)),
                    np.max(np.abs(kf.mu - mu)),
                )
        assert worst < 1e-8, match


# mixtures of all kinds -----------------------------------------------------------------------------------

CODE = "code: {log_likelihood: true, gate_count: true}\n"
SETS = "initialize: {from: place, states: {x: x}}\n"
# (filters of the modes, transition, mu0, more at the top, keys of the second mode)
MIXTURES = {
    "layouts": (
        ["type: ekf", "type: ekf, covariance: full, update: standard", "type: ekf, covariance: sqrt"],
        [[0.9, 0.05, 0.05], [0.05, 0.9, 0.05], [0.1, 0.1, 0.8]], [0.2, 0.3, 0.5], SETS, START,
    ),
    "points": (
        ["type: ukf", "type: ukf, covariance: full, augment: true", "type: ukf, covariance: sqrt, "
         "sigma_points: {kind: cubature}", "type: ukf, sequential: true, robust: huber"],
        [[0.5, 0.5, 0, 0], [0, 0.5, 0.5, 0], [0, 0, 0.5, 0.5], [0.5, 0, 0, 0.5]], [0, 0, 1, 0], "", SENSORS,
    ),
    "curved": (
        ["type: iekf, iterations: 2", "type: ekf2, covariance: sqrt", "type: ukf, adaptive: true"],
        [[0, 0.5, 0.5], [0, 1, 0], [0, 0.5, 0.5]], [0.5, 0, 0.5], SETS, OPEN,
    ),
    "learning": (
        ["type: ukf, covariance: full", "type: ekf, covariance: full, adapt_R: 0.01, adapt_Q: 0.01",
         "type: ekf, update: joseph, gain_limit: 0.4, robust: chernodarov"],
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]], [0.3, 0.3, 0.4], "", "P0: [[1, 0.5, 0], [0.5, 1, 0.1], [0, 0.1, 0.3]]",
    ),
    "limited": (
        ["type: ekf, variance_floor: 0.01", "type: ukf, covariance: sqrt, adapt_R: 0.02",
         "type: ekf, adaptive: true, consider: [w], update: joseph", "type: iekf, covariance: full"],
        [[0.25] * 4] * 4, [0.25] * 4, "", "covariances: [[x, th, 0.1]]",
    ),
}  # fmt: skip


def mixture(case: tuple[list[str], list[list[float]], list[float], str, str]) -> str:
    filters, transition, mu0, top, second = case
    modes = {
        f"m{k}": f"{DYNAMICS[k]}\nfilter: {{{options}}}\n{second if k == 1 else ''}"
        for k, options in enumerate(filters)
    }
    floor = {"mu_floor": 0} if 0 in mu0 else {}
    return bank(TOP + top + CODE, modes, transition, mu0=mu0, **floor)


# filters of the modes that are all kept alike, so that they are mixed in loops; the rest as of MIXTURES
ALIKE = {
    "ud": (
        ["type: ekf", "type: iekf, iterations: 2", "type: ekf2, adaptive: true"],
        [[0.9, 0.05, 0.05], [0.05, 0.9, 0.05], [0.1, 0.1, 0.8]], [0.2, 0.3, 0.5], SETS, START,
    ),
    "full": (
        ["type: ekf, covariance: full, update: standard", "type: ukf, covariance: full",
         "type: ekf, covariance: full, update: joseph, robust: huber"],
        [[0, 0.5, 0.5], [0, 1, 0], [0, 0.5, 0.5]], [0.5, 0, 0.5], "", SENSORS,
    ),
    "sqrt": (
        ["type: ekf, covariance: sqrt", "type: ukf, covariance: sqrt", "type: iekf, covariance: sqrt, iterations: 2",
         "type: ekf, covariance: sqrt, variance_floor: 0.01"],
        [[0.5, 0.5, 0, 0], [0, 0.5, 0.5, 0], [0, 0, 0.5, 0.5], [0.5, 0, 0, 0.5]], [0, 0, 1, 0], "", OPEN,
    ),
    "learning": (
        ["type: ukf", "type: ekf, adapt_R: 0.01, adapt_Q: 0.01",
         "type: ekf, update: joseph, gain_limit: 0.4, robust: chernodarov"],
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]], [0.3, 0.3, 0.4], "", "P0: [[1, 0.5, 0], [0.5, 1, 0.1], [0, 0.1, 0.3]]",
    ),
}  # fmt: skip
LOOPS = {f"{key} alike": mixture(case) for key, case in ALIKE.items()}
LOOPS |= {key: mixture(MIXTURES[key]) for key in ("layouts", "limited")}
LOOPS = {key: text.replace("code: {", "code: {unroll: none, ") for key, text in LOOPS.items()}


def test_mixtures():
    """Written out, and in loops."""
    seen = Status.OK
    for key, pair in pairs({key: mixture(case) for key, case in MIXTURES.items()} | LOOPS).items():
        pair.drive(20, 3)
        assert pair.worst < 1e-8, key
        seen |= pair.seen
    every = Status.GATED | Status.ANOMALY | Status.DT_CLAMPED | Status.NOT_FINITE | Status.NOT_POSITIVE
    assert every & seen == every


KEPT = """
kfgen: 1
name: kept
scalar: double
dt: 0.1
states: {x: {init: 1.5, std: 0.3, bounds: [-1, 1.7]}, y: {init: 0.2, std: 0.2}, p: {init: 3, std: 0.3, kind: {periodic: 7}}}
measurements:
  fix:
    z:
      a: {h: x + y**2/9, std: 0.2}
      b: {h: y, std: 0.3}
      c: {h: p, std: 0.3, kind: {periodic: 7}}
    partial: true
    gate: {probability: 0.95, reset_after: 1}
initialize: {from: fix, states: {x: a, p: c}}
"""  # noqa: E501
KEEPING = ["covariance: full, sigma_points: {kind: julier, kappa: 1", "covariance: ud, adaptive: {chi2: 3}, "
           "sigma_points: {kind: cubature", "covariance: sqrt, adapt_R: 0.02, sigma_points: {kind: merwe"]  # fmt: skip
MOVES = ["{x: x + dt*y, y: y*cos(x)/2, p: p + dt*x}", "{x: 0.9*x, y: y*(0.8 + n) + n/2, p: p - y/9}", "{y: sin(x*y)}"]


def test_points_that_are_kept():
    """Those of a mode's own prediction, until its estimate changes; and `redraw` for all modes."""
    modes = {
        name: f"noise: {{n: {{std: 0.2}}}}\ndynamics: {{f: {f}, Q: {{x: 0.01, y: 0.01, p: 0.02}}}}\n"
        f"filter: {{type: ukf, {options}, redraw: false}}}}"
        for name, f, options in zip("abc", MOVES, KEEPING, strict=True)
    }
    modes["d"] = "dynamics: {f: {x: x/2}, Q: {x: 0.1, y: 0.1, p: 0.1}}\nfilter: {type: ekf}"
    (pair,) = pairs({"": bank(KEPT + CODE, modes, np.full((4, 4), 0.25).tolist())}).values()
    pair.drive(40, 5)
    assert pair.worst < 1e-8
    kf = pair.kf
    assert pair("init") == pair("predict") == 0
    assert [kf.modes[i].raw["kept"] for i in range(3)] == [True] * 3
    assert pair("update", "fix", [1.0, 0.2, 3.0]) == 0  # sets the state
    assert [kf.modes[i].raw["kept"] for i in range(3)] == [False] * 3


def large(covariances: list[str], transition: object) -> str:
    """Nine states, from which on sigma points are loops."""
    n = 9
    top = "kfgen: 1\nname: large\nscalar: double\ndt: 0.1\nstates:\n"
    top += "".join(f"  x{i}: {{init: {i / 10}, std: {0.3 + 0.05 * i:.2f}}}\n" for i in range(n))
    top += "measurements:\n  s: {z: {a: {h: x0 + x1*x2/5, std: 0.5}, b: {h: x8 - x3, std: 0.4}}, partial: true}\n"
    Q = ", ".join(f"x{i}: 0.01" for i in range(n))
    chain = ", ".join(f'x{i}: "0.9*x{i} + dt*sin(x{(i + 1) % n})*(1 + n)"' for i in range(n))
    still = "x0: x0/2, x4: x4 + dt*x5"  # a linear f has no points
    return bank(
        top,
        {
            f"m{k}": f"noise: {{n: {{std: 0.1}}}}\ndynamics: {{f: {{{chain if k < 2 else still}}}, Q: {{{Q}}}}}\n"
            f"filter: {{type: ukf, covariance: {form}}}"
            for k, form in enumerate(covariances)
        },
        transition,
    )


def test_points_in_loops():
    texts = {
        "mixed": large(["ud", "sqrt", "full"], [[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0, 0.5, 0.5]]),
        "swapped": large(["full", "full"], [[0, 1], [1, 0]]),
    }
    for key, pair in pairs(texts).items():
        pair.drive(12, 6)
        assert pair.worst < 1e-8, key


# angles --------------------------------------------------------------------------------------------------


def heading(kind: str, starts: list[float], transition: object, mu0: object, bounds: str = "") -> str:
    top = f"""
kfgen: 1
name: heading
scalar: double
dt: 0.1
states: {{th: {{init: 0, std: 1, kind: {kind}{bounds}}}, w: {{init: 0, std: 1}}}}
measurements: {{s: {{z: {{z: {{h: th, std: 0.5, kind: {kind}}}}}}}}}
"""
    forms = ["ekf", "ukf, covariance: full", "ukf, covariance: sqrt", "iekf"]
    modes = {
        f"m{k}": f"filter: {{type: {forms[k]}}}\n"
        f"states: {{th: {{init: {th}, var: 0.05}}, w: {{init: 0.1, var: 0.1}}}}\n"
        f"dynamics: {{f: {{th: th + 0.{k + 1}*w}}, Q: {{th: 0.01, w: 0.01}}}}"
        for k, th in enumerate(starts)
    }
    return bank(top, modes, transition, mu0=mu0)


def test_angles():
    """Modes on both sides of the seam; equal weights that a third of a turn and half a turn lie between."""
    swaps = [[0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]
    period = "{periodic: 5}"
    texts = {
        "thirds": heading("angle", [0, 2, -2.5], [["1/3"] * 3] * 3, ["1/3"] * 3),
        "quarters": heading(period, [0, 1.3, -2.4, 2.3], [[0.25] * 4] * 4, [0.25] * 4),
        "opposite": heading(period, [0, 2.5], [[0.5, 0.5], [0.5, 0.5]], [0.25, 0.75]),
        "opposite too": heading(period, [2.5, 0], [[0.5, 0.5], [0.5, 0.5]], [0.5, 0.5]),
        "seam": heading("angle", [3.1, -3, -3.05], swaps, [0.3, 0.3, 0.4], ", bounds: [-3.12, 3.13]"),
    }
    for key, pair in pairs(texts).items():
        pair.drive(20, 4, 3.0)
        assert pair.worst < 1e-8, key


# probabilities -------------------------------------------------------------------------------------------


def test_identical_modes_are_the_single_filter():
    options = ["type: ekf, adaptive: {chi2: 30}", "type: ukf, covariance: full, adapt_R: 0.05"]
    same = [[0.8, 0.2], [0.3, 0.7]]
    texts = [f"{TURNING}filter: {{{each}}}\n" for each in options]
    texts += [bank(text, {"a": "{}", "b": "{}"}, same) for text in texts]
    filters = compile_many([loads(text) for text in texts], flags=["-O0"])
    for one, kf, each in zip(filters, filters[len(options) :], options, strict=False):
        random = np.random.default_rng(3)
        for k in range(40):
            u = random.normal(size=1)
            assert kf.predict(u, 0.1) == one.predict(u, 0.1) < ERROR
            z = np.array([np.hypot(*one.x[:2]), np.arctan2(one.x[1], one.x[0])]) + random.normal(size=2) * [0.5, 0.02]
            assert kf.update("radar", z) == one.update("radar", z) < ERROR
            if k % 2:
                z, mask = one.x[:3] + random.normal(size=3), (0b111, 0b110, 0b001)[k // 2 % 3]
                assert kf.update("gnss", z, mask=mask) == one.update("gnss", z, mask=mask) < ERROR
            sigma = np.sqrt(one.P.diagonal())
            scale = np.maximum(np.abs(one.x), sigma)
            for x in (kf.x, *(mode.x for mode in kf.modes)):
                assert np.max(np.abs(x - one.x) / scale) < 1e-12, each
            assert np.max(np.abs(kf.P - one.P) / np.outer(sigma, sigma)) < 1e-12, each
            assert kf.nis == pytest.approx(one.nis, rel=1e-11, abs=1e-12)
            assert kf.mu.sum() == pytest.approx(1.0, abs=1e-14)


def many(count: int, transition: object, R: str = "0.01", **more: object) -> str:
    """Modes that predict different means of one state; a sensor of `count` components."""
    z = ", ".join(f"z{i}: {{h: x*{1 + i / 10}, var: {R}}}" for i in range(count))
    top = "kfgen: 1\nname: many\nscalar: double\nstates: {x: {init: 1, var: 1}}\n"
    top += f"measurements: {{s: {{z: {{{z}}}}}}}\n"
    size = len(np.atleast_2d(transition))
    forms = ["ekf", "ekf, covariance: full", "ukf"]
    modes = {
        f"m{k}": f"dynamics: {{f: {{x: 0.5*x + {k}}}, Q: {{x: 0.01}}}}\nfilter: {{type: {forms[k % 3]}}}"
        for k in range(size)
    }
    return bank(top + CODE.replace(", gate_count: true", ""), modes, transition, **more)


def test_likelihoods_beyond_the_numbers():
    """exp(l) is 0 for every mode, by far: the differences decide. Also in float."""
    texts = {
        "floor": many(8, [[0.9, 0.1], [0.1, 0.9]], "1e-6"),
        "none": many(8, [[0.9, 0.1], [0.1, 0.9]], "1e-6", mu_floor=0),
        "apart": many(8, [[1, 0], [0, 1]], "1e-6", mu_floor=0),
    }
    for scalar, tolerance in (("double", 1e-6), ("float", 2e-2)):
        for key, pair in pairs(texts, scalar).items():
            random = np.random.default_rng(1)
            for k in range(30):
                pair("predict")
                # of another state in each component, so that the likelihood is that of a far outlier
                z = (0.5 * pair.ref.modes[0].x[0] + 0.3 * (k % 2)) * (1 + np.arange(8) / 10)
                pair("update", "s", z + 0.05 * random.normal(size=8))
                assert pair.ref.log_likelihood < -1000
            assert pair.seen == 0
            assert pair.worst < tolerance, (key, scalar)
            assert pair.kf.mu.sum() == pytest.approx(1.0, abs=1e-6)


def test_chains_with_zeros():
    """Modes that end, that begin later, that no other turns into; 10^5 predictions without a measurement."""
    chains = {
        "end": many(2, [[0.5, 0.5], [0, 1]], mu0=[1, 0], mu_floor=0),
        "later": many(2, [[0, 1, 0], [0, 0, 1], [0, 0, 1]], mu0=[1, 0, 0], mu_floor=0),
        "apart": many(2, [[0.5, 0.5, 0], [0.5, 0.5, 0], [0, 0, 1]], mu0=[0.5, 0.5, 0], mu_floor=0),
        "eight": many(1, [[0.3 if i == j else 0.1 for j in range(8)] for i in range(8)]),
        "rare": many(1, [[1, "1e-60"], ["1e-60", 1]], mu_floor="1e-60"),
    }
    for scalar in ("double", "float"):
        few = chains if scalar == "double" else {key: chains[key] for key in ("end", "rare")}
        for key, pair in pairs(few, scalar).items():
            if scalar == "double" or key != "rare":
                pair.drive(12, 2)
                assert pair.worst < (1e-8 if scalar == "double" else 1e-2), key
            kf = pair.kf
            kf.init()
            nothing = np.full(100_000, math.nan)
            result = kf.run({f"s.z{i}": nothing for i in range(len(kf.components("s")))})
            assert (result.status == 0).all(), (key, scalar)
            assert kf.mu.sum() == pytest.approx(1.0, abs=1e-6)
            assert (kf.mu >= 0).all()
            assert kf.P[0, 0] > 0
            if key in ("end", "later"):
                assert kf.mu[-1] == pytest.approx(1.0, abs=1e-6)


def test_the_right_model_wins():
    """Modes that never turn into each other: the one that is true takes all, with and without a floor."""
    texts = {floor: many(1, [[1, 0], [0, 1]], "0.01", mu_floor=floor) for floor in (0, 1e-9)}
    specs = [replace(loads(text), name=f"wins_{k}") for k, text in enumerate(texts.values())]
    for kf, floor in zip(compile_many(specs, flags=["-O0"]), texts, strict=True):
        random = np.random.default_rng(7)
        x = 1.0
        for _ in range(200):
            x = 0.5 * x + 1.0 + 0.1 * random.normal()
            assert kf.predict() == kf.update("s", [x + 0.1 * random.normal()]) == 0
        assert kf.mu[1] > 1 - 1e-8
        assert kf.mu[0] >= 0.99 * floor


def million(kf: NativeFilter, steps: int) -> None:
    random = np.random.default_rng(8)
    z = np.cumsum(random.normal(0, 0.01, steps)) * 0.01 + random.normal(0, 1, steps)
    z[random.random(steps) < 0.01] *= 30
    z[random.random(steps) < 0.1] = np.nan
    result = kf.run({"position.z": z})
    assert (result.status < ERROR).all(), result.counts()
    assert np.isfinite(result.x).all()
    assert (result.var > 0).all()
    assert result.mu is not None
    assert np.max(np.abs(result.mu.sum(axis=1) - 1)) < 1e-6
    assert result.mu.min() >= 0
    assert np.linalg.eigvalsh(kf.P)[0] > 0


def test_a_million_steps():
    """In float, with outliers and gaps: finite, positive, and mu the probabilities of all cases."""
    first, second, rest = IMM3.split("{type: ekf}")
    filters = ("{type: ekf, robust: huber}", "{type: ekf, covariance: sqrt}")
    (kf,) = compile_many([loads(f"{first}{filters[0]}{second}{filters[1]}{rest}")], "float", flags=["-O2"])
    million(kf, 1_000_000)
