"""Sigma points and banks of the second oracle (van der Merwe 2004; Julier & Uhlmann 2004; Blom & Bar-Shalom 1988)."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.campaign.jets import Array, evaluate
from tests.campaign.oracle import ANOMALY, GATED, OK, Oracle, adaptive_threshold, plain, udu
from tests.campaign.oracle_model import UnfollowedError, period, wrapped


def weights(options: dict[str, Any], L: int) -> tuple[float, float, float, float, float, bool]:
    """gamma, wm0, wc0, wm, wc, and whether the centre counts."""
    kind = options.get("kind", "merwe")
    if kind in ("merwe", "wiki"):
        alpha, beta = options.get("alpha", 1.0), options.get("beta", 2.0)
        kappa = options.get("kappa", 0.0 if kind == "merwe" else L)
        gamma = alpha**2 * (L + kappa) if kind == "merwe" else alpha**2 * kappa
        wm0 = (gamma - L) / gamma
        return gamma, wm0, wm0 + 1 - alpha**2 + beta, 1 / (2 * gamma), 1 / (2 * gamma), True
    if kind == "julier":
        kappa = options.get("kappa", 0.0)
        return L + kappa, kappa / (L + kappa), kappa / (L + kappa), 1 / (2 * (L + kappa)), 1 / (2 * (L + kappa)), True
    if kind == "trivial":
        return L, 1 / (2 * L + 1), 1 / (2 * L), 1 / (2 * L + 1), 1 / (2 * L), True
    if kind == "cubature":
        return L, 0.0, 0.0, 1 / (2 * L), 1 / (2 * L), False
    raise UnfollowedError("custom points")


def lower(P: Array) -> Array:
    """The lower Cholesky factor of a semidefinite P; a pivot within rounding of zero is zero, and its column."""
    n = len(P)
    S = np.zeros((n, n))
    for j in range(n):
        pivot = P[j, j] - S[j, :j] @ S[j, :j]
        if pivot > 8 * n * np.finfo(float).eps * P[j, j]:
            S[j, j] = np.sqrt(pivot)
            S[j + 1 :, j] = (P[j + 1 :, j] - S[j + 1 :, :j] @ S[j, :j]) / S[j, j]
    return S


class PointOracle(Oracle):
    """The ukf."""

    def __init__(self, data: dict[str, Any], options: dict[str, Any] | None = None) -> None:
        super().__init__(data, options)
        if not self.options.get("sigma_points", {}).get("redraw", True):
            raise UnfollowedError("redraw: false")
        if any("bounds" in state for state in data["states"].values()) or self.model.dense:
            raise UnfollowedError("bounds or density with a ukf")
        self.points = self.options.get("sigma_points", {})
        random = np.random.default_rng(1)
        n, probes = self.model.n, []
        for _ in range(3):
            x, u = random.normal(size=n), random.normal(size=self.model.nu)
            probes.append(np.abs(self.model.step(x, u, self.model.nominal, 0.3).H))
        H = np.max(probes, axis=0)
        self.curved_noises = [
            j for j in range(len(self.model.noises)) if self.options.get("augment") or H[:, n + j].any()
        ]
        self.curved_f = H[:, :n, :].any(axis=(1, 2)) | H[:, n:, :].any(axis=(1, 2))

    def draw(self, P: Array, Qw: Array) -> tuple[Array, Array, tuple[float, ...]]:
        """Deviations of the points (in states, in noises), and their weights."""
        if self.options.get("covariance", "ud") == "ud":
            U, D = udu(P)
            S = U * np.sqrt(D)
        else:
            S = lower(P)
        n, k = len(P), len(Qw)
        w = weights(self.points, n + k)
        root = np.zeros((n + k, n + k))
        root[:n, :n], root[n:, n:] = S, np.diag(np.sqrt(np.diag(Qw)))
        columns = np.sqrt(w[0]) * root.T
        both = np.vstack([columns, -columns])
        return both[:, :n], both[:, n:], w

    def moments(
        self, images: Array, centre: Array, periods: list[float | None], w: Any
    ) -> tuple[Array, Array, Array, Array]:
        """Mean, deviations (points, m), that of the centre, covariance."""
        e = np.array([wrapped(image - centre, periods) for image in images]).reshape(len(images), len(centre))
        d = w[3] * e.sum(axis=0)
        dev = e - d
        covariance = w[4] * dev.T @ dev + (w[2] * np.outer(d, d) if w[5] else 0.0)
        return centre + d, dev, -d, covariance

    def predict(self, u: Array, dt: float) -> int:
        model, n = self.model, self.model.n
        step = model.step(self.x, u, dt, self.t)
        k, inside = len(model.noises), self.curved_noises
        outside = [j for j in range(k) if j not in inside]
        dx, dw, w = self.draw(self.P, step.Qw[np.ix_(inside, inside)])
        images = []
        for a, b in zip(dx, dw, strict=True):
            noise = np.zeros(k)
            noise[inside] = b
            images.append([float(v) for v in model.advance(list(self.x + a), list(noise), u, dt, self.t)])
        centre = np.array([float(v) for v in model.advance(list(self.x), [0.0] * k, u, dt, self.t)])
        periods = [P if bent else None for P, bent in zip(model.periods, self.curved_f, strict=True)]
        mean, _, _, P = self.moments(np.array(images), centre, periods, w)
        G = step.J[:, n:][:, outside]
        self.finish(mean, P + model.Q(self.x, u, dt, self.t) + G @ step.Qw[np.ix_(outside, outside)] @ G.T)
        self.t += dt
        return OK

    def sight(self, sensor: str, u: Array, used: list[int]) -> tuple[Array, Array, Array, Array]:
        """zp, the points' covariance Pzz, Pxz, and R with what linear noises add."""
        model, n = self.model, self.model.n
        look = model.look(sensor, self.x, u, self.t)
        random = np.random.default_rng(2)
        H = np.max(
            [np.abs(model.look(sensor, random.normal(size=n), random.normal(size=model.nu), 0.3).H) for _ in range(3)],
            axis=0,
        )
        k = len(look.Qw)
        inside = [j for j in range(k) if H[:, n + j].any() or self.options.get("augment")]
        outside = [j for j in range(k) if j not in inside]
        M = look.J[:, n:][:, outside]
        R = look.R + M @ look.Qw[np.ix_(outside, outside)] @ M.T
        dx, de, w = self.draw(self.P, look.Qw[np.ix_(inside, inside)])
        entry = model.data["measurements"][sensor]
        images = []
        for a, b in zip([*dx, np.zeros(n)], [*de, np.zeros(len(inside))], strict=True):
            noise = np.zeros(k)
            noise[inside] = b
            names = model.names(
                list(self.x + a), u, None, self.t, **dict(zip(entry.get("noise", {}), noise, strict=True))
            )
            images.append([float(evaluate(c["h"], names)) for c in entry["z"].values()])
        bent = H.any(axis=(1, 2))
        periods = [period(c) if b else None for c, b in zip(entry["z"].values(), bent, strict=True)]
        zp, dev, _, Pzz = self.moments(np.array(images[:-1]), np.array(images[-1]), periods, w)
        Pxz = w[4] * dx.T @ dev
        return zp[used], Pzz[np.ix_(used, used)], Pxz[:, used], R[np.ix_(used, used)]

    def update(self, sensor: str, z: Array, u: Array, used: list[int]) -> int:
        zp, Pzz, Pxz, R = self.sight(sensor, u, used)
        y = self.model.residual(sensor, z, zp, used)
        if self.options.get("sequential"):
            H = Pxz.T @ np.linalg.pinv(self.P, hermitian=True, rcond=1e-12)
            if not self.passes(sensor, plain(y, H, self.P, R)[0], len(used)):
                return GATED
            flags = self.gate_flag
            x, P, more = self.scalars(y, H, R)
            self.finish(x, P)
            return flags | more
        S = Pzz + R
        nis = float(y @ np.linalg.pinv(S, hermitian=True) @ y)
        if not self.passes(sensor, nis, len(used)):
            return GATED
        flags, threshold = self.gate_flag, adaptive_threshold(self.options, len(used))
        if threshold is not None and nis > threshold:
            flags |= ANOMALY
            self.P = self.P * (1 + (y @ np.linalg.pinv(Pzz, hermitian=True) @ y) * (1 / threshold - 1 / nis))
            zp, Pzz, Pxz, R = self.sight(sensor, u, used)
            y, S = self.model.residual(sensor, z, zp, used), Pzz + R
        K = Pxz @ np.linalg.pinv(S, hermitian=True)
        logarithm = np.linalg.slogdet(S)[1]
        self.log_likelihood = -0.5 * (
            len(y) * np.log(2 * np.pi) + y @ np.linalg.pinv(S, hermitian=True) @ y + logarithm
        )
        self.finish(self.x + K @ y, self.P - K @ S @ K.T)
        return flags


class BankOracle:
    """The interacting multiple model."""

    def __init__(self, data: dict[str, Any]) -> None:
        imm = data["imm"]
        self.M, self.mu = np.array(imm["transition"], dtype=float), np.array(imm["mu0"], dtype=float)
        self.floor = imm.get("mu_floor", 1e-9)
        common = {key: value for key, value in data.items() if key != "imm"}
        self.modes = [oracle({**common, **mode}) for mode in imm["modes"].values()]
        if any("gate" in sensor for sensor in data["measurements"].values()):
            raise UnfollowedError("gates in a bank")
        self.model = self.modes[0].model
        self.combine()

    @staticmethod
    def mixed(w: Array, xs: list[Array], Ps: list[Array], periods: list[float | None]) -> tuple[Array, Array]:
        """Mean and covariance of a mixture, angles about the heaviest."""
        base = xs[int(np.argmax(w))]
        d = [wrapped(x - base, periods) for x in xs]
        mean = sum(a * b for a, b in zip(w, d, strict=True))
        P = sum(a * (P + np.outer(b - mean, b - mean)) for a, b, P in zip(w, d, Ps, strict=True))
        return wrapped(base + mean, periods), P

    def combine(self) -> None:
        xs, Ps = [m.x for m in self.modes], [m.P for m in self.modes]
        self.x, self.P = self.mixed(self.mu, xs, Ps, self.model.periods)

    def predict(self, u: Array, dt: float) -> int:
        c = self.mu @ self.M
        xs, Ps = [m.x for m in self.modes], [m.P for m in self.modes]
        mixes = [
            self.mixed(self.M[:, j] * self.mu / c[j], xs, Ps, self.model.periods) if c[j] > 0 else (xs[j], Ps[j])
            for j in range(len(c))
        ]
        for mode, (x, P) in zip(self.modes, mixes, strict=True):
            mode.x, mode.P = x, P
            mode.predict(u, dt)
        self.mu = c
        self.combine()
        return OK

    def update(self, sensor: str, z: Array, u: Array, used: list[int]) -> int:
        flags = OK
        for mode in self.modes:
            flags |= mode.update(sensor, z, u, used)
        likelihood = np.array([m.log_likelihood for m in self.modes])
        mu = self.mu * np.exp(likelihood - likelihood.max())
        mu = np.maximum(mu / mu.sum(), self.floor)
        self.mu = mu / mu.sum()
        self.nis = min(m.nis for m in self.modes)
        self.combine()
        return flags


def oracle(data: dict[str, Any]) -> Any:
    """The oracle of a spec's plain data; UnfollowedError where it has none."""
    if "imm" in data:
        return BankOracle(data)
    return PointOracle(data) if data["filter"].get("type") == "ukf" else Oracle(data)
