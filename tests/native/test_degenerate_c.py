"""Where something is known exactly, or all but zero: exact sensors that repeat each other, noise along one axis.

A failure here is the linear algebra's: a pivot that rounding has left decides what it should not.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from emitted import problems
from variants import FORMS, built, spec_with

from kfgen.check import check
from kfgen.override import override
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import ERROR, Status

# exact sensors of one state, the second a repetition; a P0 of rank 2, a state that is known
EXACT = """
kfgen: 1
name: exact
dt: 0.5
states:
  a: {init: 1}
  b: {init: 2}
  c: {init: 0.5}
P0: [[1, 0.5, 0], [0.5, 0.25, 0], [0, 0, 0]]
dynamics:
  form: discrete
  f: {a: 0.75*a + 0.25*c, b: 0.5*b + 0.25*a}
  Q: {b: 0.25}
measurements:
  exact:
    z:
      one: {h: a, std: 0}
      again: {h: a, std: 0}
      sum: {h: a + b, var: 0.25}
  more:
    z: {sum: {h: 2*a + b, var: 1}, sum2: {h: 2*a + b, var: 1}}
filter: {type: ekf}
"""
OPTIONS = [
    "robust: chernodarov, adaptive: {chi2: 1}",
    "robust: huber, innovation_floor: 0.01",
    "type: iekf, iterations: 3",
    "consider: [b]",
]


@pytest.mark.parametrize("options", OPTIONS)
def test_exact_sensors(options):
    """One state, measured exactly and twice: in every form what the reference says."""
    forms = [form for form in FORMS if "joseph" in form or "consider" not in options]
    filters = built({form: spec_with(EXACT, options, form) for form in forms})
    ref = reference(spec_with(EXACT, options, forms[0]))
    random = np.random.default_rng(3)
    for _ in range(30):
        a, b, c = random.normal([1, 1, 1], 2)
        for name, z in (("predict", None), ("exact", [a, a, b]), ("more", [b, c])):
            truth = ref.predict() if z is None else ref.update(name, z)
            for form, kf in filters.items():
                status = kf.predict() if z is None else kf.update(name, z)
                # that round-off was taken for zero may be told
                assert (status ^ truth) & ~Status.REGULARIZED == 0, (form, name)
                sigma = np.sqrt(np.maximum(ref.P.diagonal(), 1e-12))
                assert np.max(np.abs(kf.x - ref.x) / np.maximum(sigma, 1e-3)) < 1e-9, (form, name)
                assert np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma)) < 1e-9, (form, name)
                assert kf.nis == pytest.approx(ref.nis, rel=1e-9, abs=1e-9), (form, name)
                assert kf.log_likelihood == pytest.approx(ref.log_likelihood, rel=1e-9, abs=1e-9), (form, name)


TWICE = """
kfgen: 1
name: twice
states: {a: {init: 0, var: 1}, b: {init: 0, var: 1}}
dynamics: {form: discrete, f: {a: 0.7*a + 0.3*b, b: 0.6*b + 0.1*a}, Q: {a: 0.1, b: 0.3}}
measurements: {s: {z: {z: {h: a + 0.3*b, var: 0}, z2: {h: a + 0.3*b, var: 0}}}}
filter: {type: ekf}
"""


@pytest.mark.parametrize("form", FORMS)
def test_an_exact_sensor_of_two_states_twice(form):
    """The repetition says what is known: the state does not move, in units of what it was uncertain by."""
    kf = built({form: spec_with(TWICE, "type: ekf", form)})[form]
    random = np.random.default_rng(0)
    worst = 0.0
    for _ in range(100):
        A, z = random.normal(size=(2, 2)), random.normal()
        assert kf.init() == kf.set_covariance(A @ A.T) == kf.predict() == 0
        P, h = kf.P, np.array([1, 0.3])
        assert kf.update("s", [z, z]) < ERROR
        x = P @ h / (h @ P @ h) * z
        worst = max(worst, float(np.max(np.abs(kf.x - x) / np.sqrt(P.diagonal()))))
    assert worst < 1e-6


TURNED = """
kfgen: 1
name: turned
states: {px: {init: 0, var: 0.01}, py: {init: 0, var: 0.01}, th: {init: 0, var: 0}}
noise: {w1: {std: 1}, w2: {std: 1}}
dynamics:
  form: discrete
  f: {px: 0.9*px + 0.1*py + cos(th)*w1 + 0.3*w2, py: 0.9*py - 0.1*px + sin(th)*w1 + 0.7*w2}
measurements:
  s: {z: {a: {h: px, var: 1}, b: {h: py, var: 1}}}
filter: {type: ekf}
"""
MIXED = """
kfgen: 1
name: mixed
states: {x: {init: 0, var: 1}, y: {init: 0, var: 2}, z: {init: 0, var: 1.5}, th: {init: 0, var: 0}}
dynamics: {form: discrete, f: {x: 0.4*x + 0.2*y + 0.3*z, y: 0.8*x + sin(th)*z, z: 0.1*x + 0.7*y + 0.5*z}}
measurements:
  s: {z: {a: {h: x, var: 1}, b: {h: y, var: 1}}}
filter: {type: ekf}
"""
# what turns; arguments of predict
VANISHING = {
    "turned": (TURNED, "th", {}),
    "mixed": (MIXED, "th", {}),
    "vehicle4": (problems.VEHICLE4, "th", {}),
    "att": (problems.ATT, "q1", {"u": [0.1, 0.2, 0.3]}),
}
ANGLES = (0.0, 1e-12, 1e-9, 1e-5, math.pi / 2, math.pi / 2 + 1e-7, math.pi, -math.pi / 2)


@pytest.mark.parametrize(
    ("name", "form"), [*itertools.product(VANISHING, ["ud-bierman", "sqrt"]), ("mixed", "full-joseph")]
)
def test_what_vanishes_but_for_rounding(name, form):
    """One entry of F or of the noise inputs' G is 1e-17, or 1e-9, at an angle: P is predicted as well as anywhere.

    A pivot that has so far seen only that entry is next to zero, and its column next to infinite; the terms that
    come after it have to be added without the difference of two large numbers. Bounds: relative to sigma.
    """
    text, state, arguments = VANISHING[name]
    wrong = []
    specs = {scalar: spec_with(text, "type: ekf", form, scalar) for scalar in ("float", "double")}
    for scalar, kf in built(specs).items():
        ref = reference(kf.spec)
        for angle in ANGLES:
            x = ref.x
            x[kf.states.index(state)] = angle
            for each in (kf, ref):
                each.init()
                each.set_state(x)
                assert each.predict(**arguments) == 0
            sigma = np.sqrt(np.maximum(ref.P.diagonal(), 1e-12))
            error = np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma))
            if not error < (1e-4 if scalar == "float" else 1e-11):
                wrong.append(f"{scalar}, {state} = {angle:g}: P is off by {error:.1g}")
            ref.init()
    assert not wrong, "; ".join(wrong)


LEARNT = """
kfgen: 1
name: learnt
states: {x: {init: 0, var: 1}, y: {init: 0, var: 1}, z: {init: 0, var: 2}}
covariances: [[x, y, 1e-17], [x, z, 1e-17], [y, z, 1e-17]]
dynamics: {form: discrete, f: {x: 0.9*x + 0.1*y, y: 0.9*y, z: 0.8*z + 0.1*x}}
measurements:
  one: {z: {z: {h: x, var: 1}}}
  two: {z: {z: {h: x + 2*y, var: 1}}}
  three: {z: {z: {h: z - 2*y, var: 1}}}
filter: {type: ekf}
"""


@pytest.mark.parametrize("form", FORMS)
def test_a_Q_of_nothing_learns(form):
    """Corrections of one state move the others by round-off: Q is what the corrections make of it."""
    kf = built({form: spec_with(LEARNT, "adapt_Q: 0.1", form)})[form]
    ref = reference(kf.spec)
    for sensors in itertools.permutations(["one", "two", "three"]):
        kf.init()
        ref.init()
        for sensor in sensors:
            assert kf.update(sensor, [1.0]) == ref.update(sensor, [1.0]) == 0
            np.testing.assert_allclose(kf.Q, ref.Q, atol=1e-12 * np.max(ref.Q), rtol=0, err_msg=str(sensors))


FORGETFUL = """
kfgen: 1
name: forgetful
dt: 0.1
states: {a: {init: 3, std: 0.1}, b: {init: 1, std: 0.5}, c: {init: 5, var: 0}}
inputs: {push: {range: [-1, 1]}}
dynamics: {form: discrete, f: {a: a + dt*b, b: push, c: push*dt}, Q: {a: 0.01}}
measurements: {both: {z: {a: {h: a, std: 0.5}, d: {h: b*push + c + a, std: 0.5}}}}
filter: {type: ekf}
"""


@pytest.mark.parametrize("covariance", ["ud", "full", "sqrt"])
def test_states_that_a_step_sets_to_an_input(covariance):
    """After predict they are known exactly and correlated with nothing, structurally."""
    outcome = check(override(loads(FORGETFUL), filter={"covariance": covariance}), steps=60)
    assert outcome.passed, outcome


DECAYING = """
kfgen: 1
name: decaying
dt: 0.1
states: {a: {init: 0, std: 1}, b: {init: 0, std: 2}, c: {init: 0, std: 0.5}}
dynamics: {f: {a: 0.5*a + 0.1*b, b: 0.5*b, c: 0.3*c}, Q: {c: 1e-6}}
measurements: {m: {z: {z: {h: "HH", std: 0}, y: {h: a, std: 0.1}}}}
filter: {FORM}
code: {unroll: UNROLL, log_likelihood: true}
"""


@pytest.mark.parametrize("h", ["b*c + a", "a + 0.1*b**2"])
def test_a_variance_that_fades_away_locks_nothing_out(h):
    """An exact component of what is known ever better, until its innovation variance has no reciprocal in a float."""
    forms = [f"type: {kind}, covariance: {form}" for kind in ("ekf", "ekf2") for form in ("sqrt", "ud")]
    specs = {(form, unroll): loads(DECAYING.replace("HH", h).replace("FORM", form).replace("UNROLL", unroll))
             for form in forms for unroll in ("full", "none")}  # fmt: skip
    for case, kf in built(specs).items():
        random = np.random.default_rng(0)
        for k in range(150):
            assert kf.predict() < ERROR, (case, k)
            assert kf.update("m", 0.1 * random.normal(size=2)) < ERROR, (case, k)
        assert np.isfinite([kf.nis, kf.log_likelihood]).all()
