"""The recipes of the README: each is tried as it stands there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import kfgen
from kfgen.native import NativeFilter
from kfgen.spec import loads

README = (Path(__file__).parents[2] / "README.md").read_text()

HEATER = """kfgen: 1
name: heater
dt: 1
inputs: {heat: {unit: W}}
states:
  T: {init: 20, std: 5, unit: K}
  u1: {init: 0, std: 0, unit: W}
  u2: {init: 0, std: 0, unit: W}
dynamics: {form: discrete, f: {u1: heat, u2: u1, T: T + 0.1*u2}, Q: {T: 0.01}}
measurements: {probe: {z: {T: {h: T, std: 0.3, unit: K}}}}
filter: {type: kf}
"""
MAP = """kfgen: 1
name: chart
states: {x: {init: 0.2, std: 0.1}, y: {init: 0.3, std: 0.1}}
dynamics: {form: discrete, f: {}, Q: {x: 0.01, y: 0.01}}
measurements:
  depth: {z: {d: {h: "table(x, [0, 1], [table(y, [0, 1], [1, 2]), table(y, [0, 1], [3, 5])])", std: 0.1}}}
filter: {type: ekf}
"""
CART = """kfgen: 1
name: cart
dt: 0.1
states: {p: {init: 0, std: 1}, v: {init: 0, std: 1}}
parameters: {r: 0.2}
dynamics: {form: discrete, f: {p: p + dt*v}, Q: {v: 0.01}}
measurements:
  fix: {z: {x: {h: p, std: r}}}
filter: {type: kf}
"""
COLOURED = """kfgen: 1
name: coloured
dt: 0.1
states:
  p: {init: 0, std: 1}
  v: {init: 0, std: 1}
  n: {init: 0, std: 0.5}
noise: {w: {}, m: {}}
noise_covariance: [[0.01, 0.015], [0.015, 0.09]]
dynamics: {form: discrete, f: {p: p + dt*v, v: v + w, n: m}}
measurements: {fix: {z: {x: {h: p + n, std: 0}}}}
filter: {type: kf}
"""
CONSTRAINT = """kfgen: 1
name: split
states: {a: {init: 0.4, std: 0.2}, b: {init: 0.3, std: 0.2}, c: {init: 0.2, std: 0.2}}
dynamics: {form: discrete, f: {}, Q: {a: 0.001, b: 0.001, c: 0.001}}
measurements:
  scale: {z: {a: {h: a, std: 0.05}}}
  whole: {z: {sum: {h: a + b + c - 1, std: 0}}}
filter: {type: kf}
"""
SATELLITES = """kfgen: 1
name: fix2d
dt: 1
states: {p: {vector: 2, init: 0, std: 100, unit: m}, clock: {init: 0, std: 100, unit: m}}
dynamics: {form: discrete, f: {}, Q: {p: 1, clock: 10}}
measurements:
  range:
    inputs: {sat: {vector: 2, unit: m}, sigma: {unit: m}}
    z: {rho: {h: norm(sat - p) + clock, std: sigma, unit: m}}
filter: {type: ekf}
"""


def compiled(text: str, **options: object) -> NativeFilter:
    return kfgen.compile(loads(text), "double", **options)


def quoted(*pieces: str) -> None:
    """What a recipe says stands in the README."""
    words = " ".join(README.split())
    assert [piece for piece in pieces if piece not in words] == []


def test_dead_time_is_a_shift_register():
    quoted("f: {u1: heat, u2: u1, T: T + 0.1*u2}", "`std: 0`")
    kf = compiled(HEATER)
    for heat in (10.0, 0.0, 0.0):
        kf.predict([heat])
    assert kf.x[0] == 21.0  # two steps late
    kf.update("probe", [20.5])
    assert kf.x[1:].tolist() == [0.0, 0.0]  # known exactly: no measurement moves them


def test_a_table_of_tables_is_bilinear():
    quoted("table(x, [0, 1], [table(y, [0, 1], [1, 2]), table(y, [0, 1], [3, 5])])")
    kf = compiled(MAP)
    x, y = 0.2, 0.3
    depth = (1 - x) * (1 + y) + x * (3 + 2 * y)
    before = kf.x.copy()
    kf.update("depth", [depth])
    np.testing.assert_allclose(kf.x, before, atol=1e-12)


def test_late_fixes():
    quoted("history: {steps: 25}")
    kf, h = compiled(CART), compiled(CART + "history: {steps: 25}\n", history=True)
    for k in range(5):
        kf.predict()
        h.predict()
        if k == 2:
            kf.update("fix", [0.5])
    assert h.update("fix", [0.5], age=2) == 0
    np.testing.assert_array_equal(h.x, kf.x)


def test_varying_satellites():
    quoted("inputs: {sat: {vector: 3, unit: m}")
    kf = compiled(SATELLITES)
    truth, clock = np.array([40.0, -30.0]), 55.0
    for satellites in ([(900, 0), (0, 800), (-700, 300), (100, -900)], [(900, 0), (0, 800)], [(-700, 300)]) * 4:
        kf.predict()
        for sat in satellites:
            rho = np.linalg.norm(np.array(sat) - truth) + clock
            assert kf.update("range", [rho], inputs=[*sat, 2.0]) == 0
    np.testing.assert_allclose(kf.x, [*truth, clock], atol=1.0)


def test_changing_noise_and_switching_off():
    quoted("parameters: {r: 0.2}", "std: r")
    kf = compiled(CART)
    kf.predict()
    believed = kf.copy()
    believed.parameters["r"] = 1e-3
    doubted = kf.copy()
    doubted.parameters["r"] = 1e6
    for each in (believed, doubted):
        each.update("fix", [1.0])
    assert believed.x[0] == pytest.approx(1, abs=1e-5)
    assert doubted.x[0] == pytest.approx(kf.x[0], abs=1e-6)


def test_several_instances_and_what_if():
    quoted("what = kf;")
    kf = compiled(CART)
    kf.predict()
    other = kf.copy()
    for _ in range(20):
        other.predict()
    assert other.P[0, 0] > kf.P[0, 0]
    assert kf.P[0, 0] == compiled_once().P[0, 0]


def compiled_once() -> NativeFilter:
    kf = compiled(CART)
    kf.predict()
    return kf


def test_correlated_noises_by_augmentation():
    quoted("f: {p: p + dt*v, v: v + w, n: m}", "h: p + n")
    kf = compiled(COLOURED)
    # the Kalman filter with S = E[w e]: K = (P H^T) / (H P H^T + R), and x <- F x + S (H P H^T + R)^-1 nu
    F = np.array([[1, 0.1], [0, 1]])
    x, P = np.zeros(2), np.eye(2)
    S, R, Q = np.array([0, 0.015]), 0.09, np.diag([0, 0.01])
    random = np.random.default_rng(1)
    for z in random.normal(0, 1, 12):
        kf.predict()
        # the correlation is between the noise of the step and that of the measurement after it
        x, P = F @ x, F @ P @ F.T + Q
        C = P[:, 0] + S
        s = P[0, 0] + R
        nu = z - x[0]
        x, P = x + C / s * nu, P - np.outer(C, C) / s
        kf.update("fix", [z])
        np.testing.assert_allclose(kf.x[:2], x, atol=1e-9)
        np.testing.assert_allclose(kf.P[:2, :2], P, atol=1e-9)


def test_an_equality_constraint():
    quoted("h: a + b + c - 1, std: 0")
    kf = compiled(CONSTRAINT)
    for z in (0.5, 0.52, 0.48):
        kf.predict()
        kf.update("scale", [z])
        assert kf.update("whole", [0.0]) == 0
        assert kf.x.sum() == pytest.approx(1, abs=1e-12)
        assert np.ones(3) @ kf.P @ np.ones(3) == pytest.approx(0, abs=1e-12)
