"""Hostile calls in C: drivers of a batch of filters, one compilation with sanitizers, and what a run of it tells."""

from __future__ import annotations

import os
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
from tests.campaign import plausible
from tests.campaign.model import Data

SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
FLAGS = ("-std=c99", "-O1", "-g0", "-w", "-fno-math-errno", "-fno-omit-frame-pointer", *SANITIZERS)
ABORT = {"ASAN_OPTIONS": "abort_on_error=1:detect_leaks=0", "UBSAN_OPTIONS": "abort_on_error=1"}
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
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(
        loader=loader, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template(name)


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
        environment = {**os.environ, **ABORT}
        done = subprocess.run(
            call, capture_output=True, text=True, check=False, timeout=seconds * 10 + 60, env=environment
        )
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
    unit = plausible.units_of(declared.units) if fixed else (lambda name: 1.0)
    return _template("driver.c.j2").render(
        name=spec.name,
        NAME=spec.name.upper(),
        n=n,
        fixed=fixed,
        single=declared.real == "float",
        positive=plausible.positive(data),
        x_scale=[plausible.scale(state) / unit(state_name) for state_name, state in data["states"].items()],
        P_unit=2.0 ** -(declared.fraction_bits or 0),
        covariance=declared.has("get_covariance"),
        fields=[each for each in fields if each["real"]],
        variances=_variances(fields, n),
        weights=[each for each in fields if each["path"] == "mu[0]"],
        counts=[each["path"] for each in fields if each["path"].startswith("gate_count")],
        turns=plausible.turns(data),
        bounds=[] if spec.imm else [(i, *state["bounds"]) for i, state in plausible.having(data, "bounds")],
        limits=plausible.limits(data),
        slack=2e-3 if declared.real == "float" else 1e-6,
        parameters=[plausible.parameter(name, entry, unit(name)) for name, entry in data.get("parameters", {}).items()],
        inputs=[
            {"name": name, "scale": plausible.size(entry, 2.0) / unit(name)}
            for name, entry in data.get("inputs", {}).items()
        ],
        predict_u=declared.takes("predict", "u"),
        predict_dt=declared.takes("predict", "dt"),
        dt=plausible.step(data, unit("dt")),
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
        own = data["measurements"][sensor].get("inputs", {})  # their fields stand behind those of z
        made.append(
            {
                "function": function,
                "sensor": sensor,
                "first": next(iter(z)),
                "below": 18 + 48 * (k + 1) // len(functions),
                "scale": [plausible.size(c, 3.0) / unit(f"{sensor}_{name}") for name, c in {**z, **own}.items()],
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
        square = "(double)v * (double)v" if leaf == "S[0]" else "fabs((double)v)"
        found.append({"square": square, "path": path, "leaf": leaf, "size": size, "real": real, "finite": finite})

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
