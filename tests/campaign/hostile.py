"""Hostile calls in C: drivers of a batch of filters, one compilation with sanitizers, and what a run of it tells."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import jinja2

from kfgen.generate import Generated
from tests.campaign.model import Data

HERE = Path(__file__).parent
SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
FLAGS = ("-std=c99", "-O1", "-g0", "-w", "-fno-math-errno", "-fno-omit-frame-pointer", *SANITIZERS)
EVERYTHING = 1 << 62  # segments: time ends them


@dataclass
class Told:
    """What a run of a filter's driver told: calls by outcome, and failures as (kind, count, segment, call)."""

    calls: int = 0
    ok: int = 0
    warned: int = 0
    refused: int = 0
    failures: list[tuple[str, int, int, int]] = field(default_factory=list)
    text: str = ""  # the sanitizer's report, or the trace


@cache
def _template(name: str) -> jinja2.Template:
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string((HERE / name).read_text())


def compile_batch(folder: Path, batch: Mapping[str, tuple[Generated, Data]], mend: Mapping[str, str] = {}) -> Path:
    """One program of the drivers of many filters (name -> what was generated, its spec as data).

    mend: file -> text in place of what was generated, which is how a test plants a fault.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for generated, data in batch.values():
        name = generated.spec.name
        for file, text in {**generated.files, f"{name}_driver.c": driver(generated, data)}.items():
            (folder / file).write_text(mend.get(file, text))
    (folder / "campaign.h").write_text(_template("campaign.h.j2").render())
    (folder / "main.c").write_text(_template("main.c.j2").render(names=list(batch)))
    sources = [f"{name}{end}.c" for name in batch for end in ("", "_driver")]
    call = [compiler(), *FLAGS, "-o", "campaign", "main.c", *sources, "-lm"]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"the C compiler failed:\n{done.stderr[-4000:]}")
    return folder / "campaign"


def compiler() -> str:
    """The compiler whose sanitizers are used."""
    for name in ("gcc", "clang"):
        if shutil.which(name):
            return name
    raise RuntimeError("gcc or clang is needed")


def run(program: Path, index: int, first: int, count: int, seconds: float, trace: bool = False) -> Told:
    """Segments `first` ... of the filter `index` of a batch, until `count` are done or the time is over."""
    call = [str(program), str(index), str(first), str(count), f"{seconds:.3f}", *(["trace"] if trace else [])]
    try:
        done = subprocess.run(call, capture_output=True, text=True, check=False, timeout=seconds * 10 + 60)
    except subprocess.TimeoutExpired:
        return Told(failures=[("a call does not end", 1, first, 0)])
    told = Told(text=done.stdout if trace else done.stderr)
    for line in done.stdout.splitlines():
        word, _, rest = line.partition(" ")
        if word == "calls":
            told.calls, told.ok, told.warned, told.refused = map(int, rest.split())
        elif word == "failed":
            often, segment, call_number, kind = rest.split(" ", 3)
            if kind == "sanitizer":
                kind = f"sanitizer: {_reason(done.stderr)}"
            told.failures.append((kind, int(often), int(segment), int(call_number)))
    if done.returncode and not told.failures:
        told.failures.append((f"died: {_reason(done.stderr) or done.returncode}", 1, first, 0))
    return told


def _reason(report: str) -> str:
    """The kind of a sanitizer's report, without addresses and places."""
    found = re.search(r"(?:runtime error: |AddressSanitizer: )(.{0,60})", report)
    return re.sub(r"0x[0-9a-f]+|-?\d[\d.e+]*", "N", found[1]) if found else ""


def driver(generated: Generated, data: Data) -> str:
    """The C text of one filter's driver."""
    spec, declared = generated.spec, generated.declarations
    fields = _fields(spec.name, declared.text)
    n = len(spec.states)
    fixed = declared.fraction_bits is not None
    unit = _units(declared.units) if fixed else (lambda name: 1.0)
    return _template("driver.c.j2").render(
        name=spec.name,
        NAME=spec.name.upper(),
        n=n,
        fixed=fixed,
        single=declared.real == "float",
        positive=_positive(data),
        x_scale=[_scale(state) / unit(state_name) for state_name, state in data["states"].items()],
        P_unit=2.0 ** -(declared.fraction_bits or 0),
        covariance=declared.has("get_covariance"),
        fields=[each for each in fields if each["real"]],
        variances=_variances(fields, n),
        weights=[each for each in fields if each["path"] == "mu[0]"],
        counts=[each["path"] for each in fields if each["path"].startswith("gate_count")],
        turns=_turns(data),
        bounds=[] if spec.imm else [(i, *state["bounds"]) for i, state in _where(data, "bounds")],
        limits=_limits(data),
        slack=2e-3 if declared.real == "float" else 1e-6,
        parameters=[_parameter(name, entry, unit(name)) for name, entry in data.get("parameters", {}).items()],
        inputs=[{"name": name, "scale": _size(entry, 2.0) / unit(name)} for name, entry in data.get("inputs", {}).items()],
        predict_u=declared.takes("predict", "u"),
        predict_dt=declared.takes("predict", "dt"),
        dt=_step(data, unit("dt")),
        redraw=declared.has("redraw"),
        setters=[
            {"name": name, "root": int("sqrt" in name), "below": below}
            for name, below in (("set_covariance", 13), ("set_sqrt_covariance", 15))
            if declared.has(name)
        ],
        updates=list(_updates(generated, data, unit)),
    )


def _updates(generated: Generated, data: Data, unit: Any) -> Sequence[Data]:
    functions = [name for name in generated.declarations.functions if name.startswith("update_")]
    made: list[Data] = []
    for k, function in enumerate(functions):
        sensor = function.removeprefix("update_")
        if sensor not in data["measurements"]:
            sensor = sensor.removesuffix("_masked")
        z = data["measurements"][sensor]["z"]
        made.append(
            {
                "function": function,
                "sensor": sensor,
                "first": next(iter(z)),
                "below": 18 + 48 * (k + 1) // len(functions),
                "scale": [_size(c, 3.0) / unit(f"{sensor}_{name}") for name, c in z.items()],
                "full": (1 << len(z)) - 1,
                "masked": generated.declarations.takes(function, "mask"),
                "u": generated.declarations.takes(function, "u"),
                "judged": 0 if data.get("initialize", {}).get("from") == sensor else 1,
            }
        )
    return made


def _fields(name: str, text: str) -> list[Data]:
    """The struct's numbers as C: `path` of the first, `size`, whether they are reals, and have to be finite."""
    ffi = cffi.FFI()
    ffi.cdef(text)
    found: list[Data] = []

    def walk(kind: Any, path: str) -> None:
        if kind.kind == "struct":
            for key, member in kind.fields:
                walk(member.type, f"{path}.{key}" if path else key)
            return
        size = 1
        while kind.kind == "array":
            size, kind, path = size * kind.length, kind.item, f"{path}[0]"
        real = kind.cname in ("float", "double", "int32_t") and "parameters" not in path
        leaf = path.rpartition(".")[2]
        finite = real and re.fullmatch(r"(x|U|D|P|S)\[0\]", leaf) is not None
        found.append({"path": path, "leaf": leaf, "size": size, "real": real, "finite": finite})

    walk(ffi.typeof(f"{name}_t"), "")
    return found


def _variances(fields: Sequence[Data], n: int) -> list[Data]:
    """Where the struct has what may not be negative."""
    made = []
    for each in fields:
        if each["leaf"] == "D[0]" and each["size"] == n:
            made.append({"path": each["path"], "n": n, "index": "j"})
        elif each["leaf"] == "P[0]" and each["size"] == n * (n + 1) // 2:
            made.append({"path": each["path"], "n": n, "index": "j * (j + 3u) / 2u"})
    return made


def _units(units: Mapping[str, float]) -> Any:
    by_name = {name.upper(): value for name, value in units.items()}
    return lambda name: by_name.get(name.upper(), 1.0)


def _number(value: Any, default: float) -> float:
    return float(value) if isinstance(value, int | float) and value else default


def _size(entry: Any, default: float) -> float:
    """Half the width of a declared range."""
    ends = (entry or {}).get("range")
    return max(abs(_number(end, default)) for end in ends) / 2 if ends else default


def _scale(state: Data) -> float:
    return max(_number(state.get("std"), 0.0), abs(_number(state.get("init"), 0.0)), 1e-3) if "range" not in state else (
        _size(state, 1.0) / 8
    )


def _parameter(name: str, entry: Any, unit: float) -> Data:
    entry = entry if isinstance(entry, dict) else {"value": entry}
    value = _number(entry.get("value"), 1.0)
    low, high = entry.get("range", (value / 2, value * 2))
    return {"name": name, "low": _number(low, value / 8) / unit, "high": _number(high, value) / unit}


def _step(data: Data, unit: float) -> Data:
    dt = data.get("dt")
    dt = dt if isinstance(dt, dict) else {"nominal": dt}
    nominal = _number(dt.get("nominal"), 0.1)
    return {"low": _number(dt.get("min"), nominal / 2) / unit, "high": _number(dt.get("max"), nominal * 2) / unit}


def _where(data: Data, key: str) -> list[tuple[int, Data]]:
    return [(i, state) for i, state in enumerate(data["states"].values()) if key in state]


def _turns(data: Data) -> list[tuple[int, str]]:
    made = []
    for i, state in _where(data, "kind"):
        kind = state["kind"]
        if kind == "angle":
            made.append((i, "3.14159265358979323846"))
        elif isinstance(kind, dict) and isinstance(kind["periodic"], int | float):
            made.append((i, repr(kind["periodic"] / 2)))
    return made


def _limits(data: Data) -> list[tuple[int, str, str]]:
    """(state, floor, ceiling) as the filter promises them; a bank combines, so promises nothing."""
    options = data["filter"]
    if "imm" in data or not {"variance_floor", "variance_ceiling"} & set(options):
        return []
    made = []
    for i, name in enumerate(data["states"]):
        ends = []
        for key, default in (("variance_floor", -1.0), ("variance_ceiling", 1e300)):
            value = options.get(key)
            value = value.get(name) if isinstance(value, dict) else value
            ends.append(repr(_number(value, default)))
        made.append((i, *ends))
    return made


def _positive(data: Data) -> bool:
    """Whether NOT_POSITIVE is never right: no negative weights among the points."""
    filters = [data["filter"], *(mode.get("filter", {}) for mode in data.get("imm", {}).get("modes", {}).values())]
    for options in filters:
        points = options.get("sigma_points", {})
        kind = points.get("kind", "merwe")
        if kind == "custom" or (kind == "julier" and _number(points.get("kappa"), 0.0) < 0):
            return False
        if kind in ("merwe", "wiki") and _number(points.get("beta"), 2.0) < _number(points.get("alpha"), 1.0) ** 2:
            return False
    return data.get("campaign", True) is True
