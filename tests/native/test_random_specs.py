"""Random filters: all four forms and the reference must agree to round-off. A failure here is the algorithm's.

The forms run as programs in float64; one of the four is also compiled and must give the same bits (the printer).
The specs are drawn by a fixed generator and built batch by batch, one call of the compiler each.
"""

from __future__ import annotations

import numpy as np
import pytest
from emitted import FORMS, Program, locked

from kfgen.generate import build
from kfgen.native import load_filters
from kfgen.override import override
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import ERROR, Status

BATCHES, SIZE, STEPS = 4, 10, 8


def matrix(rows: np.ndarray) -> str:
    return "[" + ", ".join("[" + ", ".join(f"{v:.6g}" for v in row) + "]" for row in rows) + "]"


def positive(random: np.random.Generator, n: int, rank: int, scale: float) -> np.ndarray:
    """A covariance of a given rank, whose decimals are exact."""
    A = random.integers(-4, 5, (n, rank)) / 4
    P = scale * (A @ A.T)
    return P + (0 if rank < n else scale / 16 * np.eye(n))


def random_spec(seed: int) -> str:
    """A stable system of 2 to 6 states, sparse, linear or mildly nonlinear."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 7 if seed % 10 == 0 else 5))
    F = random.normal(size=(n, n)) * (random.random((n, n)) < 0.4) + np.diag(random.uniform(0.3, 1, n))
    F *= 0.95 / max(0.95, np.max(np.abs(np.linalg.eigvals(F))))
    curved = bool(random.random() < 0.6)
    f = []
    for i in range(n):
        terms = [f"{F[i, j]:.4g}*x{j}" for j in range(n) if F[i, j]]
        if curved and random.random() < 0.5:
            a, b = random.integers(0, n, 2)
            terms.append(random.choice([f"0.05*x{a}/(1 + x{b}**2)", f"0.02*x{a}*x{b}/(1 + x{a}**2)"]))
        if random.random() < 0.2:
            terms.append("0.1*u")
        if random.random() < 0.3:
            terms.append(random.choice(["w0", "0.5*w1", f"w0*(1 + 0.1*x{i})", "w0 - w1"]))
        f.append(f"    x{i}: " + (" + ".join(terms) or "0"))
    kind = random.integers(3)
    if kind == 0:
        Q = matrix(positive(random, n, int(random.integers(1, n + 1)), 0.01))
    else:
        Q = "{" + ", ".join(f"x{i}: {random.choice([0, 0, 1e-3, 0.02])}" for i in range(n)) + "}"
    if random.random() < 0.4:
        states = [f"  x{i}: {{init: {random.normal():.3g}}}" for i in range(n)]
        P0 = f"P0: {matrix(positive(random, n, int(random.integers(1, n + 1)), 1.0))}"
    else:
        states = [f"  x{i}: {{init: {random.normal():.3g}, var: {random.choice([0, 0.25, 1, 2])}}}" for i in range(n)]
        P0 = ""
    sensors = []
    for s in range(int(random.integers(1, 4))):
        m = int(random.integers(1, 3))
        full = m == 2 and random.random() < 0.5
        lines = [f"  s{s}:", "    z:"]
        for c in range(m):
            seen = random.choice(n, size=min(n, int(random.integers(1, 3))), replace=False)
            h = " + ".join(f"{random.choice([1, 1, 0.5, -2])}*x{j}" for j in seen)
            if curved and random.random() < 0.4:
                h += f" + 0.05*x{seen[0]}**2"
            noise = "" if full else f", var: {random.choice([0.1, 0.5, 2])}"
            lines.append(f'      z{c}: {{h: "{h}"{noise}}}')
        if full:
            lines.append(f"    R: {matrix(positive(random, 2, 2, 0.5))}")
        if random.random() < 0.3:
            lines.append("    gate: {probability: 0.95}")
        sensors.append("\n".join(lines))
    return "\n".join([
        "kfgen: 1", f"name: random{seed}", "scalar: double", "dt: 0.1", "inputs: {u: {}}", "states:", *states, P0,
        "noise: {w0: {std: 0.1}, w1: {var: 0.02}}", "dynamics:", "  form: discrete", "  f:", *f, f"  Q: {Q}",
        "measurements:", *sensors, "filter: {type: ekf}", "",
    ])  # fmt: skip


@pytest.mark.parametrize("batch", range(BATCHES))
def test_all_forms_agree_with_the_reference(batch):
    """1e-9 of the largest |x_i| and of sqrt(P_ii P_jj); a variance is 0 below 1e-12 of its largest."""
    cases = []
    for seed in range(batch * SIZE, (batch + 1) * SIZE):
        spec = loads(random_spec(seed))
        cases.append((spec, {form: build(override(spec, filter=keys)) for form, keys in FORMS.items()}))
    chosen = [list(FORMS)[seed % 4] for seed in range(SIZE)]
    filters = [forms[form] for (_, forms), form in zip(cases, chosen, strict=True)]
    with locked(f"random-{batch}"):
        compiled = load_filters(filters, flags=["-O0", "-ffp-contract=off"])
    for (spec, forms), form, kf in zip(cases, chosen, compiled, strict=True):
        programs = {name: Program(each.code) for name, each in forms.items()}
        follow(spec, programs, form, kf)


def follow(spec, programs, form, kf):
    random = np.random.default_rng(11)
    ref = reference(spec)
    n = len(spec.states)
    largest_x = np.maximum(np.abs(ref.x), 1.0)
    largest_P = np.diag(ref.P).copy()
    for step in range(STEPS):
        u = random.normal(size=1)
        calls = [("predict", {"u": u})]
        for sensor in spec.measurements:
            if random.random() < 0.8:
                z = random.normal(0, 5 if random.random() < 0.1 else 1, len(sensor.components))
                calls.append((f"update_{sensor.name}", {"z": z}))
        for name, keywords in calls:
            truth = ref.predict(**keywords) if name == "predict" else ref.update(name[7:], **keywords)
            assert truth < ERROR
            statuses = {key: program.run(name, **keywords) for key, program in programs.items()}
            for key, status in statuses.items():
                assert not (status ^ truth) & ~Status.REGULARIZED, f"{spec.name} {key} {step} {name}: {status:#x}"
            made = kf.predict(**keywords) if name == "predict" else kf.update(name[7:], **keywords)
            assert made == statuses[form]
        largest_x = np.maximum(largest_x, np.abs(ref.x))
        largest_P = np.maximum(largest_P, np.diag(ref.P))
        floor = np.maximum(np.diag(ref.P), 1e-12 * np.maximum(largest_P, 1e-3))
        for key, program in programs.items():
            place = f"{spec.name} {key} step {step}"
            P = program.P
            assert np.all(np.abs(program.x - ref.x) <= 1e-9 * largest_x), place
            assert np.all(np.abs(P - ref.P) <= 1e-9 * np.sqrt(np.outer(floor, floor)) + 1e-24), place
            assert np.array_equal(P, P.T)
            assert np.linalg.eigvalsh(P)[0] >= -1e-13 * np.max(np.diag(P)) * n, place
        assert kf.x.tobytes() == programs[form].x.tobytes(), f"{spec.name}: the printer"
        assert kf.P.tobytes() == programs[form].P.tobytes(), f"{spec.name}: the printer"
