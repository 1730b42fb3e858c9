"""`python -m tests.benchmarks.calibrate`: fit the bytes of kfgen/ir/sizes.py to what arm-none-eabi-gcc makes.

Every spec of the repository and the problems of the tests are generated in all forms of the covariance, written out and
in loops, as float, double and fixed point, and compiled for a Cortex-M4F; each emitted function is one equation for the
flash, and one for the stack; the routines of a fixed-point filter are one for the flash of what it calls. The
coefficients are the non-negative ones of least relative error. A filter's functions together, whose flash a budget is
about, are one more equation. Prints the errors; writes the table.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.optimize import nnls

from kfgen.cost import recommended_flags, target_of
from kfgen.cost.toolchain import Gcc
from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.ir.footprint import Traits, stack_traits, traits
from kfgen.ir.program import Call, Function, walk
from kfgen.override import override
from kfgen.spec import loads
from tests.oracle import problems

ROOT = Path(__file__).parents[2]
FORMS = [
    {"covariance": "ud", "update": "bierman"}, {"covariance": "ud", "update": "joseph"},
    {"covariance": "full", "update": "joseph"}, {"covariance": "full", "update": "standard"}, {"covariance": "sqrt"},
]  # fmt: skip
UNSCENTED = ("covariance: ud", "covariance: full", "covariance: sqrt", "covariance: ud, sequential: true")
SCALARS = {"float": "float", "double": "double", "q": "q16.16"}
TOGETHER = 6.0  # what a filter counts for, where a function counts 1
SMALL = ("cv4", "vehicle4", "chain4", "radar", "ball")  # problems that are compiled in all scalars
STACK_COLUMNS = ("base", "live", "beyond", "kept", "calls", "loop")
WIDTH = {"float": 4, "double": 8, "q": 4}
Row = tuple[str, str, Traits, int, int]  # scalar, label, what it is made of, bytes of flash, bytes of stack
Job = tuple[str, str, str, dict[str, str], str]  # label, a spec's text, scalar, changes of the filter, unroll


def filters() -> Iterator[Job]:
    for label, text, scalar, form in forms():
        yield label, text, scalar, form, "auto"
        if scalar != "q":
            yield f"{label} in loops", text, scalar, form, "none"


def forms() -> Iterator[tuple[str, str, str, dict[str, str]]]:
    """Label, a spec's text, scalar, changes of the filter."""
    texts = {path.stem: path.read_text() for path in sorted((ROOT / "specs").glob("*.yaml"))}
    texts |= {name: problems.ALL[name] for name in ("cv4", "vehicle4", "chain4", "chain8", "radar", "ball", "att")}
    texts["chain12"], texts["chain16"] = problems.chain(12), problems.chain(16)
    for name, text in texts.items():
        for scalar in SCALARS:
            if scalar != "float" and name in problems.ALL | {"chain12": "", "chain16": ""} and name not in SMALL:
                continue
            yield name, text, scalar, {}
            if "type: ukf" in text:
                continue
            for form in FORMS:
                yield f"{name} {form}", text, scalar, form
            if scalar != "q" and name in ("vehicle4", "chain4", "chain8", "chain12", "radar"):
                for form in UNSCENTED:
                    yield f"{name} ukf {form}", text.replace("type: ekf", f"type: ukf, {form}"), scalar, {}


def rows(job: Job) -> list[Row]:
    """The functions of a filter, compiled. A function that calls private ones is taken together with them."""
    label, text, scalar, form, unroll = job
    try:
        spec = override(loads(text), SCALARS[scalar], **({"filter": form} if form else {}))
        spec = replace(spec, code=replace(spec.code, unroll=unroll))
        generated = build(spec, judge=False)
    except SpecError:
        return []  # a form that this filter cannot have
    flags = recommended_flags(generated.view)
    flash, stack = compiled(spec.name, generated.files, flags)
    out: list[Row] = []
    for function in generated.code.functions:
        name = f"{spec.name}_{function.name}"
        if function.private or name not in flash:
            continue
        if function.name.startswith(("get_", "set_", "redraw")):
            continue  # of which no budget is
        whole, size, depth = traits(function), flash[name], stack[name]
        for callee in callees(function):
            inlined = f"{spec.name}_{callee.name}" not in flash
            part = traits(callee)
            if inlined:
                whole.counts += part.counts
                whole.counts["call"] -= 1
                whole.arrays += part.arrays
                whole.live = max(whole.live, part.live)
        out.append((scalar, f"{label} {function.name}", whole, size, depth))
    steps = [row for row in out if row[1].rpartition(" ")[2].startswith(("init", "predict", "update"))]
    counts = sum((row[2].kinds for row in steps), Counter[str]())
    out.append((scalar, f"{label} together", Traits(counts), sum(row[3] for row in steps), 0))
    routines = generated.view.routines
    if routines is not None:
        size = sum(flash[name] for name in flash if name.startswith(f"{spec.name}_q_"))
        out.append(("routines", label, Traits(Counter((*routines.ops, *routines.own))), size, 0))
    return out


def callees(function: Function) -> list[Function]:
    """The private functions that a function calls, each once."""
    return list({id(s.callee): s.callee for s in walk(function.body) if isinstance(s, Call)}.values())


def compiled(name: str, files: dict[str, str], flags: list[str]) -> tuple[Counter[str], dict[str, int]]:
    """Bytes of flash and of stack of each function of an object file."""
    gcc = target_of("cortex-m4f").compiler("gcc")  # type: ignore[attr-defined]
    assert isinstance(gcc, Gcc)
    with TemporaryDirectory() as path:
        folder = Path(path)
        for file, text in files.items():
            (folder / file).write_text(text)
        made = gcc.compile(folder, f"{name}.c", [*flags, "-fstack-usage"])
        listed = subprocess.run(
            ["arm-none-eabi-size", "-A", made], cwd=folder, capture_output=True, text=True, check=True
        )
        usage = Path(folder, f"{name}.su").read_text()
    flash: Counter[str] = Counter()
    for section, size in re.findall(r"^\.(?:text|rodata)\.(\S+)\s+(\d+)", listed.stdout, re.MULTILINE):
        flash[section.removeprefix("unlikely.").partition(".")[0]] += int(size)
    stack = {function: int(size) for function, size in re.findall(r":(\w+)\t(\d+)\t", usage)}
    return flash, stack


def fitted(A: np.ndarray, y: np.ndarray, floor: float, counts: np.ndarray | float = 1.0
           ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Coefficients, and the relative errors (of at least `floor` bytes). counts: what each equation counts for."""
    relative = 1 / np.maximum(y, floor)
    weight = relative * counts
    x, _ = nnls(A * weight[:, None], y * weight)
    return x, (A @ x - y) * relative


def main() -> int:
    """Measure, fit, print, write."""
    with ProcessPoolExecutor(max_workers=2) as pool:
        write(*fit([row for part in pool.map(rows, filters(), chunksize=4) for row in part]))
    return 0


Tables = dict[str, dict[str, float]]


def fit(found: list[Row]) -> tuple[Tables, Tables, dict[str, float]]:
    """The tables of flash, of stack, and of the flash of routines."""
    flash: dict[str, dict[str, float]] = {}
    stack: dict[str, dict[str, float]] = {}
    for scalar in SCALARS:
        mine = [row for row in found if row[0] == scalar]
        kinds = sorted({kind for row in mine for kind in row[2].kinds})
        A = np.array([[row[2].kinds[kind] for kind in kinds] for row in mine], float)
        counts = np.array([TOGETHER if row[1].endswith(" together") else 1.0 for row in mine])
        x, errors = fitted(A, np.array([row[3] for row in mine], float), 256, counts)
        flash[scalar] = {kind: round(float(each), 2) for kind, each in zip(kinds, x, strict=True)} | {"other": 8.0}
        tell(f"{scalar} flash", mine, errors)
        steps = [row for row in mine if row[1].rpartition(" ")[2].startswith(("predict", "update"))]
        S = np.array([stack_traits(row[2]) for row in steps], float)
        y = np.array([row[4] - WIDTH[scalar] * row[2].arrays for row in steps], float)
        x, errors = fitted(S, y, 64)
        stack[scalar] = {kind: round(float(each), 2) for kind, each in zip(STACK_COLUMNS, x, strict=True)}
        tell(f"{scalar} stack", steps, errors)
    mine = [row for row in found if row[0] == "routines"]
    kinds = sorted({kind for row in mine for kind in row[2].counts})
    A = np.array([[row[2].counts[kind] for kind in kinds] for row in mine], float)
    x, errors = fitted(A, np.array([row[3] for row in mine], float), 256)
    tell("routines", mine, errors)
    return flash, stack, {kind: round(float(each), 2) for kind, each in zip(kinds, x, strict=True)}


def tell(title: str, mine: list[Row], errors: np.ndarray) -> None:
    worst = np.argsort(-np.abs(errors))[:8]
    print(f"{title}: {len(mine)} functions, rms {np.sqrt(np.mean(errors**2)):.1%}")
    for i in worst:
        print(f"  {errors[i]:+.0%}  {mine[i][1]}: flash {mine[i][3]}, stack {mine[i][4]}")


def write(flash: Tables, stack: Tables, routines: dict[str, float]) -> None:
    """kfgen/ir/sizes.py."""
    lines = [
        '"""Bytes on a Cortex-M4F, by scalar and kind; written by `python -m tests.benchmarks.calibrate`."""',
        "",
        "from __future__ import annotations",
        "",
        "from collections.abc import Mapping",
    ]
    for name, table in (("FLASH", flash), ("STACK", stack)):
        lines += ["", f"{name}: Mapping[str, Mapping[str, float]] = {{"]
        for scalar, row in table.items():
            lines += [f'    "{scalar}": {{', *(f'        "{kind}": {size},' for kind, size in row.items()), "    },"]
        lines.append("}")
    lines += ["", "ROUTINES: Mapping[str, float] = {", *(f'    "{op}": {size},' for op, size in routines.items()), "}"]
    lines += ["", f"WIDTH: Mapping[str, int] = {WIDTH}".replace("'", '"'), ""]
    (ROOT / "kfgen/ir/sizes.py").write_text("\n".join(lines))


if __name__ == "__main__":
    sys.exit(main())
