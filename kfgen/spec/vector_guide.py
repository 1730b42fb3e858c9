"""Vectors and rotations, as the language's reference prints them: what a vector is, the functions, an example."""

from __future__ import annotations

from kfgen.spec.tree import VECTOR_FUNCTIONS

VECTOR_NOTES = {
    "dot": "`dot(a, b)`: the inner product, a number",
    "cross": "`cross(a, b)`: of 3-vectors",
    "norm": "`norm(a)`: the length; its derivative at 0 is 0",
    "normalize": "`normalize(a)`: a / |a|, 0 where that is 0; a quaternion stays one",
    "skew": "`skew(a)`: the matrix of `cross(a, ...)`",
    "transpose": "`transpose(A)`",
    "diag": "`diag(a)`: a diagonal matrix; `diag(A)`: the diagonal of one",
    "outer": "`outer(a, b)`: a b^T",
    "conjugate": "`conjugate(q)`: the inverse rotation",
    "rotate": "`rotate(q, v)`: R(q) v, from body to reference",
    "unrotate": "`unrotate(q, v)`: R(q)^T v, from reference to body",
    "rotation": "`rotation(q)`: the matrix R(q)",
    "rotation_vector": "`rotation_vector(q)`: axis times angle, at most pi long; of q and -q the same",
    "from_rotation_vector": "`from_rotation_vector(v)`: the quaternion of it",
    "roll": "`roll(q)`",
    "pitch": "`pitch(q)`",
    "yaw": "`yaw(q)`: the angles z-y-x (yaw first, about z), in rad",
    "from_euler": "`from_euler(roll, pitch, yaw)`: the quaternion of them",
    "rotation_between": "`rotation_between(a, b)`: the shortest rotation that takes the direction a to that of b; none "
    "where one is 0, half a turn about some axis across a where they are opposite",
    "triad": "`triad(a, b, ra, rb)`: takes the direction a to ra, and b into the half plane of ra and rb (gravity and "
    "magnetic field, measured and known)",
}

EXAMPLE = """
kfgen: 1
name: ins
constants: {g: [0, 0, -9.80665]}
parameters:
  field: {vector: 3, value: [22, 0, -42], unit: uT}
dt: 0.01
states:
  p:  {vector: [n, e, d], init: 0, std: [5, 5, 8], unit: m}
  v:  {vector: 3, init: 0, std: 0.5, unit: m/s}
  q:  {kind: quaternion, init: [1, 0, 0, 0], std: [0.1, 0.1, 1]}
  bg: {vector: 3, init: 0, std: 0.01, unit: rad/s}
inputs:
  gyro:  {vector: 3, unit: rad/s, range: [-35, 35]}
  accel: {vector: 3, unit: m/s^2, range: [-160, 160]}
noise:
  wg: {vector: 3, root_density: 0.005}
  wa: {vector: 3, root_density: 0.05}
dynamics:
  form: continuous
  f: {p: v, v: "rotate(q, accel - wa) + g", q: gyro - bg - wg}
  Q: {bg: 1e-9*dt}
measurements:
  gnss: {z: {p: {h: p, std: [1, 1, 2], unit: m}}}
  mag:  {z: {b: {h: "unrotate(q, field)", std: 0.5, unit: uT}}}
  range:
    inputs: {anchor: {vector: 3, unit: m}}
    z: {r: {h: norm(anchor - p), std: 0.3, unit: m}}
  still: {z: {down: {h: "unrotate(q, -g)", std: 1}, b: {h: "unrotate(q, field)", std: 0.5}}}
outputs:
  yaw_deg: {value: yaw(q)*180/pi, unit: deg}
  speed: {value: norm(v), unit: m/s}
initialize:
  - {from: still, states: {q: "triad(down, b, [0, 0, 1], field)"}}
  - {from: gnss, states: {p: p}, var: {p: 25}}
""".strip()


def vectors() -> str:
    """The section of the reference."""
    notes = "\n".join(f"* {VECTOR_NOTES[name]}" for name in VECTOR_FUNCTIONS)
    return f"""## Vectors and rotations

States, inputs, noises, parameters and inputs of sensors are vectors where they say `vector: 3` (parts `v_x`, `v_y`,
`v_z`; of 2 `x`, `y`; else `1`, `2`, ...) or name their parts, `vector: [n, e, d]`; constants, definitions, outputs and
components where their expression is one. A vector is its parts, in order: numbers in x, in C, in logs and messages.
Vectors and parts share the name space. In expressions `v.x`, `v[0]` and `v_x` are the same, and so are `M[0, 1]` and
`M_1_2`. A list means the same quoted or not (in `{{...}}` quote an expression with a comma or a bracket).

Every value has a shape: a number, a vector, a matrix, a quaternion. `+ -` join the same shapes, `*` and `/` take a
number on one side, `M @ v` and `A @ B` multiply matrices, `[a, b]` of numbers builds a vector, of vectors a matrix of
rows. `min max abs where table` work part by part; a number among vectors stands for all parts. Every other function
wants numbers. In keys one number stands for all parts, a vector gives each, and a matrix a full covariance (`var`,
`density`, Q of a vector). Keys that name a state take a vector, or a part.

A state of `kind: quaternion` is a rotation from body to reference, four numbers `q_w`, `q_x`, `q_y`, `q_z`
(Hamilton), and an error of three, `q_rx`, `q_ry`, `q_rz` in rad, for which std, var, P0, covariances, Q, limits of
variances and `consider` stand. `q*r` composes. Continuous f gives the body's angular rate, discrete f the new
quaternion. A component whose h is a quaternion takes four numbers; its residual is a rotation. Where a quaternion is
wanted, four numbers will do. With kf and ekf2 there are none.

The names of these functions are functions only before `(`; a state may be called `yaw`:

{notes}

```yaml
{EXAMPLE}
```"""
