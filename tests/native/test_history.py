"""Late measurements: a filter with its past is, bit for bit, the filter that had every measurement at its time."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kfgen
from kfgen.errors import KfgenError
from kfgen.generate import build
from kfgen.native import NativeFilter, NativeHistory, load_filters
from kfgen.override import override
from kfgen.spec import loads
from kfgen.spec.types import History, Spec

SPECS = Path(__file__).parents[2] / "specs"
TOO_OLD, NOT_FINITE, NULL_ARGUMENT = 0x800, 0x200, 0x100

WAVE = """kfgen: 1
name: wave
dt: {nominal: 0.1, min: 0.01, max: 1}
parameters: {r: 0.3, q: 0.1}
states:
  a: {init: 0.2, std: 0.5, range: [-4, 4]}
  b: {init: 0, std: 0.5, kind: angle, unit: rad}
  c: {init: 1, std: 0.2, range: [-4, 4]}
inputs: {push: {range: [-1, 1]}}
dynamics: {form: discrete, f: {a: a + dt*sin(b) + dt*push, b: b + dt*c}, Q: {a: q*dt, b: 0.01*dt, c: 0.02*dt}}
measurements:
  pair:
    z: {x: {h: a, std: r}, y: {h: b, std: 0.2, kind: angle}}
    partial: true
    gate: {probability: 0.9, reset_after: 2}
  one: {z: {w: {h: a + c*push, std: 0.2}}}
code: {gate_count: true, log_likelihood: true}
"""
SECTIONS = {
    "wave_bierman": "filter: {type: ekf}",
    "wave_standard": "filter: {type: ekf, covariance: full, update: standard, adapt_R: 0.1, adaptive: true}",
    "wave_iterated": "filter: {type: iekf, covariance: full}",
    "wave_root": "filter: {type: ukf, covariance: sqrt}",
    "wave_starting": "filter: {type: ukf}\ninitialize: {from: one, states: {a: w}}",
    "wave_fixed": "filter: {type: ekf, covariance: full, update: standard}\nscalar: q16.16",
}
BANK = """kfgen: 1
name: bank
dt: 0.1
states: {p: {init: 0, std: 1}, v: {init: 0, std: 1}}
measurements: {z: {z: {p: {h: p, std: 0.3}}}}
imm:
  modes:
    slow: {dynamics: {form: discrete, f: {p: p + dt*v}, Q: {v: 0.001}}, filter: {type: ekf}}
    fast: {dynamics: {form: discrete, f: {p: p + dt*v}, Q: {v: 1}}, filter: {type: ukf, covariance: full}}
  transition: [[0.9, 0.1], [0.2, 0.8]]
"""
KEPT = """kfgen: 1
name: kept
dt: 0.1
states: {p: {init: 0, std: 1}, v: {init: 0, std: 1}}
dynamics: {form: discrete, f: {p: p + dt*sin(v)}, Q: {v: 0.01}}
measurements: {z: {z: {p: {h: p**2 + p, std: 0.3}}}}
filter: {type: ukf, sigma_points: {redraw: false}}
"""


def all_specs() -> list[Spec]:
    texts = {name: WAVE.replace("name: wave", f"name: {name}") + section for name, section in SECTIONS.items()}
    texts |= {"bank": BANK, "kept": KEPT}
    histories = [History(6), History(7, 2, 3), History(5, 3, 5), History(1, 1), History(4, 4, 9)]
    specs = [override(loads(text, name), history=histories[i % 3]) for i, (name, text) in enumerate(texts.items())]
    more = [override(loads(KEPT), name=f"kept_{i}", history=each) for i, each in enumerate(histories)]
    return specs + more


@dataclass
class Oracle:
    """A filter that is told everything anew, in order, whenever something arrives late."""

    filter: NativeFilter
    steps: int
    per_step: int
    start: NativeFilter = field(init=False)
    past: list[tuple[tuple[Any, ...], list[tuple[Any, ...]]]] = field(init=False)

    def __post_init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        self.start, self.past = self.filter.copy(), [((), [])]

    def predict(self, *arguments: Any) -> int:
        status = self.filter.predict(*arguments)
        if status < 0x100:
            self.past.append((arguments, []))
        return status

    def update(self, age: int, *arguments: Any) -> int:
        if age > min(self.steps, len(self.past) - 1) or len(self.past[-1 - age][1]) >= self.per_step:
            status = self.filter.copy().update(*arguments)
            return status if status == NOT_FINITE else TOO_OLD
        kf, own = self.start.copy(), 0
        at = len(self.past) - 1 - age
        for i, (step, measurements) in enumerate(self.past):
            statuses = [] if i == 0 else [kf.predict(*step)]
            statuses += [kf.update(*each) for each in measurements]
            if max(statuses, default=0) >= 0x100:
                return max(statuses)
            if i == at:
                own = kf.update(*arguments)
                if own >= 0x100:
                    return own
        self.past[at][1].append(arguments)
        self.filter = kf
        return own


def bits(kf: NativeFilter) -> list[Any]:
    """Every field to the bit; what pads the struct is nobody's."""

    def flat(fields: Any) -> list[Any]:
        if isinstance(fields, dict):
            return [each for name in fields for each in flat(fields[name])]
        return [np.asarray(fields).tobytes()]

    return flat(kf.raw)


@pytest.fixture(scope="module")
def pairs() -> dict[str, tuple[NativeFilter, NativeHistory]]:
    generated = [build(spec) for spec in all_specs()]
    plain = load_filters(generated, flags=["-O1"])
    past = load_filters(generated, flags=["-O1"], history=True)
    return {kf.name: (kf, h) for kf, h in zip(plain, past, strict=True)}


@pytest.mark.parametrize("name", [spec.name for spec in all_specs()])
def test_as_if_all_had_come_in_order(pairs, name):
    kf, h = pairs[name]
    random = np.random.default_rng(sum(map(ord, name)))
    spec = kf.spec
    assert spec.history is not None
    seen = set()
    for _ in range(3):
        kf.init()
        h.init()
        oracle = Oracle(kf.copy(), spec.history.steps, spec.history.per_step)
        for call in range(70):
            kind = random.random()
            u = [random.uniform(-1, 1)] if spec.inputs else None
            if kind < 0.45:
                dt = random.choice([0.1, 0.05, 2.0]) if spec.dt is not None and spec.dt.run_time else None
                u = None if u is None else [np.nan if random.random() < 0.05 else u[0]]
                want, got = oracle.predict(u, dt), h.predict(u, dt)
            elif kind < 0.47 and call > 20:
                x = random.uniform(-0.5, 0.5, len(kf.states))
                want, got = oracle.filter.set_state(x), h.set_state(x)
                oracle.begin()
            elif kind < 0.49 and call > 20:
                P = np.diag(random.uniform(0.1, 1, len(kf.states)))
                want, got = oracle.filter.set_covariance(P), h.set_covariance(P)
                oracle.begin()
            else:
                sensor = random.choice(list(kf.sensors))
                z = list(random.normal(0, 0.5, len(kf.sensors[sensor])))
                if random.random() < 0.05:
                    z[0] = np.nan
                mask = int(random.integers(0, 4)) if sensor == "pair" and random.random() < 0.4 else None
                age = int(random.integers(0, spec.history.steps + 2))
                takes = kf.struct.takes(f"update_{sensor}{'_masked' * (mask is not None)}", "u")
                arguments = (sensor, z, u if takes else None, mask)
                want, got = oracle.update(age, *arguments), h.update(*arguments, age=age)
            assert got == want, (call, got, want)
            assert bits(h) == bits(oracle.filter), call
            seen.add(got)
    assert {0, TOO_OLD} <= seen
    assert NOT_FINITE in seen or spec.scalar.startswith("q")


def test_the_ram_that_the_header_states(pairs):
    for spec in all_specs():
        h = pairs[spec.name][1]
        generated = build(spec)
        assert generated.history is not None
        size = h.struct.ffi.sizeof(f"{spec.name}_history_t")
        assert generated.history.ram == size
        assert f" * RAM {size} bytes." in generated.files[f"{spec.name}_history.h"]
        assert any(f"{size} bytes of RAM" in note for note in generated.summary.notes)


def test_what_came_since_is_repeated_with_the_parameters_of_now(pairs):
    kf, h = pairs["wave_bierman"]
    kf.init()
    h.init()
    states = []
    for k in range(4):
        kf.predict([0.1 * k], 0.1)
        h.predict([0.1 * k], 0.1)
        kf.update("one", [0.1], [0.2])
        h.update("one", [0.1], [0.2])
        states.append(kf.copy())
    h.parameters["q"] = 5.0
    late = states[1]
    late.parameters["q"] = 5.0
    assert h.update("pair", [0.3, 0.1], age=2) == late.update("pair", [0.3, 0.1])
    for k in (2, 3):
        late.predict([0.1 * k], 0.1)
        late.update("one", [0.1], [0.2])
    assert bits(h) == bits(late)


@pytest.fixture(scope="module")
def fragile() -> list[tuple[NativeFilter, NativeHistory]]:
    """A prediction that overflows from 20 on; keep 1 and 3."""
    text = """kfgen: 1
name: fragile
states: {x: {init: 0, std: 1}}
parameters: {scale: 1}
dynamics: {form: discrete, f: {x: 0.1*x + 1e-36*scale*exp(4*x)}, Q: {x: 0.1}}
measurements: {z: {z: {x: {h: x, std: 0.01}}}}
"""
    specs = [override(loads(text), name=f"fragile_{keep}", history=History(8, 4, keep)) for keep in (1, 3)]
    generated = [build(spec) for spec in specs]
    return list(zip(load_filters(generated), load_filters(generated, history=True), strict=True))


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("age", [1, 2, 3, 4])
def test_a_repetition_that_fails_leaves_present_and_past(fragile, which, age):
    kf, h = fragile[which]
    kf.init()
    h.init()
    oracle = Oracle(kf.copy(), 8, 4)
    for k in range(7):
        assert (oracle.predict(), h.predict()) == (0, 0)
        assert oracle.update(0, "z", [0.1 * k]) == h.update("z", [0.1 * k])
    before = bits(h)
    assert h.update("z", [50.0], age=age) == NOT_FINITE
    assert bits(h) == before
    for late in (age, 5, 1, 0, 2):
        assert oracle.update(late, "z", [0.3]) == h.update("z", [0.3], age=late) == 0
        assert bits(h) == bits(oracle.filter)


def test_a_past_that_cannot_be_repeated_begins_anew(fragile):
    h = fragile[0][1]
    h.init()
    for _ in range(4):
        h.predict()
    before = h.x.copy()
    h.parameters["scale"] = np.nan
    assert h.update("z", [0.2], age=2) == NOT_FINITE
    assert h.x == before
    h.parameters["scale"] = 1.0
    assert h.predict() == 0
    assert h.update("z", [0.2], age=h.available) == 0
    assert h.update("z", [0.2], age=h.available + 1) == TOO_OLD


def test_the_emitted_c_is_clean_and_survives_a_million_calls(tmp_path, needs):
    """Random calls, ages and orders under UBSan and ASan; strict warnings of C and C++."""
    needs("gcc")
    spec = override(loads(WAVE), history=History(9, 3, 4))
    for name, text in build(spec).files.items():
        (tmp_path / name).write_text(text)
    shutil.copy(Path(__file__).with_name("history_calls.c"), tmp_path / "main.c")
    strict = "-pedantic -Wall -Wextra -Wconversion -Wsign-conversion -Wdouble-promotion -Wshadow -Wfloat-equal -Wundef"
    for compiler, sources in (("gcc -std=c99", "*.c"), ("g++ -x c++ -fsyntax-only", "wave*.c")):
        names = sorted(path.name for path in tmp_path.glob(sources) if path.name != "main.c")
        for name in names:
            run(tmp_path, *compiler.split(), *strict.split(), "-Werror", *(["-c"] if "c99" in compiler else []), name)
    checked = ["-fsanitize=undefined,address", "-fno-sanitize-recover=all"]
    run(tmp_path, "gcc", "-std=c99", "-O1", *checked, "main.c", "wave.c", "wave_history.c", "-lm", "-o", "main")
    told = run(tmp_path, "./main", "1000000")
    taken, refused, old = map(int, told.split())
    assert min(taken, refused, old) > 50_000


def run(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_null_arguments(pairs):
    h = pairs["wave_bierman"][1]
    lib, ffi, past = h.struct.lib, h.struct.ffi, h.struct.past
    name = "wave_bierman_history"
    assert getattr(lib, f"{name}_init")(ffi.NULL) == NULL_ARGUMENT
    assert getattr(lib, f"{name}_predict")(past, ffi.NULL, 0.1) == NULL_ARGUMENT
    assert getattr(lib, f"{name}_update_pair")(past, ffi.NULL, 0) == NULL_ARGUMENT
    assert getattr(lib, f"{name}_set_state")(past, ffi.NULL) == NULL_ARGUMENT
    assert getattr(lib, f"{name}_set_covariance")(ffi.NULL, ffi.NULL) == NULL_ARGUMENT


def test_in_python(pairs):
    with pytest.raises(KfgenError, match=r"has no `history`; write for example `history: \{steps: 25\}`"):
        kfgen.compile(SPECS / "scalar.yaml", history=True)
    kf, h = pairs["kept"]
    with pytest.raises(ValueError, match="age counts predictions"):
        h.update("z", [0], age=-1)
    with pytest.raises(TypeError):
        kf.update("z", [0], age=1)
    other = h.copy()
    h.init()
    assert isinstance(other, NativeHistory)
    other.predict()
    other.predict()
    assert h.available == 0
    assert other.available >= 2


@pytest.mark.parametrize(("text", "message"), [
    ("history: {}", "the key `steps` is missing"),
    ("history: {steps: 0}", "`steps` is 0; write a whole number between 1 and 10000"),
    ("history: {steps: 5, per_step: 300}", "between 1 and 255"),
    ("history: {stesp: 5}", "did you mean `steps`?"),
    ("history: 5", "a mapping is wanted here"),
])  # fmt: skip
def test_mistakes(text, message):
    with pytest.raises(kfgen.SpecError) as caught:
        loads(KEPT + text)
    assert message in str(caught.value)


def test_advice_where_a_step_may_be_full():
    from kfgen.spec.advice import warnings

    text = KEPT.replace("std: 0.3}}", "std: 0.3}}, rate: 6")
    (advice,) = (each for each in warnings(loads(text + "history: {steps: 5}")) if each.name == "per_step")
    assert str(advice).endswith("write `per_step: 6`: what comes beyond is TOO_OLD [per_step]")
    assert not [a for a in warnings(loads(text + "history: {steps: 5, per_step: 6}")) if a.name == "per_step"]
