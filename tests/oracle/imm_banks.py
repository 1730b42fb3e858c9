"""Specs of banks, and an interacting multiple model made of single filters by their public interface alone."""

from __future__ import annotations

import math
import textwrap
from dataclasses import replace

import numpy as np

from kfgen.errors import NOWHERE
from kfgen.reference import ReferenceImm, Status, reference
from kfgen.reference.model import wrap
from kfgen.spec import loads
from kfgen.spec.expressions import parse
from kfgen.spec.tree import Expression
from kfgen.spec.types import Spec

# a vehicle on a plane, its heading near pi; one sensor with an angle, one that may lack components
TURNING = """
kfgen: 1
name: turning
scalar: double
dt: {nominal: 0.2, min: 0.01, max: 2}
parameters: {slip: 0.2}
states:
  px: {init: -30, std: 3, unit: m}
  py: {init: 5, std: 3, unit: m}
  v: {init: 4, std: 1, unit: m/s}
  th: {init: 3.05, std: 0.3, unit: rad, kind: angle}
  w: {init: 0.2, std: 0.2, unit: rad/s}
inputs: {a: {}}
noise:
  nv: {std: slip}
dynamics:
  form: discrete
  f: {px: px + dt*v*cos(th), py: py + dt*v*sin(th), v: v + dt*(a + nv), th: th + dt*w}
  Q: {th: 0.004, w: 0.002}
measurements:
  radar:
    z:
      range: {h: "sqrt(px**2 + py**2)", std: 0.5}
      bearing: {h: "atan2(py, px)", std: 0.02, kind: angle}
  gnss:
    z:
      x: {h: px, std: 1}
      y: {h: py, std: 1}
      speed: {h: v, std: 0.3}
    partial: true
"""

# keys of a mode that hold the turning rate at 0, by which the vehicle goes straight on
STRAIGHT = """
dynamics:
  form: discrete
  f: {px: px + dt*v*cos(th), py: py + dt*v*sin(th), v: v + dt*a, w: w/2}
  Q: {v: 0.002, th: 0.001, w: 0.001}
"""


def bank(top: str, modes: dict[str, str], transition: object, **more: object) -> str:
    """The text of a bank: the top's lines, keys of each mode as YAML, and more keys of `imm`."""
    lines = [top.rstrip("\n"), "imm:", "  modes:"]
    for name, keys in modes.items():
        lines += [f"    {name}:", textwrap.indent(keys.strip("\n"), "      ")]
    lines += [f"  {key}: {value}" for key, value in {"transition": transition, **more}.items()]
    return "\n".join(lines) + "\n"


def build(text: str) -> ReferenceImm:
    kf = reference(loads(text))
    assert isinstance(kf, ReferenceImm)
    return kf


def with_transition(text: str, rows: list[list[str]]) -> Spec:
    """The spec with a transition matrix of run-time formulas."""
    spec = loads(text)
    assert spec.imm is not None
    matrix = tuple(tuple(Expression(parse(entry), entry, NOWHERE) for entry in row) for row in rows)
    return replace(spec, imm=replace(spec.imm, transition=matrix))


def singles(text: str) -> list[Spec]:
    """Each mode of a bank as a spec of its own."""
    spec = loads(text)
    assert spec.imm is not None
    keys = ["states", "covariances", "P0", "noise", "noise_covariance", "let", "dynamics", "measurements", "filter"]
    return [replace(spec, imm=None, **{key: getattr(mode, key) for key in keys}) for mode in spec.imm.modes]


class HandBank:
    """Blom & Bar-Shalom 1988, line by line, around single filters that are told x and P before each predict."""

    def __init__(self, text: str, M, mu, floor: float = 1e-9) -> None:
        self.filters = [reference(spec) for spec in singles(text)]
        self.M, self.mu, self.floor = np.array(M, dtype=float), np.array(mu, dtype=float), floor
        self.nis = self.log_likelihood = 0.0

    def predict(self, u=None, dt=None) -> int:
        c = self.mu @ self.M
        mixed = [self.mixture(self.M[:, j] * self.mu / c[j]) for j in range(len(c))]
        status = 0
        for kf, (x, P) in zip(self.filters, mixed, strict=True):
            assert kf.set_state(x) == 0
            assert kf.set_covariance(P) == 0
            status |= kf.predict(u, dt)
        self.mu = c
        return status

    def update(self, sensor: str, z, u=None, mask=None) -> int:
        status = 0
        for kf in self.filters:
            status |= kf.update(sensor, z, u, mask)
        assert status < Status.ERROR
        logs = [math.log(m) + kf.log_likelihood for m, kf in zip(self.mu, self.filters, strict=True)]
        self.log_likelihood = float(np.logaddexp.reduce(logs))
        mu = np.maximum(np.exp(np.array(logs) - self.log_likelihood), self.floor)
        self.mu = mu / mu.sum()
        self.nis = min(kf.nis for kf in self.filters)
        return status

    def mixture(self, weights):
        periods = self.filters[0].model.periods
        middle = self.filters[int(np.argmax(weights))].x

        def around(x, base):
            d = x - base
            for i, period in periods.items():
                d[i] = wrap(float(d[i]), period)
            return d

        deviations = [around(kf.x, middle) for kf in self.filters]
        mean = sum(w * d for w, d in zip(weights, deviations, strict=True))
        P = sum(
            w * (kf.P + np.outer(d - mean, d - mean))
            for w, d, kf in zip(weights, deviations, self.filters, strict=True)
        )
        return self.filters[0].model.wrap(middle + mean), P

    @property
    def x(self):
        return self.mixture(self.mu)[0]

    @property
    def P(self):
        return self.mixture(self.mu)[1]
