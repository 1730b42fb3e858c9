"""A second opinion on filters of rotations: error-state filters in plain numpy that share nothing with kfgen.

Written from the textbooks alone: Sola 2017 (error states, body and reference error), Markley & Crassidis 2014 (reset of
the attitude covariance), Julier & Uhlmann 2004 (sigma points), Gauss-Newton on the posterior in information form (Bell
& Cathey 1993). All derivatives are complex steps (Squire & Trapp 1998), which lose nothing to cancellation: whatever is
differentiated is written so that it is analytic, no absolute values and no atan2.
"""

from __future__ import annotations

import numpy as np

STEP = 1e-40


def skew(v):
    x, y, z = v
    return np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]])


def left(q):
    """The matrix of p -> q p."""
    w, x, y, z = q
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def compose(p, q):
    return left(p) @ q


def inverse(q):
    return q * np.array([1, -1, -1, -1])


def exp(d):
    """The quaternion of a rotation vector."""
    d = np.asarray(d)
    square = d @ d
    if abs(square) < 1e-12:
        return np.concatenate([[1 - square / 8], d * (0.5 - square / 48)])
    angle = np.sqrt(square + 0j)
    q = np.concatenate([[np.cos(angle / 2)], d * (np.sin(angle / 2) / angle)])
    return q if np.iscomplexobj(d) else q.real


def log(q):
    """The rotation vector of a quaternion, at most half a turn."""
    q = q if q[0].real >= 0 else -q
    w, v = q[0], q[1:]
    square = v @ v
    if abs(square) < 1e-12:
        return v * (2 / w - 2 * square / (3 * w**3))
    size = np.sqrt(square + 0j)
    angle = 2 * np.arctan(size / w) if abs(w) > 1e-9 else np.pi - 2 * w / size
    d = v * (angle / size)
    return d if np.iscomplexobj(q) else d.real


def matrix(q):
    """From the body to the reference (Sola 2017, equation 115)."""
    w, v = q[0], q[1:]
    return (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * skew(v)


def right_jacobian(d):
    """d log(exp(-d) exp(d + e))/de (Sola 2017, equation 183)."""
    angle = np.linalg.norm(d)
    if angle < 0.05:
        a, b = 1 / 2 - angle**2 / 24 + angle**4 / 720, 1 / 6 - angle**2 / 120 + angle**4 / 5040
    else:
        a, b = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) - a * skew(d) + b * skew(d) @ skew(d)


def left_jacobian(d):
    """d log(exp(d + e) exp(-d))/de (Sola 2017, equation 145)."""
    return right_jacobian(-np.asarray(d))


def derivative(f, k):
    """df/dd (m, k) at d = 0 by complex steps."""
    columns = []
    for i in range(k):
        d = np.zeros(k, complex)
        d[i] = 1j * STEP
        columns.append(np.imag(f(d)) / STEP)
    return np.array(columns).T


class Space:
    """Numbers (n) among which quaternions start at `quaternions`; error: body or reference, of all."""

    def __init__(self, n, quaternions, error="body"):
        self.n, self.starts, self.error = n, tuple(quaternions), error
        self.k = n - len(self.starts)

    def _walk(self):
        i = j = 0
        while i < self.n:
            quaternion = i in self.starts
            yield i, j, quaternion
            i, j = (i + 4, j + 3) if quaternion else (i + 1, j + 1)

    def plus(self, x, d):
        out = np.zeros(self.n, np.result_type(x, d))
        for i, j, quaternion in self._walk():
            if not quaternion:
                out[i] = x[i] + d[j]
            elif self.error == "body":
                out[i : i + 4] = compose(x[i : i + 4], exp(d[j : j + 3]))
            else:
                out[i : i + 4] = compose(exp(d[j : j + 3]), x[i : i + 4])
        return out

    def minus(self, a, b):
        out = np.zeros(self.k, np.result_type(a, b))
        for i, j, quaternion in self._walk():
            if not quaternion:
                out[j] = a[i] - b[i]
            elif self.error == "body":
                out[j : j + 3] = log(compose(inverse(b[i : i + 4]), a[i : i + 4]))
            else:
                out[j : j + 3] = log(compose(a[i : i + 4], inverse(b[i : i + 4])))
        return out

    def unit(self, x):
        x = x.copy()
        for i in self.starts:
            x[i : i + 4] /= np.linalg.norm(x[i : i + 4])
        return x

    def reset(self, d):
        T = np.eye(self.k)
        for _, j, quaternion in self._walk():
            if quaternion:
                jacobian = right_jacobian if self.error == "body" else left_jacobian
                T[j : j + 3, j : j + 3] = jacobian(d[j : j + 3])
        return T


class ErrorState:
    """x (n), P (k, k). f(x, w, u, dt): the state a step later, w the noises held over it; h by sensor."""

    def __init__(self, space, x, P, f, Q, Qw):
        self.space, self.x, self.P = space, space.unit(np.asarray(x, float)), np.asarray(P, float)
        self.f, self.Q, self.Qw = f, np.asarray(Q, float), np.asarray(Qw, float)

    # --- first order

    def predict(self, u, dt):
        space, x, none = self.space, self.x, np.zeros(len(self.Qw))
        after = space.unit(self.f(x, none, u, dt))
        F = derivative(lambda d: space.minus(self.f(space.plus(x, d), none, u, dt), after), space.k)
        G = derivative(lambda w: space.minus(self.f(x, w, u, dt), after), len(self.Qw))
        self.x, self.P = after, F @ self.P @ F.T + self.Q + G @ self.Qw @ G.T

    def gain(self, h, R, measured):
        """The innovation's Jacobian, gain and covariance; `measured`: the space of z."""
        H = derivative(lambda d: measured.minus(h(self.space.plus(self.x, d)), h(self.x)), self.space.k)
        S = H @ self.P @ H.T + R
        return H, self.P @ H.T @ np.linalg.inv(S), S

    def update(self, z, h, R, reset=True, measured=None):
        """The whole vector at once, in Joseph's form."""
        measured = measured or Space(len(z), ())
        H, K, S = self.gain(h, R, measured)
        y = measured.minus(np.asarray(z, float), h(self.x))
        A = np.eye(self.space.k) - K @ H
        P, d = A @ self.P @ A.T + K @ R @ K.T, K @ y
        self.x = self.space.unit(self.space.plus(self.x, d))
        T = self.space.reset(d) if reset else np.eye(self.space.k)
        self.P = T @ P @ T.T
        return y @ np.linalg.solve(S, y)

    def iterate(self, z, h, R, times, measured=None):
        """Gauss-Newton on -log p(x | z), by the normal equations."""
        space, prior, information = self.space, self.x, np.linalg.inv(self.P)
        measured = measured or Space(len(z), ())
        x, weight = prior, np.linalg.inv(R)
        for _ in range(times):
            H, J = self._jacobians(x, prior, h, measured)
            e, y = space.minus(x, prior), measured.minus(np.asarray(z, float), h(x))
            N = J.T @ information @ J + H.T @ weight @ H
            d = np.linalg.solve(N, H.T @ weight @ y - J.T @ information @ e)
            x = space.unit(space.plus(x, d))
        self.x, self.P = x, np.linalg.inv(N)

    def _jacobians(self, x, prior, h, measured):
        """Of the reading and of the distance from the prior, at an iterate."""
        space, predicted = self.space, h(x)
        H = derivative(lambda d: measured.minus(h(space.plus(x, d)), predicted), space.k)
        return H, derivative(lambda d: space.minus(space.plus(x, d), prior), space.k)

    # --- sigma points (merwe)

    def points(self, root, alpha, beta, kappa, noise=None):
        """Columns of the errors, and of the noises where their covariance is given."""
        P, n = self.P, self.space.k
        roots = root(P)
        if noise is not None:
            n += len(noise)
            roots = np.block([[roots, np.zeros((len(P), len(noise)))], [np.zeros((len(noise), len(P))), root(noise)]])
        self.lam = alpha**2 * (n + kappa) - n
        gamma = np.sqrt(n + self.lam)
        self.wm = np.full(2 * n + 1, 0.5 / (n + self.lam))
        self.wc = self.wm.copy()
        self.wm[0] = self.lam / (n + self.lam)
        self.wc[0] = self.wm[0] + 1 - alpha**2 + beta
        S = gamma * roots
        return [np.zeros(n), *S.T, *(-S.T)]

    def predict_points(self, u, dt, root, weights, augment=False):
        """augment: with the noises as dimensions of the points, else by their Jacobian."""
        space, x, none = self.space, self.x, np.zeros(len(self.Qw))
        offsets = self.points(root, *weights, noise=self.Qw if augment else None)
        images = [space.unit(self.f(space.plus(x, d[: space.k]), d[space.k :] if augment else none, u, dt))
                  for d in offsets]  # fmt: skip
        around = np.array([space.minus(image, images[0]) for image in images])
        mean = self.wm @ around
        spread = around - mean
        T = space.reset(mean)
        G = derivative(lambda w: space.minus(self.f(x, w, u, dt), self.f(x, none, u, dt)), len(self.Qw))
        self.x = space.unit(space.plus(images[0], mean))
        self.P = T @ (self.wc * spread.T) @ spread @ T.T + self.Q
        self.P += 0 if augment else G @ self.Qw @ G.T
        self.kept = spread @ T.T

    def update_points(self, z, h, R, root, weights, reset=True, measured=None, kept=False, sequential=False):
        """With points drawn anew, or with those that predict has left; sequential: as a linear measurement by
        regression, without what the regression leaves."""
        space = self.space
        measured = measured or Space(len(z), ())
        offsets = self.kept if kept else np.array(self.points(root, *weights))
        images = [h(space.plus(self.x, d)) for d in offsets]
        around = np.array([measured.minus(image, images[0]) for image in images])
        mean = self.wm @ around
        T = measured.reset(mean)
        spread = (around - mean) @ T.T
        y = measured.minus(np.asarray(z, float), measured.plus(images[0], mean))
        cross = (self.wc * offsets.T) @ spread
        S = (self.wc * spread.T) @ spread + R
        if sequential:
            S = cross.T @ np.linalg.solve(self.P, cross) + R
        K = cross @ np.linalg.inv(S)
        d = K @ y
        self.x = space.unit(space.plus(self.x, d))
        T = space.reset(d) if reset else np.eye(space.k)
        self.P = T @ (self.P - K @ S @ K.T) @ T.T
        return y @ np.linalg.solve(S, y)


def cholesky(P):
    return np.linalg.cholesky(P)


def upper(P):
    """U sqrt(D): Cholesky from the other end."""
    return np.linalg.cholesky(P[::-1, ::-1])[::-1, ::-1]
