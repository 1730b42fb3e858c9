"""Specs whose every function reads something of its own, for tests of what a function refuses and what it leaves.

`idle` is in no formula but those of noises that nothing contains; `unused` is in none.
"""

from __future__ import annotations

from collections.abc import Iterator

FORMS = {
    "ud-bierman": "covariance: ud, update: bierman",
    "ud-joseph": "covariance: ud, update: joseph",
    "full-joseph": "covariance: full, update: joseph",
    "full-standard": "covariance: full, update: standard",
    "sqrt": "covariance: sqrt",
}
SIGMA = {
    "full": "covariance: full",
    "ud": "covariance: ud",
    "sequential": "covariance: ud, sequential: true",
    "sqrt": "covariance: sqrt",
}

SINGLE = """
kfgen: 1
name: poison
dt: DT
parameters: {sigma: 1, q: 0.1, rho: 0.1, idle: 1, gain: {value: 1, range: [0.5, 2]}}
inputs: {accel: {}, ease: {}, place: {}, spread: {}, unused: {}}
states: {p: {init: 0.3, std: 1}, v: {init: 0.1, std: 1}, b: {init: 0.2, std: 0.5}}
noise: {n: {std: q}, none: {std: idle}}
dynamics:
  f: {p: p + 0.1*v, v: "v + 0.1*(accel + n) + 0.01*BEND", b: 0.9*b}
  Q: [[0.01, "0.001*rho", 0], ["0.001*rho", 0.01, 0], [0, 0, "0.01*q**2"]]
measurements:
  one: {z: {p: {h: p, std: sigma}}}
  two: {z: {p: {h: p + gain*b, var: "exp(ease)"}, v: {h: "v + SEEN", std: 0.5}}MORE}
  full: {z: {p: {h: p}, v: {h: v + place*b}}, R: [[1, "0.2*rho"], ["0.2*rho", "1 + spread**2"]]PARTIAL}
  noisy: {z: {p: {h: "p + m*SCALE"}}, noise: {m: {std: sigma}, nothing: {std: idle}}}
  exact: {z: {p: {h: p + v, std: 0}, s: {h: p, std: 0.3}}}
filter: {FILTER}
code: {CODE}
"""

BANK = """
kfgen: 1
name: poison
dt: DT
parameters: {sigma: 1, stay: 0.9, q: 0.1, idle: 1}
inputs: {accel: {}, ease: {}, unused: {}}
states: {p: {init: 0.3, std: 1}, v: {init: 0.1, std: 1}}
measurements:
  one: {z: {p: {h: p, std: sigma}}GATE}
  two: {z: {p: {h: "p + 0.1*v**2", var: "exp(ease)"}, v: {h: v, std: 0.5}}PARTIAL}
imm:
  modes:
    cv: {dynamics: {f: {p: p + 0.1*v}, Q: {v: 0.01}}, filter: {FIRST}}
    ca:
      noise: {n: {std: q}}
      dynamics: {f: {p: p + 0.1*v, v: "v + 0.1*(accel + n)"}, Q: {p: 0.01}}
      filter: {SECOND}
  transition: [[stay, 1 - stay], [0.1, 0.9]]
  mu0: [0.5, 0.5]
code: {CODE}
"""

STEADY = """
kfgen: 1
name: poison
dt: 0.1
parameters: {bias: 0.1, idle: 1}
inputs: {accel: {}, place: {}, unused: {}}
states: {p: {init: 0.3, std: 1}, v: {init: 0.1, std: 1}}
dynamics: {f: {p: p + 0.1*v, v: v + 0.1*accel}, Q: {p: 0.01, v: 0.01}}
measurements:
  one: {z: {p: {h: p + bias + place, std: 1}}GATE}
  two: {z: {p: {h: p, std: 1}, v: {h: v, std: 0.5}}}
filter: {type: kf, gain: steady}
code: {log_likelihood: true}
"""

VARIANTS = {  # name -> what replaces the words in capitals
    "": {},
    "loops": {"CODE": "log_likelihood: true, unroll: none"},
    "gated": {
        "MORE": ", partial: true, gate: {probability: 0.999}", "PARTIAL": ", partial: true", "DT": "{nominal: 0.1}",
        "GATE": ", gate: {probability: 0.99}",
    },
}  # fmt: skip
CURVED = {"BEND": "sin(b)", "SEEN": "0.1*b**2", "SCALE": "(1 + 0.1*p)"}
LINEAR = {"BEND": "b", "SEEN": "0.1*b", "SCALE": "1"}
PLAIN = {"CODE": "log_likelihood: true", "MORE": "", "PARTIAL": "", "GATE": "", "DT": "0.1"}
OPTIONS = {
    "ekf": ("robust: chernodarov, adaptive: true",
            "innovation_floor: 1e-3, variance_floor: 1e-6, variance_ceiling: 1e4"),
    "ukf": ("sigma_points: {kind: cubature}",),
}  # fmt: skip
PAIRS = [
    ("type: ekf", "type: ekf"), ("type: ekf2", "type: iekf, covariance: full"),
    ("type: ekf, covariance: full, update: standard", "type: ekf, covariance: full"),
    ("type: ekf, covariance: sqrt", "type: ukf, covariance: full"), ("type: ekf", "type: ukf"),
]  # fmt: skip


def filled(text: str, *changes: dict[str, str]) -> str:
    words = {key: value for change in (PLAIN, *changes) for key, value in change.items()}
    for key, value in words.items():
        text = text.replace(key, value)
    return text


def cases(kind: str) -> Iterator[tuple[str, str]]:
    """Names and specs of one type of filter, in all its forms."""
    if kind == "steady":
        yield "steady", filled(STEADY)
        yield "steady-gated", filled(STEADY, VARIANTS["gated"])
        return
    if kind == "imm":
        for i, (first, second) in enumerate(PAIRS):
            for name, change in VARIANTS.items():
                yield f"imm-{i}-{name}", filled(BANK, change, {"FIRST": first, "SECOND": second})
        return
    shape = LINEAR if kind == "kf" else CURVED
    for form, keys in (SIGMA if kind == "ukf" else FORMS).items():
        base = f"type: {kind}, {keys}"
        for name, change in VARIANTS.items():
            yield f"{kind}-{form}-{name}", filled(SINGLE, change, shape, {"FILTER": base})
        for i, options in enumerate(OPTIONS.get(kind, ())):
            if not (kind == "ukf" and form == "sequential"):
                yield f"{kind}-{form}-{i}", filled(SINGLE, shape, {"FILTER": f"{base}, {options}"})
        if kind == "ukf" and form != "sequential":
            yield f"{kind}-{form}-adaptive", filled(SINGLE, shape, {"FILTER": f"{base}, adaptive: true"})
