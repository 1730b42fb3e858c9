"""The second oracle: dense filters in numpy, from the formulas of the textbooks and a spec's plain data alone.

It shares no code with kfgen, its reference included. What it does not follow raises UnfollowedError, which says what.
Bierman 1977; Bell & Cathey 1993 (iekf); Athans 1968 (second order); adaptive and robust as kfgen's language has them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import gammaincinv

from tests.campaign.jets import Array, Names, evaluate, variables
from tests.campaign.oracle_model import Model, UnfollowedError, wrapped

OK, GLITCH_SMALL, GLITCH_LARGE, ANOMALY, GATED = 0, 2, 4, 8, 16


def chi2(probability: float, k: int) -> float:
    return float(2 * gammaincinv(k / 2, probability))


def udu(P: Array) -> tuple[Array, Array]:
    """P = U diag(D) U^T, U unit upper triangular; a pivot within rounding of zero is zero."""
    n = len(P)
    P, U, D = P.copy(), np.eye(n), np.zeros(n)
    scale = 8 * n * np.finfo(float).eps * np.abs(P.diagonal())
    for j in reversed(range(n)):
        D[j] = P[j, j] if P[j, j] > scale[j] else 0.0
        if D[j]:
            U[:j, j] = P[:j, j] / D[j]
            P[:j, :j] -= D[j] * np.outer(U[:j, j], U[:j, j])
    return U, D


class Oracle:
    """One filter (no bank): x (n), P (n, n), and what it keeps between calls."""

    def __init__(self, data: dict[str, Any], options: dict[str, Any] | None = None) -> None:
        self.model = Model(data)
        self.options = data["filter"] if options is None else options
        for key in ("innovation_floor", "reject", "gain"):
            if self.options.get(key):
                raise UnfollowedError(key)
        self.type = self.options.get("type", "ekf")
        if "adapt_R" in self.options and (self.type not in ("kf", "ekf") or self.model.sensor_noises):
            raise UnfollowedError("adapt_R of other than an ekf")
        if self.type == "ekf2" and self.model.dense:
            raise UnfollowedError("density with ekf2")
        self.x, self.P = self.model.start()
        self.t, self.nis, self.log_likelihood = 0.0, 0.0, 0.0
        self.refused = dict.fromkeys(data["measurements"], 0)
        self.R: dict[str, Array] = {}
        self.error: dict[str, Array] = {}
        self.Q: Array | None = None

    # predict

    def predict(self, u: Array, dt: float) -> int:
        model, n = self.model, self.model.n
        step = model.step(self.x, u, dt, self.t)
        Q = model.Q(self.x, u, dt, self.t) if self.Q is None else self.Q
        x, F, G = step.value, step.J[:, :n], step.J[:, n:]
        P = F @ self.P @ F.T + Q + G @ step.Qw @ G.T + step.added
        if self.type == "ekf2":
            joint = np.zeros((n + len(step.Qw),) * 2)
            joint[:n, :n], joint[n:, n:] = self.P, step.Qw
            x, more = second_order(x, step.H, joint)
            P = P + more
        self.finish(x, P)
        self.t += dt
        return OK

    def finish(self, x: Array, P: Array) -> None:
        """Floors, ceilings, bounds, wrapping."""
        P = (P + P.T) / 2
        for i, name in enumerate(self.model.states):
            floor, ceiling = (self.limit(key, name) for key in ("variance_floor", "variance_ceiling"))
            if floor is not None:
                P[i, i] = max(P[i, i], floor)
            if ceiling is not None and P[i, i] > ceiling:
                c = np.sqrt(ceiling / P[i, i])
                P[i] *= c
                P[:, i] *= c
        self.x, self.P = self.model.settled(x), P

    def limit(self, key: str, name: str) -> float | None:
        value = self.options.get(key)
        value = value.get(name) if isinstance(value, dict) else value
        return None if value is None else float(evaluate(value, self.model.names(self.x)))

    # update

    def update(self, sensor: str, z: Array, u: Array, used: list[int]) -> int:
        if self.type == "iekf":
            return self.iterate(sensor, z, u, used)
        look = self.model.look(sensor, self.x, u, self.t)
        n = self.model.n
        h, H, R = look.value[used], look.J[used, :n], look.R[np.ix_(used, used)]
        if "adapt_R" in self.options:
            a = self.options["adapt_R"]
            e = self.error.get(sensor, np.zeros(len(z)))
            R = (1 - a) * self.R.get(sensor, look.R) + a * (H @ self.P @ H.T + np.outer(e, e))
        M = look.J[used, n:]
        R = R + M @ look.Qw @ M.T
        if self.type == "ekf2":
            joint = np.zeros((n + len(look.Qw),) * 2)
            joint[:n, :n], joint[n:, n:] = self.P, look.Qw
            h, more = second_order(h, look.H[used], joint)
            R = R + more
        y = self.model.residual(sensor, z, h, used)
        if not self.passes(sensor, plain(y, H, self.P, R)[0], len(used)):
            return GATED
        flags = self.gate_flag
        if "adapt_R" in self.options:
            self.R[sensor] = R
        x, P, more_flags = self.scalars(y, H, R)
        self.finish(x, P)
        if "adapt_R" in self.options:
            after = self.model.look(sensor, self.x, u, self.t)
            self.error[sensor] = self.model.residual(sensor, z, after.value[used], used)
        return flags | more_flags

    def passes(self, sensor: str, nis: float, m: int) -> bool:
        """The gate; what it says of an accepted vector stands in gate_flag."""
        self.nis, self.gate_flag = nis, OK
        gate = self.model.data["measurements"][sensor].get("gate")
        if gate is None or not nis > chi2(gate["probability"], m):
            self.refused[sensor] = 0
            return True
        if "reset_after" in gate and self.refused[sensor] >= gate["reset_after"]:
            self.refused[sensor], self.gate_flag = 0, ANOMALY
            return True
        self.refused[sensor] += 1
        return False

    def scalars(self, y: Array, H: Array, R: Array) -> tuple[Array, Array, int]:
        """Component by component after decorrelation by R = Ur Dr Ur^T, each residual corrected for those before."""
        options, n = self.options, self.model.n
        Ur, Dr = udu(R)
        y, H = np.linalg.solve(Ur, y), np.linalg.solve(Ur, H)
        P, dx, flags, moved = self.P.copy(), np.zeros(n), OK, np.zeros((n, n))
        held = [self.model.states.index(name) for name in options.get("consider", ())]
        threshold = adaptive_threshold(options, 1)
        likelihood = len(y) * np.log(2 * np.pi)
        for nu, h, r in zip(y, H, Dr, strict=True):
            nu = nu - h @ dx
            g = 1.0
            if options.get("robust", "none") != "none" and r > 0:
                e = nu / np.sqrt(r)
                psi, g = influence(options["robust"], e)
                nu = np.sqrt(r) * psi
                flags |= GLITCH_LARGE if g == 0 else GLITCH_SMALL if g < 1 else OK
            c = max(g * (h @ P @ h), 0.0)
            if not r + c > 0:
                continue
            if threshold is not None and c > 0 and g * nu**2 / threshold > r + c:
                P, flags = P * (1 + (g * nu**2 / threshold - r - c) / c), flags | ANOMALY
                c = g * (h @ P @ h)
            s = r + c
            K = P @ h / s
            K[held] = 0.0
            if "gain_limit" in options:
                K = np.clip(K, -options["gain_limit"], options["gain_limit"])
            A = np.eye(n) - g * np.outer(K, h)
            # with the gain that minimises it this is P - g P h^T h P / s; r g K K^T is the noise's share
            P = (
                A @ P @ A.T + g * r * np.outer(K, K)
                if g == 1 or held or "gain_limit" in options
                else (P - g * np.outer(P @ h, P @ h) / s)
            )
            dx += K * nu
            moved += np.outer(K * nu, K * nu)
            likelihood += nu**2 / s + np.log(s)
        self.log_likelihood = -likelihood / 2
        if "adapt_Q" in options:
            b = options["adapt_Q"]
            Q = self.model.Q(self.x, np.zeros(self.model.nu), self.model.nominal, self.t) if self.Q is None else self.Q
            self.Q = (1 - b) * Q + b * moved
        return self.x + dx, P, flags

    def iterate(self, sensor: str, z: Array, u: Array, used: list[int]) -> int:
        """Gauss-Newton: N linearisations of h, the first at the prior; the last gives P."""
        n, x = self.model.n, self.x.copy()
        held = [self.model.states.index(name) for name in self.options.get("consider", ())]
        limit = self.options.get("gain_limit", np.inf)
        for k in range(self.options.get("iterations", 3)):
            look = self.model.look(sensor, x, u, self.t)
            H, M = look.J[used, :n], look.J[used, n:]
            R = look.R[np.ix_(used, used)] + M @ look.Qw @ M.T
            y = self.model.residual(sensor, z, look.value[used], used)
            if k == 0 and not self.passes(sensor, plain(y, H, self.P, R)[0], len(used)):
                return GATED
            if held or limit < np.inf:
                raise UnfollowedError("an iekf whose gain is changed")
            back = wrapped(self.x - x, self.model.periods)
            S = H @ self.P @ H.T + R
            K = self.P @ H.T @ np.linalg.pinv(S, hermitian=True)
            x = self.model.settled(x + back + K @ (y - H @ back))
        _, self.log_likelihood = plain(y - H @ back, H, self.P, R)
        A = np.eye(n) - K @ H
        self.finish(x, A @ self.P @ A.T + K @ R @ K.T)
        return self.gate_flag


def second_order(value: Array, H: Array, P: Array) -> tuple[Array, Array]:
    """The mean and the addition to the covariance by the Hessians H (m, k, k), P (k, k)."""
    products = [each @ P for each in H]
    mean = value + 0.5 * np.array([np.trace(each) for each in products])
    return mean, 0.5 * np.array([[np.trace(a @ b) for b in products] for a in products]).reshape(len(H), len(H))


def plain(y: Array, H: Array, P: Array, R: Array) -> tuple[float, float]:
    """y^T S^-1 y and the log-likelihood, by scalars, so that directions without variance do not count."""
    Ur, Dr = udu(R)
    y, H, P = np.linalg.solve(Ur, y), np.linalg.solve(Ur, H), P.copy()
    dx, nis, likelihood = np.zeros(len(P)), 0.0, len(y) * np.log(2 * np.pi)
    for nu, h, r in zip(y, H, Dr, strict=True):
        nu, s = nu - h @ dx, h @ P @ h + r
        if s > 0:
            K = P @ h / s
            dx, P = dx + K * nu, P - np.outer(K, K) * s
            nis, likelihood = nis + nu**2 / s, likelihood + nu**2 / s + np.log(s)
    return float(nis), float(-likelihood / 2)


def influence(robust: Any, e: float) -> tuple[float, float]:
    """psi and its derivative at the normalised innovation e."""
    if robust == "chernodarov":
        return (e, 1.0) if abs(e) <= 3 else (e / 3, 1 / 3) if abs(e) <= 6 else (np.sign(e), 0.0)
    if robust == "huber" or robust.get("influence") == "huber":
        k = 1.345 if robust == "huber" else robust.get("k", 1.345)
        return float(np.clip(e, -k, k)), float(abs(e) <= k)
    psi = evaluate(robust["psi"], Names({"e": variables([e])[0]}, {}))
    return float(psi.v), max(float(psi.g[0]), 0.0)


def adaptive_threshold(options: dict[str, Any], m: int) -> float | None:
    """The chi-square threshold of `adaptive`, or None."""
    adaptive = options.get("adaptive")
    if not adaptive:
        return None
    default = 0.997 if options.get("robust", "none") != "none" else 0.999
    if isinstance(adaptive, dict) and "chi2" in adaptive:
        return float(adaptive["chi2"])
    return chi2(adaptive.get("probability", default) if isinstance(adaptive, dict) else default, m)
