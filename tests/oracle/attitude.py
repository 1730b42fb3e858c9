"""Small specs with a quaternion, put together in Python."""

from __future__ import annotations

from kfgen.spec.types import Component, Dynamics, Filter, Input, Noise, Rotation, Sensor, Spec, State, Step
from tests.oracle.formulas import expressions, formula

PARTS = ("q_w", "q_x", "q_y", "q_z")
ERRORS = ("q_rx", "q_ry", "q_rz")


def expression(v):
    return formula(v).expression


def rotation(std, error="body", reset=True):
    return Rotation("q", PARTS, ERRORS, error, reset, tuple(expression(float(s) ** 2) for s in std))


def turning(init, std, error="body", reset=True, beside=None, f=None, sensors=(), inputs=(), noise=None, dt=0.1,
            form="continuous", integrator="rk4", substeps=1, Q=None, chosen=None, **changes):  # fmt: skip
    """A quaternion q, and beside it numbers: name -> (init, std); f: name -> formula; noise: name -> variance, or
    (density, True)."""
    states = [State(name, expression(float(v)), None, kind="quaternion") for name, v in zip(PARTS, init, strict=True)]
    states += [State(name, expression(float(at)), expression(float(s) ** 2))
               for name, (at, s) in (beside or {}).items()]  # fmt: skip
    noises = [Noise(name, expression(v[0] if isinstance(v, tuple) else v), isinstance(v, tuple))
              for name, v in (noise or {}).items()]  # fmt: skip
    f = {name: formula(each).expression for name, each in (f or {}).items()}
    dynamics = Dynamics(form, f, integrator, substeps, {name: expression(v) for name, v in (Q or {}).items()})
    given = {"name": "turning", "file": "turning.yaml", "sha256": "", "scalar": "double", "dt": Step(expression(dt)),
             "states": tuple(states), "inputs": tuple(Input(name) for name in inputs), "noise": tuple(noises),
             "dynamics": dynamics, "measurements": tuple(sensors), "rotations": (rotation(std, error, reset),),
             "filter": chosen or Filter("ekf", "full", "joseph")}  # fmt: skip
    return Spec(**(given | changes))


def sensor(name, formulas, variances, **options):
    """Of numbers: component -> formula, and their variances."""
    parts = (Component(key, formula(h).expression, expression(v))
             for (key, h), v in zip(formulas.items(), variances, strict=True))  # fmt: skip
    return Sensor(name, tuple(parts), **options)


def star(q, std, error="body", **options):
    """A sensor of a quaternion."""
    parts = (Component(name, h, kind="quaternion") for name, h in expressions(PARTS, q).items())
    return Sensor("star", tuple(parts), rotations=(rotation(std, error),), **options)
