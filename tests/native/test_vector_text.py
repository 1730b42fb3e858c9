"""A spec with vectors emits what the same spec with its parts written out emits, but for the hash of the file."""

from __future__ import annotations

import re

import pytest

from kfgen.generate import generate
from kfgen.spec import loads

# with vectors, and written out by hand
PAIRS = {
    "track": (
        """kfgen: 1
name: track
constants: {tau: 2, k: "[0.5, 0.25]"}
parameters:
  drag: {vector: 2, value: [0.1, 0.2], range: [0, 1]}
dt: 0.1
states:
  p: {vector: [n, e], init: [1, 2], std: [1, 2], unit: m, range: [-100, 100]}
  v: {vector: 2, init: 0, std: 0.5, unit: m/s, bounds: [[-9, -8], 9]}
inputs: {u: {vector: 2, unit: m/s^2, range: [-3, 3]}}
noise: {w: {vector: 2, std: [0.1, 0.2]}}
let: {a: u - drag*v.x + w}
dynamics:
  f: {p: p + dt*v + 0.5*dt**2*a, v: v + dt*a}
  Q: {p: [1e-4, 2e-4], v_y: 1e-5}
measurements:
  gps: {z: {p: {h: p, std: [0.3, 0.4], unit: m}}, gate: {probability: 0.999}}
  radar: {z: {r: {h: norm(p), std: 0.5}, d: {h: "dot(p, v)/norm(p)", std: tau/10},
              q: {h: "k*dot(v, [1, 2])", var: [0.1, 0.2]}}}
filter: {covariance: full, update: joseph, consider: [v], variance_floor: {p: 1e-6}}
""",
        """kfgen: 1
name: track
constants: {tau: 2, k_x: 0.5, k_y: 0.25}
parameters:
  drag_x: {value: 0.1, range: [0, 1]}
  drag_y: {value: 0.2, range: [0, 1]}
dt: 0.1
states:
  p_n: {init: 1, std: 1, unit: m, range: [-100, 100]}
  p_e: {init: 2, std: 2, unit: m, range: [-100, 100]}
  v_x: {init: 0, std: 0.5, unit: m/s, bounds: [-9, 9]}
  v_y: {init: 0, std: 0.5, unit: m/s, bounds: [-8, 9]}
inputs: {u_x: {unit: m/s^2, range: [-3, 3]}, u_y: {unit: m/s^2, range: [-3, 3]}}
noise: {w_x: {std: 0.1}, w_y: {std: 0.2}}
let: {a_x: u_x - drag_x*v_x + w_x, a_y: u_y - drag_y*v_x + w_y}
dynamics:
  f: {p_n: p_n + dt*v_x + 0.5*dt**2*a_x, p_e: p_e + dt*v_y + 0.5*dt**2*a_y, v_x: v_x + dt*a_x, v_y: v_y + dt*a_y}
  Q: {p_n: 1e-4, p_e: 2e-4, v_y: 1e-5}
measurements:
  gps: {z: {p_n: {h: p_n, std: 0.3, unit: m}, p_e: {h: p_e, std: 0.4, unit: m}}, gate: {probability: 0.999}}
  radar: {z: {r: {h: "sqrt(p_n**2 + p_e**2)", std: 0.5},
              d: {h: "(p_n*v_x + p_e*v_y)/sqrt(p_n**2 + p_e**2)", std: tau/10},
              q_x: {h: "k_x*(v_x*1 + v_y*2)", var: 0.1}, q_y: {h: "k_y*(v_x*1 + v_y*2)", var: 0.2}}}
filter: {covariance: full, update: joseph, consider: [v_x, v_y], variance_floor: {p_n: 1e-6, p_e: 1e-6}}
""",
    ),
    "angles": (
        """kfgen: 1
name: angles
dt: 0.1
states:
  th: {vector: [r, p, y], init: [0.1, 0, 3], std: 0.2, unit: rad, kind: angle}
  b: {vector: 3, init: 0, std: [0.1, 0.2, 0.3], range: [-1, 1]}
inputs: {gyro: {vector: 3, unit: rad/s}}
noise: {w: {vector: 3, std: 0.01}}
dynamics: {f: {th: th + dt*(gyro - b + w)}, Q: {b: 1e-5}}
measurements:
  acc:
    noise: {eps: {vector: 2, std: [0.1, 0.2]}}
    z: {a: {h: "[sin(th.p)*(1 + eps.x), -cos(th.p)*sin(th.r) + eps.y]"}}
  mag: {z: {y: {h: th.y, std: 0.1, kind: angle}, s: {h: "where(th.y > 0, [th.r, b.x], [b.y, b.z])", std: 1}}}
filter: {type: ukf, covariance: full}
""",
        """kfgen: 1
name: angles
dt: 0.1
states:
  th_r: {init: 0.1, std: 0.2, unit: rad, kind: angle}
  th_p: {init: 0, std: 0.2, unit: rad, kind: angle}
  th_y: {init: 3, std: 0.2, unit: rad, kind: angle}
  b_x: {init: 0, std: 0.1, range: [-1, 1]}
  b_y: {init: 0, std: 0.2, range: [-1, 1]}
  b_z: {init: 0, std: 0.3, range: [-1, 1]}
inputs: {gyro_x: {unit: rad/s}, gyro_y: {unit: rad/s}, gyro_z: {unit: rad/s}}
noise: {w_x: {std: 0.01}, w_y: {std: 0.01}, w_z: {std: 0.01}}
dynamics:
  f: {th_r: th_r + dt*(gyro_x - b_x + w_x), th_p: th_p + dt*(gyro_y - b_y + w_y), th_y: th_y + dt*(gyro_z - b_z + w_z)}
  Q: {b_x: 1e-5, b_y: 1e-5, b_z: 1e-5}
measurements:
  acc:
    noise: {eps_x: {std: 0.1}, eps_y: {std: 0.2}}
    z: {a_x: {h: "sin(th_p)*(1 + eps_x)"}, a_y: {h: "-cos(th_p)*sin(th_r) + eps_y"}}
  mag: {z: {y: {h: th_y, std: 0.1, kind: angle},
            s_x: {h: "where(th_y > 0, th_r, b_y)", std: 1},
            s_y: {h: "where(th_y > 0, b_x, b_z)", std: 1}}}
filter: {type: ukf, covariance: full}
""",
    ),
    "chain": (
        """kfgen: 1
name: chain
constants: {A: [[0, 1, 0], [0, 0, 1], [0, 0, -0.5]], c: [1, 0.5, 0]}
dt: 0.05
states: {x: {vector: 3, init: [1, 0, 0], var: [[2, 0.1, 0], [0.1, 1, 0], [0, 0, 1]]}}
noise: {w: {vector: 2, var: [[0.1, 0.02], [0.02, 0.2]]}}
dynamics: {form: continuous, integrator: exact, f: {x: "A @ x + [0, w.x, w.y]"}}
measurements: {s: {z: {y: {h: "[dot(c, x), x[0]]", var: [[0.2, 0.01], [0.01, 0.3]]}}}}
filter: {type: kf, covariance: sqrt}
""",
        """kfgen: 1
name: chain
dt: 0.05
states: {x_x: {init: 1, var: 2}, x_y: {init: 0, var: 1}, x_z: {init: 0, var: 1}}
covariances: [[x_x, x_y, 0.1]]
noise: {w_x: {}, w_y: {}}
noise_covariance: [[0.1, 0.02], [0.02, 0.2]]
dynamics: {form: continuous, integrator: exact, f: {x_x: x_y, x_y: x_z + w_x, x_z: -0.5*x_z + w_y}}
measurements: {s: {z: {y_x: {h: x_x + 0.5*x_y}, y_y: {h: x_x}}, R: [[0.2, 0.01], [0.01, 0.3]]}}
filter: {type: kf, covariance: sqrt}
""",
    ),
    "bank": (
        """kfgen: 1
name: bank
dt: 0.1
states:
  p: {vector: 2, init: [1, 2], std: [1, 2]}
  v: {vector: 2, init: 0, std: 0.5}
measurements: {gps: {z: {p: {h: p, std: 0.3}}}}
imm:
  modes:
    cv:
      noise: {w: {vector: 2, std: [0.1, 0.2]}}
      dynamics: {f: {p: p + dt*v, v: v + w}}
    turning:
      states: {p: {init: [1, 2.5], std: 2}, v: {init: 0, var: [[1, 0.1], [0.1, 1]]}}
      let: {turned: "[0.9*v.x - 0.3*v.y, 0.3*v.x + 0.9*v.y]"}
      dynamics: {f: {p: p + dt*turned, v: turned}, Q: {v: "[[0.3, 0.1], [0.1, 0.3]]*0.1"}}
  transition: "[[0.9, 0.1], [0.2, 0.8]]"
""",
        """kfgen: 1
name: bank
dt: 0.1
states:
  p_x: {init: 1, std: 1}
  p_y: {init: 2, std: 2}
  v_x: {init: 0, std: 0.5}
  v_y: {init: 0, std: 0.5}
measurements: {gps: {z: {p_x: {h: p_x, std: 0.3}, p_y: {h: p_y, std: 0.3}}}}
imm:
  modes:
    cv:
      noise: {w_x: {std: 0.1}, w_y: {std: 0.2}}
      dynamics: {f: {p_x: p_x + dt*v_x, p_y: p_y + dt*v_y, v_x: v_x + w_x, v_y: v_y + w_y}}
    turning:
      states: {p_x: {init: 1, std: 2}, p_y: {init: 2.5, std: 2}, v_x: {init: 0, var: 1}, v_y: {init: 0, var: 1}}
      covariances: [[v_x, v_y, 0.1]]
      let: {turned_x: 0.9*v_x - 0.3*v_y, turned_y: 0.3*v_x + 0.9*v_y}
      dynamics:
        f: {p_x: p_x + dt*turned_x, p_y: p_y + dt*turned_y, v_x: turned_x, v_y: turned_y}
        Q: [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0.03, 0.01], [0, 0, 0.01, 0.03]]
  transition: [[0.9, 0.1], [0.2, 0.8]]
""",
    ),
}


def emitted(text: str, scalar: str) -> dict[str, str]:
    files = generate(loads(text, "f"), scalar)
    return {name: re.sub(r"\b[0-9a-f]{64}\b", "(hash)", content) for name, content in files.items()}


@pytest.mark.parametrize("scalar", ["float", "q16.16"])
@pytest.mark.parametrize("name", PAIRS)
def test_the_same_code(name: str, scalar: str) -> None:
    with_vectors, by_hand = PAIRS[name]
    assert emitted(with_vectors, scalar) == emitted(by_hand, scalar)
