"""Random models as plain data: states, dynamics, noises, sensors that the language allows.

What they have in common: f does not run away, and Q and R are sums of squares whatever stands in them, so that
NOT_POSITIVE is never right (but for dt <= 0 and negative weights of points).
"""

from __future__ import annotations

import random
from typing import Any

Data = dict[str, Any]

SCALARS = ("double", "double", "double", "float", "float", "float", "q16.16", "q12.20", "q20.12")
TYPES = ("kf", "ekf", "ekf", "iekf", "ekf2", "ukf", "ukf", "imm")
CURVED = (
    "sin({a})", "{a}*{b}/(1 + {b}**2)", "tanh({a} - {b})", "where({a} > {b} and {a} < 2, 0.5*{a}, 0.2*{b})",
    "table({a}, [-2, -0.5, 0.5, 3], [1, -0.5, 0.25, 2])", "atan2({a}, 2 + {b}**2)", "hypot({a}, {b})",
    "sqrt(1 + {a}**2)", "max({a}, 0.3*{b})", "abs({a})", "exp(-{a}**2)", "log(1 + {b}**2)", "{a}**2/(1 + {a}**2)",
)  # fmt: skip


class Draw:
    """One spec being drawn; what one part needs to know of another stands in the attributes."""

    def __init__(self, dice: random.Random) -> None:
        self.dice = dice
        self.scalar = dice.choice(SCALARS)
        self.fixed = self.scalar[0] == "q"
        self.type = dice.choice(TYPES)
        self.linear = self.type == "kf"
        self.n = min(dice.choice((1, 2, 2, 3, 3, 4, 4, 5, 6, 8)), 4 if self.fixed or self.type == "imm" else 8)
        self.continuous = self.chance(0.3)
        self.run_time = self.chance(0.3)
        spread = 0.0 if self.fixed else dice.choice((0, 0, 1, 2))
        self.scales = [10 ** round(dice.uniform(-spread, spread)) for _ in range(self.n)]
        self.states = [f"x{i}" for i in range(self.n)]
        self.kinds = [self._kind(i) for i in range(self.n)]
        self.inputs = [f"u{i}" for i in range(dice.choice((0, 0, 1, 2)))]
        self.parameters = [f"p{i}" for i in range(dice.choice((0, 0, 1, 2)))]
        self.noises = [f"w{i}" for i in range(dice.choice((0, 1, 2)))]

    def chance(self, probability: float) -> bool:
        return self.dice.random() < probability

    def _kind(self, i: int) -> Any:
        if self.scales[i] != 1 or not self.chance(0.2):
            return None
        return self.dice.choice(("angle", {"periodic": 5}))

    def number(self, low: float, high: float) -> float:
        return float(f"{self.dice.uniform(low, high):.3g}")

    def unitless(self, i: int) -> str:
        scale = self.scales[i]
        return self.states[i] if scale == 1 else f"({self.states[i]}/{scale:g})"

    def curve(self) -> str:
        a, b = (self.unitless(self.dice.randrange(self.n)) for _ in "ab")
        return self.dice.choice(CURVED).format(a=a, b=b)

    # the parts

    def spec(self, name: str) -> Data:
        data: Data = {"kfgen": 1, "name": name, "scalar": self.scalar}
        data["dt"] = {"nominal": 0.1, "min": 0.02, "max": 0.5} if self.run_time else 0.1
        if self.parameters:
            data["parameters"] = {p: {"value": self.number(0.5, 1.5), "range": [0.25, 2]} for p in self.parameters}
        data["states"] = {name: self.state(i) for i, name in enumerate(self.states)}
        if self.n > 1 and self.chance(0.25):
            self.correlate(data)
        if self.inputs:
            data["inputs"] = {u: {"range": [-2, 2]} for u in self.inputs}
        if self.noises:
            data["noise"] = {w: self.noise() for w in self.noises}
            if len(self.noises) == 2 and self.chance(0.2):
                data["noise"] = {w: {} for w in self.noises}
                data["noise_covariance"] = [[0.04, 0.02], [0.02, 0.03]]
        if not self.linear and self.chance(0.4):
            data["let"] = {"l0": self.curve(), "l1": "0.5*l0 + 0.1"}
        data["dynamics"] = self.dynamics("let" in data)
        sensors = [f"m{k}" for k in range(self.dice.choice((1, 1, 2, 3)))]
        data["measurements"] = {sensor: self.sensor(sensor, "let" in data) for sensor in sensors}
        # bounds would make a steady gain wrong, and an angle has its own
        if not self.fixed and self.chance(0.15) and self.kinds[0] is None and self.type != "kf":
            data["states"]["x0"]["bounds"] = [-4 * self.scales[0], 5 * self.scales[0]]
        return data

    def state(self, i: int) -> Data:
        scale = self.scales[i]
        deviation = self.dice.choice((0, 0.3, 1, 1, 1 if self.fixed else 30))
        state: Data = {"init": self.number(-1, 1) * scale, "std": deviation * scale}
        if self.kinds[i]:
            state |= {"kind": self.kinds[i], "std": min(deviation, 0.5)}
        elif self.fixed:
            state["range"] = [-20 * scale, 20 * scale]
        return state

    def correlate(self, data: Data) -> None:
        stds = [state["std"] for state in data["states"].values()]
        if self.chance(0.5):
            if stds[0] and stds[1]:
                data["covariances"] = [["x0", "x1", 0.5 * stds[0] * stds[1]]]
            return
        rank = self.n if self.chance(0.6) else self.dice.randrange(1, self.n + 1)
        A = [[self.dice.randrange(-4, 5) / 4 * self.scales[i] for _ in range(rank)] for i in range(self.n)]
        data["P0"] = [
            [sum(a * b for a, b in zip(A[i], A[j], strict=True)) for j in range(self.n)] for i in range(self.n)
        ]
        for state in data["states"].values():
            del state["std"]

    def noise(self) -> Data:
        value: Any = self.number(0.05, 0.3)
        if self.parameters and self.chance(0.3):
            value = f"{value}*p0"
        if self.continuous and self.chance(0.6):
            return {"density": f"({value})**2"} if self.chance(0.5) else {"root_density": value}
        return {"std": value}

    def dynamics(self, let: bool) -> Data:
        f: Data = {}
        for i, name in enumerate(self.states):
            if not self.chance(0.9):
                continue  # it stays as it is
            terms = [f"{-0.6 if self.continuous else self.number(0.5, 0.98):g}*{name}"]
            if self.kinds[i]:
                terms = [] if self.continuous else [name]
            for j in range(self.n):
                if j != i and self.chance(0.3):
                    share = self.number(-0.4, 0.4) / max(self.n - 1, 1) * self.scales[i]
                    terms.append(f"{share:.3g}*{self.unitless(j)}")
            if not self.linear and self.chance(0.5):
                terms.append(f"{0.05 * self.scales[i]:g}*{self.curve()}")
            if let and self.chance(0.4):
                terms.append(f"{0.05 * self.scales[i]:g}*l1")
            if self.inputs and self.chance(0.4):
                terms.append(f"{0.1 * self.scales[i]:g}*{self.dice.choice(self.inputs)}")
            if self.parameters and self.chance(0.3):
                terms.append(f"{0.1 * self.scales[i]:g}*{self.dice.choice(self.parameters)}")
            if self.run_time and not self.continuous and self.chance(0.4):
                terms.append(f"{0.2 * self.scales[i]:g}*dt")
            if self.noises and self.chance(0.7):
                terms.append(f"{0.3 * self.scales[i]:g}*{self.disturbance(i)}")
            if not self.linear and self.chance(0.1):
                terms.append(f"{0.05 * self.scales[i]:g}*sin(t)")
            f[name] = " + ".join(terms) or "0"
        made: Data = {"form": "continuous" if self.continuous else "discrete", "f": f}
        if self.continuous:
            kinds = (
                ("euler", "midpoint", "rk4", "exact") if self.linear and self.n < 4 else ("euler", "midpoint", "rk4")
            )
            made["integrator"] = self.dice.choice(kinds)
            if self.chance(0.2) and made["integrator"] != "exact":
                made["substeps"] = 2
        made["Q"] = self.process_noise()
        return made

    def disturbance(self, i: int) -> str:
        w = self.dice.choice(self.noises)
        if self.linear or self.chance(0.6):
            return w
        return self.dice.choice((f"{w}*(1 + 0.2*{self.unitless(i)})", f"sin({w})", f"{w}*{self.noises[0]}"))

    def process_noise(self) -> Any:
        if self.n > 1 and self.chance(0.2):
            L = [[self.dice.randrange(-2, 3) / 20 * self.scales[i] for _ in range(self.n)] for i in range(self.n)]
            return [[sum(a * b for a, b in zip(L[i], L[j], strict=True)) for j in range(self.n)] for i in range(self.n)]
        Q: Data = {}
        for i, name in enumerate(self.states):
            if self.chance(0.75):
                value: Any = self.dice.choice((0.001, 0.02, 0.2)) * self.scales[i] ** 2
                varied = [f"{value:g}*dt"]
                varied += [f"{value:g}*p0**2"] if self.parameters else []
                varied += [f"{value:g}*(1 + u0**2)"] if self.inputs and not self.fixed else []
                varied += [f"{value:g}*(1 + 0.1*{self.unitless(i)}**2)"] if not self.linear else []
                Q[name] = self.dice.choice(varied) if self.chance(0.4) else value
        return Q

    def sensor(self, name: str, let: bool) -> Data:
        m = self.dice.choice((1, 1, 2, 3))
        sensor: Data = {"z": {}}
        full = m > 1 and self.chance(0.3)
        noise = f"e_{name}" if not self.fixed and self.chance(0.2) else ""
        own = f"k_{name}" if self.chance(0.2) else ""
        if own:
            sensor["inputs"] = {own: {"range": [-2, 2]}}
        for k in range(m):
            sensor["z"][f"z{k}"] = self.component(full, noise, let, own)
        if full:
            A = [[self.dice.randrange(-3, 4) / 8 for _ in range(m)] for _ in range(m)]
            R = [
                [sum(a * b for a, b in zip(A[i], A[j], strict=True)) + 0.1 * (i == j) for j in range(m)]
                for i in range(m)
            ]
            varied = self.parameters and self.chance(0.5)
            sensor["R"] = [[f"{v:g}*p0**2" if varied else v for v in row] for row in R]
        if noise:
            sensor["noise"] = {noise: {"std": 0.2}}
        if self.chance(0.3):
            sensor["gate"] = {"probability": self.dice.choice((0.9, 0.99, 0.9999))}
            if self.chance(0.4):
                sensor["gate"]["reset_after"] = self.dice.choice((1, 3))
        if self.chance(0.3):
            sensor["partial"] = True
        return sensor

    def component(self, full: bool, noise: str, let: bool, own: str) -> Data:
        i = self.dice.randrange(self.n)
        if self.kinds[i] and self.chance(0.6):
            component: Data = {"h": self.states[i], "kind": self.kinds[i]}
        else:
            h = [f"{self.dice.choice((1, 1, 0.5, -2))}*{self.unitless(i)}"]
            if self.n > 1 and self.chance(0.4):
                h.append(f"0.5*{self.unitless((i + 1) % self.n)}")
            if not self.linear and self.chance(0.4):
                h.append(f"0.2*{self.curve()}")
            if let and self.chance(0.2):
                h.append("0.3*l0")
            if own and self.chance(0.7):
                h.append(f"0.3*{own}" if self.linear or self.chance(0.5) else f"0.2*{own}*{self.unitless(i)}")
            component = {"h": " + ".join(h)}
        if noise and self.chance(0.7):
            component["h"] += f" + {noise}" if self.linear or self.chance(0.5) else f" + 0.5*{noise}*{self.unitless(i)}"
        if not full:
            component["std"] = self.deviation()
        if not self.fixed and "kind" not in component and self.chance(0.06):
            component["residual"] = "where(abs(z - h) < 2, z - h, 1.5*(z - h))"
        if self.fixed and "kind" not in component:
            component["range"] = [-60, 60]
        return component

    def deviation(self) -> Any:
        value: Any = self.dice.choice((0.1, 0.3, 1) if self.fixed else (0, 0.001, 0.1, 0.3, 1, 1))
        varied = []
        if self.parameters:
            varied.append(f"{value}*p0")
        if self.inputs and not self.fixed:
            varied.append(f"{value}*(1 + 0.3*u0**2)")
        if not self.linear and not self.fixed:
            varied.append(f"{value}*(1 + 0.1*{self.unitless(0)}**2)")
        return self.dice.choice(varied) if varied and self.chance(0.3) else value
