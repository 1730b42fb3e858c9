"""Specs of the problems that filters are measured on, as YAML text; and models that use one feature each.

Names, sizes and numbers of the first group are those of the performance budgets.
"""

from __future__ import annotations

VEHICLE4 = """
kfgen: 1
name: vehicle4
scalar: double
dt: 1/3
constants: {s: 1.394}
states:
  px: {init: 0, std: s, unit: m}
  py: {init: 0, std: s, unit: m}
  v: {init: 5, var: "2*sqrt(2)*s**2/dt**2", unit: m/s}
  th: {init: 0.3, var: 3.14, unit: rad}
dynamics:
  form: discrete
  f: {px: px + dt*v*cos(th), py: py + dt*v*sin(th)}
  Q: {v: 25*dt, th: 0.25*dt}
measurements:
  gnss:
    z:
      x: {h: px, var: s**2/3, unit: m}
      y: {h: py, var: s**2/3, unit: m}
filter: {type: ekf}
"""


def _cv4(name: str) -> str:
    return f"""
kfgen: 1
name: {name}
scalar: double
dt: 0.1
states:
  px: {{init: 50, var: 0.1}}
  py: {{init: 0, var: 0.1}}
  vx: {{init: 10, var: 0.1}}
  vy: {{init: 0, var: 0.1}}
dynamics:
  form: discrete
  f: {{px: px + dt*vx, py: py + dt*vy}}
  Q: {{px: 1e-6, py: 1e-6, vx: 1e-6, vy: 1e-6}}
measurements:
  gnss:
    z:
      x: {{h: px, var: 400}}
      y: {{h: py, var: 400}}
filter: {{type: ekf}}
"""


CV4 = _cv4("cv4")
CV4_OUTLIERS = _cv4("cv4_outliers")

IMM3 = """
kfgen: 1
name: imm3
scalar: double
dt: 0.1
states:
  p: {init: 0, var: 0.1}
  v: {init: 0, var: 0.1}
  a: {init: 0, var: 0.1}
measurements:
  position:
    z:
      z: {h: p, var: 1}
imm:
  modes:
    cv:
      dynamics:
        form: discrete
        f: {p: p + v*dt}
        Q: {p: 1e-6, v: 1e-6, a: 1e-6}
      filter: {type: ekf}
    ca:
      dynamics:
        form: discrete
        f: {p: p + (v + a*dt/2)*dt, v: v + a*dt}
        Q: {p: 1e-6, v: 1e-6, a: 1e-6}
      filter: {type: ekf}
  transition: [[0.95, 0.05], [0.05, 0.95]]
  mu0: [0.5, 0.5]
"""

BALL = """
kfgen: 1
name: ball
scalar: double
dt: 0.05
states:
  s: {init: 0, var: 1, range: [-200, 200]}
  v: {init: 0, var: 1, range: [-200, 200]}
  g: {init: 6, var: 1, range: [-200, 200]}
dynamics:
  form: discrete
  f: {s: s + v*dt + g*dt**2/2, v: v + g*dt}
  Q: {s: 1e-4, v: 1e-4, g: 1e-4}
measurements:
  height:
    z:
      z: {h: s, var: 0.25, range: [-200, 200]}
filter: {type: ekf}
"""


def chain(n: int) -> str:
    """n/2 coupled oscillators with a cubic spring; every other position is measured."""
    m = n // 2
    states = [f"  p{i}: {{init: 0.1, var: 1}}" for i in range(1, m + 1)]
    states += [f"  v{i}: {{init: 0, var: 1}}" for i in range(1, m + 1)]
    f = [f"    p{i}: p{i} + dt*v{i}" for i in range(1, m + 1)]
    for i in range(1, m + 1):
        left = f"p{i - 1} - " if i > 1 else "-"
        right = f" + p{i + 1}" if i < m else ""
        f.append(f"    v{i}: v{i} + dt*(-p{i} + 0.3*({left}2*p{i}{right}) - 0.05*v{i} - 0.1*p{i}**3)")
    Q = [f"    p{i}: 1e-6" for i in range(1, m + 1)] + [f"    v{i}: 1e-4" for i in range(1, m + 1)]
    z = [f"      z{i}: {{h: p{i}, var: 0.01}}" for i in range(1, m + 1, 2)]
    lines = [
        "kfgen: 1", f"name: chain{n}", "scalar: double", "dt: 0.05", "states:", *states,
        "dynamics:", "  form: discrete", "  f:", *f, "  Q:", *Q,
        "measurements:", "  position:", "    z:", *z, "filter: {type: ekf}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


SIX_SENSORS = """
kfgen: 1
name: six_sensors
scalar: double
dt: 1
states:
  x: {init: 0, var: 1e6}
dynamics:
  form: discrete
  f: {x: x}
measurements:
  level:
    z:
      z1: {h: x, var: 1}
      z2: {h: x, var: 1}
      z3: {h: x, var: 1}
      z4: {h: x, var: 1}
      z5: {h: x, var: 1}
      z6: {h: x, var: 1}
filter: {type: kf}
"""

# a target that moves straight on, seen by a radar; the bearing wraps
RADAR = """
kfgen: 1
name: radar
scalar: double
dt: 0.5
states:
  px: {init: -100, std: 10, unit: m}
  py: {init: 20, std: 10, unit: m}
  vx: {init: 0, std: 5, unit: m/s}
  vy: {init: -5, std: 5, unit: m/s}
dynamics:
  form: discrete
  f: {px: px + dt*vx, py: py + dt*vy}
  Q: {vx: 0.25, vy: 0.25}
measurements:
  radar:
    z:
      range: {h: "sqrt(px**2 + py**2)", std: 2, unit: m}
      bearing: {h: "atan2(py, px)", std: 0.02, unit: rad, kind: angle}
    gate: {probability: 0.9999}
filter: {type: ekf}
"""

# attitude quaternion and gyro bias; gravity and the magnetic field are seen in body axes
ATT = """
kfgen: 1
name: att
scalar: double
dt: 0.01
constants: {g: 9.81, mx: 0.5, mz: 0.8}
parameters:
  sigma_gyro: {value: 0.01, unit: rad/s}
states:
  q0: {init: 1, std: 0.1}
  q1: {init: 0, std: 0.1}
  q2: {init: 0, std: 0.1}
  q3: {init: 0, std: 0.1}
  bx: {init: 0, std: 0.05, unit: rad/s}
  by: {init: 0, std: 0.05, unit: rad/s}
  bz: {init: 0, std: 0.05, unit: rad/s}
inputs:
  wx: {unit: rad/s}
  wy: {unit: rad/s}
  wz: {unit: rad/s}
noise:
  nx: {std: sigma_gyro}
  ny: {std: sigma_gyro}
  nz: {std: sigma_gyro}
let:
  ox: wx - bx + nx
  oy: wy - by + ny
  oz: wz - bz + nz
dynamics:
  form: discrete
  f:
    q0: q0 + dt/2*(-q1*ox - q2*oy - q3*oz)
    q1: q1 + dt/2*(q0*ox + q2*oz - q3*oy)
    q2: q2 + dt/2*(q0*oy - q1*oz + q3*ox)
    q3: q3 + dt/2*(q0*oz + q1*oy - q2*ox)
  Q: {bx: 1e-10, by: 1e-10, bz: 1e-10}
measurements:
  imu:
    z:
      ax: {h: 2*(q1*q3 - q0*q2)*g, std: 0.2}
      ay: {h: 2*(q2*q3 + q0*q1)*g, std: 0.2}
      az: {h: (q0**2 - q1**2 - q2**2 + q3**2)*g, std: 0.2}
      mgx: {h: mx*(q0**2 + q1**2 - q2**2 - q3**2) + 2*mz*(q1*q3 - q0*q2), std: 0.02}
      mgy: {h: 2*mx*(q1*q2 - q0*q3) + 2*mz*(q2*q3 + q0*q1), std: 0.02}
      mgz: {h: 2*mx*(q1*q3 + q0*q2) + mz*(q0**2 - q1**2 - q2**2 + q3**2), std: 0.02}
filter: {type: ekf}
"""

# a unicycle in continuous form: correlated noise enters through the heading, wheel noise scales with speed,
# the rate error is a density; run-time dt; two sensors, one with noise inputs and a full R
NOISE_INPUTS = """
kfgen: 1
name: noise_inputs
scalar: double
dt: {nominal: 0.1, min: 0.001, max: 1}
parameters: {slip: 0.1}
states:
  px: {init: 0, std: 1}
  py: {init: 0, std: 1}
  th: {init: 3, std: 0.2, unit: rad, kind: angle}
  d: {init: 0, std: 0.05, bounds: [-0.2, 0.2]}
inputs: {v: {unit: m/s}, w: {unit: rad/s}}
noise:
  nv: {std: slip}
  nw: {std: 0.2*sqrt(dt)}
  nd: {root_density: 0.01}
dynamics:
  form: continuous
  f:
    px: v*(1 + nv)*cos(th)
    py: v*(1 + nv)*sin(th)
    th: w + d + nw
    d: -d/100 + nd
  integrator: rk4
  substeps: 2
  Q: {px: 1e-4*dt, py: 1e-4*dt}
measurements:
  gnss:
    z:
      x: {h: px}
      y: {h: py}
    R: [[0.25, 0.1], [0.1, 0.25 + 0.01*v**2]]
    partial: true
  compass:
    z:
      heading: {h: th + e1*cos(th), std: 0.05, unit: rad, kind: angle}
    noise: {e1: {std: 0.1}}
    gate: {probability: 0.999, reset_after: 3}
filter: {type: ekf}
"""


def one_state(
    dynamics: str, extra: str = "", z: str = "{h: x, var: 1}", dt: str = "0.1", states: str = ""
) -> str:
    """A filter of the state x (init 1, variance 0.5) and one sensor, around the lines that are given."""
    return f"""
kfgen: 1
name: one
scalar: double
dt: {dt}
states:
  x: {{init: 1, var: 0.5}}
{states}
{extra}
dynamics:
{dynamics}
measurements:
  s:
    z:
      z: {z}
filter: {{type: ekf}}
"""


ALL = {
    "vehicle4": VEHICLE4,
    "cv4": CV4,
    "cv4_outliers": CV4_OUTLIERS,
    "ball": BALL,
    "chain4": chain(4),
    "chain8": chain(8),
    "chain16": chain(16),
    "six_sensors": SIX_SENSORS,
    "radar": RADAR,
    "att": ATT,
    "noise_inputs": NOISE_INPUTS,
}
