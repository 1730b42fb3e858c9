"""The model of a spec for the second oracle: one step, one look of a sensor, with derivatives, from plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm

from tests.campaign.jets import Array, Jet, Names, constant, evaluate, variables


class UnfollowedError(Exception):
    """What the oracle does not follow."""


@dataclass
class Local:
    """A function at a point: its value (m), Jacobian (m, k) and Hessians (m, k, k) in states and noises; the
    covariance of the noises Qw, R of a sensor, and the process noise that its density adds."""

    value: Array
    J: Array
    H: Array
    Qw: Array
    R: Array
    added: Array


def wrapped(d: Array, periods: list[float | None]) -> Array:
    """Each entry with a period P into (-P/2, P/2]."""
    return np.array([v if P is None else v - P * np.ceil(v / P - 0.5) for v, P in zip(d, periods, strict=True)])


def period(entry: dict[str, Any]) -> float | None:
    kind = entry.get("kind", "real")
    return 2 * np.pi if kind == "angle" else float(kind["periodic"]) if isinstance(kind, dict) else None


class Model:
    """f, h, Q, R of a spec without modes."""

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        self.states = list(data["states"])
        self.n = len(self.states)
        self.inputs = list(data.get("inputs", {}))
        self.nu = len(self.inputs)
        self.noises: dict[str, Any] = data.get("noise", {})
        if any(key in data for key in ("noise_covariance", "initialize")):
            raise UnfollowedError("noise_covariance, initialize")
        if any("inputs" in sensor for sensor in data["measurements"].values()):
            raise UnfollowedError("inputs of sensors")
        self.dense = any("density" in w or "root_density" in w for w in self.noises.values())
        self.sensor_noises = any("noise" in s for s in data["measurements"].values())
        self.parameters = {
            name: float(entry["value"] if isinstance(entry, dict) else entry)
            for name, entry in data.get("parameters", {}).items()
        }
        dt = data.get("dt", 1.0)
        self.nominal = float(dt["nominal"] if isinstance(dt, dict) else dt)
        self.periods = [period(state) for state in data["states"].values()]
        self.dynamics = data.get("dynamics", {})
        self.continuous = self.dynamics.get("form") == "continuous"

    def names(self, x: Any, u: Any = (), dt: Any = None, t: float = 0.0, **others: Any) -> Names:
        values: dict[str, Any] = {**self.parameters, "dt": self.nominal if dt is None else dt, "t": t, **others}
        values |= dict(zip(self.states, x, strict=True))
        values |= dict(zip(self.inputs, u, strict=False))
        known = Names(values, {**self.data.get("constants", {}), **self.data.get("let", {})})
        return known

    def start(self) -> tuple[Array, Array]:
        """x0 and P0."""
        names = self.names([0.0] * self.n)
        entries = self.data["states"].values()
        x = np.array([evaluate(state["init"], names) for state in entries])
        if "P0" in self.data:
            P = np.array([[evaluate(v, names) for v in row] for row in self.data["P0"]])
        else:
            P = np.diag([variance(state, names) for state in entries])
            for a, b, value in self.data.get("covariances", ()):
                i, j = self.states.index(a), self.states.index(b)
                P[i, j] = P[j, i] = evaluate(value, names)
        return self.settled(x), P

    def settled(self, x: Array) -> Array:
        """Within bounds and wrapped."""
        x = x.copy()
        for i, state in enumerate(self.data["states"].values()):
            if "bounds" in state:
                x[i] = np.clip(x[i], *state["bounds"])
        return wrapped(x, self.periods)

    def Q(self, x: Array, u: Array, dt: float, t: float) -> Array:
        """The additive process noise at the prior state."""
        Q, names = self.dynamics.get("Q", {}), self.names(x, u, dt, t)
        if isinstance(Q, list):
            return np.array([[evaluate(v, names) for v in row] for row in Q])
        return np.diag([float(evaluate(Q.get(name, 0.0), names)) for name in self.states])

    def advance(self, x: list[Any], w: list[Any], u: Array, dt: float, t: float) -> list[Any]:
        """The step of f with states and noises of any kind of number."""
        f = self.dynamics.get("f", {})

        def rate(x: list[Any]) -> list[Any]:
            names = self.names(x, u, dt, t, **dict(zip(self.noises, w, strict=True)))
            default = [0.0] * self.n if self.continuous else x
            return [evaluate(f[s], names) if s in f else default[i] for i, s in enumerate(self.states)]

        if not self.continuous:
            return rate(x)
        substeps, integrator = self.dynamics.get("substeps", 1), self.dynamics.get("integrator", "rk4")
        h = dt / substeps
        for _ in range(substeps):
            k1 = rate(x)
            if integrator == "euler":
                x = [a + h * k for a, k in zip(x, k1, strict=True)]
                continue
            k2 = rate([a + h / 2 * k for a, k in zip(x, k1, strict=True)])
            if integrator == "midpoint":
                x = [a + h * k for a, k in zip(x, k2, strict=True)]
                continue
            k3 = rate([a + h / 2 * k for a, k in zip(x, k2, strict=True)])
            k4 = rate([a + h * k for a, k in zip(x, k3, strict=True)])
            x = [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(x, k1, k2, k3, k4, strict=True)]
        return x

    def step(self, x: Array, u: Array, dt: float, t: float) -> Local:
        """One step at x with w = 0."""
        k = self.n + len(self.noises)
        joint = variables([*x, *np.zeros(len(self.noises))])
        names = self.names(x, u, dt, t)
        Qw = np.diag([0.0 if self._is_dense(w) else variance(w, names) for w in self.noises.values()])
        Qc = np.diag([density(w, names) if self._is_dense(w) else 0.0 for w in self.noises.values()])
        if self.continuous and self.dynamics.get("integrator") == "exact":
            return self._exact(joint, u, dt, t, Qw, Qc)
        value = self.advance(joint[: self.n], joint[self.n :], u, dt, t)
        local = localised(value, k, Qw, np.zeros((0, 0)))
        if self.dense:
            once = Model({**self.data, "dynamics": {**self.dynamics, "form": "discrete"}})
            rates = once.advance(joint[: self.n], joint[self.n :], u, dt, t)
            listed = [
                rate if s in self.dynamics.get("f", {}) else 0.0 for s, rate in zip(self.states, rates, strict=True)
            ]
            G = localised(listed, k, Qw, Qw).J[:, self.n :]
            local.added = G @ Qc @ G.T * dt
        return local

    def _exact(self, joint: list[Jet], u: Array, dt: float, t: float, Qw: Array, Qc: Array) -> Local:
        """x' = A x + B w + c over dt (Van Loan 1978 for the density)."""
        n, k = self.n, len(joint)
        once = Model({**self.data, "dynamics": {**self.dynamics, "form": "discrete"}})
        rates = once.advance(joint[:n], joint[n:], u, dt, t)
        rates = [rate if s in self.dynamics.get("f", {}) else 0.0 for s, rate in zip(self.states, rates, strict=True)]
        local = localised(rates, k, Qw, Qw)
        A, B, x = local.J[:, :n], local.J[:, n:], np.array([j.v for j in joint[:n]])
        c = local.value - A @ x
        big = np.zeros((k + 1, k + 1))
        big[:n, :n], big[:n, n:k], big[:n, k] = A, B, c
        E = expm(big * dt)
        local.value, local.J = E[:n, :n] @ x + E[:n, k], E[:n, :k]
        loan = np.zeros((2 * n, 2 * n))
        loan[:n, :n], loan[:n, n:], loan[n:, n:] = -A, B @ Qc @ B.T, A.T
        V = expm(loan * dt)
        local.added = V[n:, n:].T @ V[:n, n:]
        return local

    @staticmethod
    def _is_dense(w: dict[str, Any]) -> bool:
        return "density" in w or "root_density" in w

    def look(self, sensor: str, x: Array, u: Array, t: float) -> Local:
        """h and R of a sensor at x, with its own noises at 0."""
        entry = self.data["measurements"][sensor]
        own = entry.get("noise", {})
        joint = variables([*x, *np.zeros(len(own))])
        names = self.names(joint[: self.n], u, None, t, **dict(zip(own, joint[self.n :], strict=True)))
        value = [evaluate(component["h"], names) for component in entry["z"].values()]
        flat = self.names(x, u, None, t)
        if "R" in entry:
            R = np.array([[evaluate(v, flat) for v in row] for row in entry["R"]])
        else:
            R = np.diag([variance(component, flat) for component in entry["z"].values()])
        return localised(value, len(joint), np.diag([variance(e, flat) for e in own.values()]), R)

    def residual(self, sensor: str, z: Array, h: Array, used: list[int]) -> Array:
        """z - h of the components in use, wrapped."""
        components = list(self.data["measurements"][sensor]["z"].values())
        if any("residual" in component for component in components):
            raise UnfollowedError("residual")
        return wrapped(z[used] - h, [period(components[i]) for i in used])


def localised(value: list[Any], k: int, Qw: Array, R: Array) -> Local:
    jets = [each if isinstance(each, Jet) else constant(each, k) for each in value]
    Qw = np.asarray(Qw, dtype=float).reshape(len(Qw), len(Qw))
    return Local(
        np.array([j.v for j in jets]), np.array([j.g for j in jets]).reshape(len(jets), k),
        np.array([j.H for j in jets]).reshape(len(jets), k, k), Qw, R, np.zeros((len(jets),) * 2),
    )  # fmt: skip


def variance(entry: dict[str, Any], names: Names) -> float:
    if "var" in entry:
        return float(evaluate(entry["var"], names))
    return float(evaluate(entry.get("std", 0.0), names)) ** 2


def density(entry: dict[str, Any], names: Names) -> float:
    if "density" in entry:
        return float(evaluate(entry["density"], names))
    return float(evaluate(entry["root_density"], names)) ** 2
