"""Specs that reports are made of."""

from __future__ import annotations

LINEAR = """
kfgen: 1
name: linear
scalar: double
dt: 0.1
states:
  p: {init: 0, std: 2, unit: m}
  v: {init: 0, std: 1, unit: m/s}
  b: {init: 0, std: 0.5, unit: m}
noise: {w: {std: 0.3}}
dynamics:
  form: discrete
  f: {p: p + dt*v, v: v + w, b: 0.95*b}
  Q: {p: 0.001, b: 0.01}
measurements:
  fix: {z: {p: {h: p + b, std: 0.5, unit: m}}, gate: {probability: 0.9999}}
  slow: {z: {v: {h: v, std: 0.2}, b: {h: b, std: 0.3}}}
filter: {type: kf}
"""

BANK = """
kfgen: 1
name: bank
scalar: q16.16
dt: 0.1
states:
  p: {init: 0, std: 1, range: [-50, 50]}
  v: {init: 0, std: 1, range: [-8, 8]}
measurements: {fix: {z: {p: {h: "where(p < 0, p, 1.0*p)", std: 0.3}}}}
imm:
  modes:
    calm: {dynamics: {form: discrete, f: {p: p + dt*v, v: 0.9*v}, Q: {v: 0.01}}, filter: {type: ekf}}
    wild: {dynamics: {form: discrete, f: {p: p + dt*v, v: 0.9*v}, Q: {v: 0.4}}, filter: {type: ekf}}
  transition: [[0.95, 0.05], [0.1, 0.9]]
  mu0: [0.5, 0.5]
"""
