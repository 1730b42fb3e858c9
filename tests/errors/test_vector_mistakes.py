"""Mistakes in vectors and rotations: each named once, where it stands, with both shapes and a cure."""

from __future__ import annotations

from pathlib import Path

import pytest

from kfgen.errors import SpecError
from kfgen.spec import loads

BASE = Path(__file__).with_name("valid").joinpath("inertial.yaml").read_text()
STAR = "z: {q: {h: q, std: [0.01, 0.01, 0.03], error: reference}}"
Q = ", std: [0.1, 0.1, 1], error: body, reset: true"
MAG = '{b: {h: "unrotate(q, field)",'
H, Y = "h: yaw(q)", "measurements.heading.z.yaw.h"

# what is changed into what; where the mistake is (a text in the changed line); its key; words of message and cure
MISTAKES = [
    # f
    ("q: gyro - bg - wg", "q: 1", "1}", "dynamics.f.q", "`f` of `q` is a 3-vector, not a number; write the body's"),
    ("q: gyro - bg - wg", "q: q", "q}", "dynamics.f.q", "`f` of `q` is a 3-vector, not a quaternion"),
    ("q: gyro - bg - wg", "q_x: 1", "q_x", "dynamics.f.q_x", "name it whole, `q`"),
    ("f: {p: v,", "f: {p: [1, 2],", "[1, 2]", "dynamics.f.p",
     "a 3-vector, not a 2-vector; write a list: p_n, p_e, p_d"),
    ("f: {p: v,", "f: {p: v, p_n: 1,", "p_n: 1", "dynamics.f.p_n",
     "given here, and by another name too; write a vector"),
    # expressions
    (H, "h: q + 1", "+ 1", Y, "`+` joins a quaternion and a number"),
    (H, "h: sin(q)", "sin", Y, "wants numbers, not a quaternion; write one part of it, `q.w`"),
    (H, "h: q**2", "**2", Y, "`**` wants numbers, not a quaternion"),
    (H, 'h: "where(q < 1, 1, 2)"', "< 1", Y, "`<` wants numbers, not a quaternion"),
    (H, "h: norm(q*v)", "*v", Y, "joins a quaternion and a 3-vector; write `rotate(q, v)`"),
    (H, 'h: "norm(rotate(v, q))"', "rotate", Y, "wants a quaternion, not a 3-vector; write the q"),
    (H, 'h: "dot(p, [1, 2])"', "dot", Y, "`dot` joins a 3-vector and a 2-vector; write both"),
    (H, 'h: "norm(cross(p, [1, 2]))"', "cross", Y, "wants 3-vectors, not a 3-vector and a 2-v"),
    (H, "h: norm(1)", "norm", Y, "`norm` wants a vector, not a number; write `abs(a)`"),
    (H, "h: v.w", ".w", Y, "without a part `w`; its parts: `v.x`, `v.y`, `v.z`"),
    (H, "h: p.x", ".x", Y, "without a part `x`; its parts: `p.n`, `p.e`, `p.d`"),
    (H, 'h: "v[3]"', "[3]", Y, "the index 3 is beyond a 3-vector; indices go from 0 to 2"),
    (H, 'h: "v[0, 1]"', "[0, 1]", Y, "two indices of a 3-vector; write `v[0]`"),
    (H, 'h: "norm([[1, 2], [3]] @ v)"', "[[1", Y, "row 2 of the matrix has 1 entries, row 1 has 2"),
    (H, 'h: "norm([1, [3]])"', "[1,", Y, "the list mixes a number (entry 1) and a 1-vector"),
    (H, "h: norm(v + 1)", "+ 1", Y, "joins a 3-vector and a number; a number has to be"),
    (H, 'h: "norm([[1, 2]] @ v)"', "@", Y, "a 1 x 2 matrix and a 3-vector: 2 columns, 3 rows"),
    (H, "h: v @ v", "@", Y, "`@` joins a 3-vector and a 3-vector; write `dot(a, b)`"),
    (H, "h: 1/v", "/v", Y, "`/` divides a number by a 3-vector; divide by a number"),
    (H, "h: v*v", "*v", Y, "joins a 3-vector and a 3-vector; write `dot(a, b)`"),
    (H, "h: rotation(q)", "rotation(q)", Y, "is a 3 x 3 matrix; write a number, a vector or"),
    (H, "h: norm(cross(v, p))", "norm", Y, "quote the expression"),
    (H, "h: v[0]", "[0]", "", "quote an expression with brackets"),
    # declarations
    ("init: 0, std: 0.01", "init: [0, 0], std: 0.01", "[0, 0]", "states.bg.init",
     "is a 3-vector, not a 2-vector; write a list"),
    ("bg: {vector: 3, init: 0", "bg: {init: [0, 0, 0]", "[0, 0", "states.bg.init",
     "a number, not a 3-vector; declare `vector: 3`"),
    ("bg: {vector: 3", "bg: {vector: 0", "0,", "states.bg.vector",
     "`vector` is 0; write a whole number between 1 and 100"),
    ("bg: {vector: 3", "bg: {vector: []", "[]", "states.bg.vector", "a vector without parts; write `vector: 3`"),
    ("bg: {vector: 3", "bg: {vector: 101", "101", "states.bg.vector", "write a whole number between 1 and 100"),
    ("[n, e, d]", "[n, n, d]", "[n, n", "states.p.vector", "the part `n` of `p` stands twice; name each once"),
    ("[n, e, d]", "[n, 'e f', d]", "[n, 'e", "states.p.vector", "is not made of letters, digits"),
    ("std: [5, 5, 8]", "std: [5, -5, 8]", "-5", "states.p.std[1]", "-5 is negative; write 5"),
    ("  bg: {vector", "  v_x: {init: 0, std: 1}\n  bg: {vector", "v:", "states.v", "`v_x` is already that of a state"),
    ("  bg: {vector", "  q_rx: {init: 0, std: 1}\n  bg: {vector", "q:", "states.q",
     "`q_rx` is already that of a state"),
    ("range: [-35, 35]", "range: [[-35, -35], 35]", "[-35, -35]", "inputs.gyro.range[0]",
     "is a 3-vector, not a 2-vector"),
    ("wg: {vector: 3, root_density: 0.005}", "wg: {vector: 3, root_density: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}", "[[1",
     "noise.wg.root_density", "a 3-vector, not a 3 x 3 matrix; a full covariance is written as `density`"),
    ("constants: {", "constants: {m: [0, [1], 2], ", "[0", "constants.m",
     "the list mixes a number (entry 1) and a 1-vector"),
    # quaternions
    ("init: [1, 0, 0, 0]", "init: 1", "1,", "states.q.init", "is a quaternion, not a number; write a list: q_w, q_x"),
    ("init: [1, 0, 0, 0]", "init: [1, 0, 0]", "[1", "states.q.init", "is a quaternion, not a 3-vector"),
    ("init: [1, 0, 0, 0]", "init: [1e-4, 0, 0, 0]", "1e-4", "states.q.init[0]",
     "norm of the initial quaternion is 0.0001"),
    ("init: [1, 0, 0, 0]", "init: [0, 0, 0, 0]", "0,", "states.q.init[0]", "norm of the initial quaternion is 0,"),
    (Q, ", std: [1, 1, 1, 1]", "[1, 1, 1, 1]", "states.q.std",
     "a 3-vector, not a 4-vector; write a list: q_rx, q_ry, q_rz"),
    (Q, "", "q:", "states.q", "one of `std`, `var` is missing"),
    (Q, ", std: 1, var: 1", "var", "states.q.var", "`std` and `var` are given both"),
    (Q, ", std: 1, bounds: [-1, 1]", "bounds", "states.q.bounds", "`bounds` does not go with a quaternion"),
    (Q, ", std: 1, unit: deg", "deg", "states.q.unit", "of a quaternion is in rad, not in 'deg'; convert"),
    (Q, ", std: 1, vector: 4", "vector", "states.q.vector", "a quaternion has its own parts"),
    ("std: 0.5, unit: m/s}", "std: 0.5, error: body}", "error", "states.v.error",
     "is not used by a state of kind `real`"),
    ("outputs:", "filter: {type: kf}\noutputs:", "type", "filter.type", "does not go with the quaternion `q`"),
    ("outputs:", "filter: {type: ekf2}\noutputs:", "type", "filter.type", "choose `type: ekf`, `iekf` or `ukf`"),
    ("outputs:", "filter: {type: iekf}\noutputs:", "reset", "states.q.reset", "`reset` does not go with an iekf"),
    # covariances and options
    ("Q: {bg: 1e-9*dt}", "Q: {bgg: 1}", "bgg", "dynamics.Q.bgg", "there is no state `bgg`; did you mean `bg`?"),
    ("Q: {bg: 1e-9*dt}", "Q: {q_w: 1}", "q_w", "dynamics.Q.q_w", "name it whole, `q`, or q_rx, q_ry, q_rz"),
    ("Q: {bg: 1e-9*dt}", "Q: {bg: [1, 2]}", "[1, 2]", "dynamics.Q.bg", "`Q` of `bg` is a 3-vector, not a 2-vector"),
    ("Q: {bg: 1e-9*dt}", "Q: {bg: [[1, 2, 0], [0, 1, 0], [0, 0, 1]]}", "0, 1, 0", "dynamics.Q.bg[1][0]",
     "is not symmetric"),
    ("Q: {bg: 1e-9*dt}", "Q: 'diag([1, 2])'", "Q", "dynamics.Q",
     "is 2 x 2, but there are 12 error coordinates; write 12"),
    ("Q: {bg: 1e-9*dt}", "Q: 1", "1", "dynamics.Q", "a matrix is wanted here, not a number; write a list of rows"),
    ("noise:", "covariances: [[q_w, v_x, 0.01]]\nnoise:", "q_w", "covariances[0][0]", "or q_rx, q_ry, q_rz"),
    ("noise:", "covariances: [[p, v, [1, 1]]]\nnoise:", "[1, 1]", "covariances[0][2]",
     "a 3 x 3 matrix, not a 2-vector"),
    ("outputs:", "filter: {update: joseph, consider: [q_w]}\noutputs:", "q_w", "filter.consider[0]",
     "name it whole, `q`"),
    ("outputs:", "filter: {variance_floor: {p: [1, 2]}}\noutputs:", "[1, 2]", "filter.variance_floor.p",
     "a 3-vector, not a 2-"),
    ("outputs:", "filter: {gain_limit: '[1, 2]', update: joseph}\noutputs:", "'[1", "filter.gain_limit",
     "a number is wanted here, not a 2-vector; write one number"),
    ("dt: 0.01", "dt: g", "g", "dt", "a number is wanted here, not a 3-vector"),
    # measured quaternions
    (STAR, "z: {q: {h: q}}, R: 'diag([1, 1, 1, 1])'", "R", "measurements.star.R",
     "there are 3 coordinates of the residual"),
    (STAR, "z: {q: {h: q, std: 1, residual: z - h}}", "residual", "measurements.star.z.q.residual",
     "is a quaternion: its res"),
    (STAR, "z: {q: {h: q, std: 1, kind: angle}}", "kind", "measurements.star.z.q.kind",
     "whose residual is a rotation already"),
    (H, "h: yaw(q), error: body", "error", "measurements.heading.z.yaw.error", "is no quaternion, and has no `error`"),
    (MAG + " std: 0.5}}}", MAG + ' std: 0.5, residual: "cross(z, h)"}}}',
     '"cross', "measurements.mag.z.b.residual", "uses other parts of z or h than its own"),
    ("std: [1, 1, 2], unit: m}}}", "var: [[1, 2, 0], [2, 1, 0], [0, 0, 2]]}}}", "1", "measurements.gnss.z.p.var[0][0]",
     "is not positive semidefinite"),
    # initialize
    ("triad(acc,", "triad(accc,", "accc", "initialize[0].states.q", "no component of ahrs `accc`; did you mean `acc`?"),
    ("1], field)", "1], v)", "v)", "initialize[0].states.q", "the state `v` may not stand in"),
    ("states: {p: p}", "states: {p: '[1, 2]'}", "'[1", "initialize[1].states.p", "`p` is a 3-vector, not a 2-vector"),
    ('"triad(acc, b, [0, 0, 1], field)"', "acc", "acc}", "initialize[0].states.q",
     "`q` is a quaternion, not a 3-vector"),
    ("states: {p: p}", "states: {q_w: 1}", "q_w", "initialize[1].states.q_w", "name it whole, `q`"),
    ("var: {p: 25}", "var: {q_w: 25}", "q_w", "initialize[1].var.q_w", "or q_rx, q_ry, q_rz"),
    ("states: {p: p}", "states: {pp: p}", "pp", "initialize[1].states.pp", "there is no state `pp`; did you mean `p`?"),
    ("outputs:\n", "outputs:\n  o: {value: v}\n  o_x: {value: 1}\n", "o_x", "outputs.o_x", "`o_x` is there twice"),
    # sensor inputs and outputs
    ("norm(v)", "norm(gyro)", "gyro", "outputs.speed.value", "the input `gyro` may not stand in"),
    ("norm(v)", "norm(sat)", "sat", "outputs.speed.value", "`sat` is an input of the sensor `pr`"),
    ('h: "unrotate(q, field)", std: 0.5}}}\n  ahrs', 'h: "unrotate(q, sat)", std: 0.5}}}\n  ahrs', "sat",
     "measurements.mag.z.b.h",
     "is an input of the sensor `pr`"),
    ("sigma: {unit: m}", "sigma: {unit: m}, rho: {}", "rho", "measurements.pr.inputs.rho",
     "has the name of a component"),
    # definitions
    ("dynamics:", "let: {aa: 'bb + [1, 2, 3]', bb: aa}\ndynamics:", "'bb", "let.aa",
     "in a circle: aa -> bb -> aa; break"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "at", "key", "words"), MISTAKES)
def test_one_mistake_one_line(old: str, new: str, at: str, key: str, words: str) -> None:
    assert old in BASE
    text = BASE.replace(old, new, 1)
    with pytest.raises(SpecError) as caught:
        loads(text, "f")
    (mistake,) = caught.value.mistakes
    line = text.split("\n")[mistake.place.line - 1]
    assert f"{mistake.message}; {mistake.hint}".find(words) >= 0, f"{mistake.message}; {mistake.hint}"
    assert mistake.place.path == key
    assert line[mistake.place.column - 1 :].lstrip("\"'").startswith(at.lstrip("\"'")), line[mistake.place.column - 1 :]


VALID = [
    (H, "h: yaw"), ("bg: {vector: 3, init: 0, std: 0.01", "bg: {vector: 3, init: '[0, 0, 0]', var: [1, 2, 3]"),
    ("Q: {bg: 1e-9*dt}", "Q: {q: 1e-6, bg_x: 1, v: [1, 2, 3], p: [[1, 0, 0], [0, 1, 0.5], [0, 0.5, 1]]}"),
    ("noise:", "covariances: [[q_rx, v_x, 0.01], [p, v, [1, 1, 1]], [q, bg, 1e-6]]\nnoise:"),
    ("outputs:", "filter: {update: joseph, consider: [bg, q, p_n], variance_floor: {q: 1e-9, p: [1, 2, 3]}}\noutputs:"),
    ("outputs:", "fixed: {scale: {p: 64, q: 1, v: [1, 2, 4]}}\ncode: {compensated: [p, v_x]}\noutputs:"),
    ("dynamics:", "let: {later: first + g, first: v}\ndynamics:"),
    ("std: [1, 1, 2], unit: m}}}", "var: [[1, 0.1, 0], [0.1, 1, 0], [0, 0, 2]]}}}"),
    ("wg: {vector: 3, root_density: 0.005}", "wg: {vector: 3, density: [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]}"),
    ("std: 0.5, unit: m/s}", "var: [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]}"),
    (STAR, "z: {q: {h: 'conjugate(q)*from_rotation_vector([0, 0, 1])'}}, R: 'diag([1, 1, 2])'"),
    ("range: [-35, 35]", "range: [[-35, -35, -30], 35]"), ("init: [1, 0, 0, 0]", "init: 'from_euler(0.1, 0, 2)'"),
    ("states: {p: p}, var: {p: 25}", "states: {p: p, v: 0}, var: {p: [1, 2, 3], q: 0.1, v_x: 4}"),
    ("  bg: {vector", "  yaw: {init: 0, std: 1}\n  norm: {init: 0, std: 1}\n  bg: {vector"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new"), VALID)
def test_what_is_allowed(old: str, new: str) -> None:
    text = BASE.replace(old, new, 1)
    if new == "h: yaw":
        text = text.replace("  bg: {vector", "  yaw: {init: 0, std: 1}\n  bg: {vector")
    assert loads(text, "f").name
