"""What `frama-c -eva` cannot exclude in emitted fixed-point code: python -m tests.fixed.eva

It looks for signed overflow, shifts of negative numbers or out of range, indices out of bounds, and conversions left
to the implementation, in ball and cv4 in q16.16, of which no line is changed. In three parts:

* every routine that the filter calls, with any integers as arguments and every shift that it is made for;
* the functions of the filter: a call of any of them, with any arguments, in any state that an earlier call can have
  left. No number inside (an element of P, U or D) is beyond 2^30 - 1 then: init leaves it so, and every call does,
  which is proved with the rest. No variance is negative: of P this is proved too; that a D is not, is what the
  generator says of it, as of a quotient of what is positive;
* how large a reciprocal can be, on which the analysis of the functions rests: all 2^31 divisors are tried.

A part of a whole, such as D / (D + Q), is at most 1 for a reason that intervals do not see. So the functions are
analysed several times: with all that a variance may be at once, and by half binary orders of each variance in turn.
Each of these is an analysis of all states; an alarm stands if it is in all of them.

Exit status 1 where one stands. Needs frama-c (Debian: frama-c-base) and gcc; takes four minutes, nearly all
of them for the divisors.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from kfgen.generate import build
from kfgen.override import override
from kfgen.spec import load, loads
from kfgen.spec.types import Spec
from tests.oracle.problems import BALL

SPECS = Path(__file__).parents[2] / "specs"
FORMS = (("full", "standard"), ("ud", "bierman"))
OPTIONS = [
    "-eva", "-main", "check", "-machdep", "x86_64", "-eva-no-show-progress",
    "-warn-right-shift-negative", "-warn-left-shift-negative", "-warn-signed-downcast",
    "-cpp-extra-args=-I. -U__GNUC__",  # without built-in functions, of which eva knows nothing
]  # fmt: skip
SHIFTS = {
    "fma": (17, 32), "mac": (17, 32), "mul": (0, 62), "madd": (0, 62), "narrow": (0, 63), "shift": (-62, 62),
    "div": (-62, 62), "reciprocal": (0, 62), "sqrt": (-62, 62), "floor": (0, 31),
}  # fmt: skip
_HALVES = [pair for k in range(30) for pair in ((1 << k, 3 << k >> 1), ((3 << k >> 1) + 1, (2 << k) - 1))]
ORDERS = [(0, 0), *((low, high) for low, high in _HALVES if low <= high)]
INSIDE = 2**30 - 1

CONTRACT = """
#include <stdbool.h>
#include <stdint.h>

/*@ requires known: SHIFTS;
    assigns \\result \\from b, s;
    assigns *status \\from *status, b, s;
    ensures limits: -INT32_MAX <= \\result <= INT32_MAX;
    ensures size: b > 0 ==> 0 <= \\result <= (1 << s) / b + 1; */
static int32_t NAME_q_reciprocal(int32_t b, int s, uint32_t *status);
"""
HEAD = """
#include "__fc_builtin.h"
#include "NAME.c"

static int32_t any(void) { return Frama_C_interval(INT32_MIN, INT32_MAX); }
"""
RECIPROCALS = """
#include "NAME.c"
int main(void)
{
    uint32_t status = 0;
    for (int32_t b = 1; b < INT32_MAX; b++) {
        const int32_t found = NAME_q_reciprocal(b, SHIFT, &status);
        if (found < 0 || (int64_t)(found - 1) * b > INT64_C(1) << SHIFT) { return 1; }
    }
    return 0;
}
"""
ROUTINES = """
void check(void)
{
    uint32_t status = 0;
CALLS}
"""
FILTER = """
static NAME_t kf;
static int32_t x[STATES], P[STATES * STATES];

/* what init, and every function, leaves in the fields */
static void invariants(void)
{
INVARIANTS}

static void any_state(void)
{
FIELDS}

static void any_arguments(void)
{
    for (int i = 0; i < STATES; i++) { x[i] = any(); }
    for (int i = 0; i < STATES * STATES; i++) { P[i] = any(); }
}

void check(void)
{
    NAME_init(&kf);
    invariants();
CALLS}
"""
_ALARM = re.compile(r"\[eva:alarm\] ([\w.]+):(\d+): Warning:\s+(.*?[;.])(?=\n)", re.DOTALL)


def filters() -> Iterator[Spec]:
    for spec in (loads(BALL), load(SPECS / "cv4.yaml")):
        for covariance, update in FORMS:
            yield override(spec, "q16.16", filter={"covariance": covariance, "update": update})


def lines(*each: str) -> str:
    return "".join(f"    {line}\n" for line in each)


def routines(text: str) -> str:
    """A call of each routine that the filter's functions call."""
    body = text[text.index("_status_t NAME_init(") :]
    calls = []
    for op in sorted(set(re.findall(r"NAME_q_(\w+)\(", body))):
        found = re.search(rf"NAME_q_{op}\(([^)]*)\)\n{{", text)
        assert found is not None, op
        given = {"int32_t": "any()", "int": "Frama_C_interval({}, {})".format(*SHIFTS.get(op, (0, 0)))}
        arguments = [given.get(each.strip().split(" ")[0], "&status") for each in found[1].split(",")]
        calls.append(f"NAME_q_{op}({', '.join(arguments)});")
    return ROUTINES.replace("CALLS", lines(*calls))


def shifts(text: str) -> list[int]:
    """Those with which reciprocals are called."""
    flat = re.sub(r"\s+", " ", text)
    return sorted({int(s) for s in re.findall(r"NAME_q_reciprocal\([^,]*, (\d+), &flags\)", flat)})


def functions(spec: Spec, header: str, split: int | None) -> str:
    """Any function in any state; split: the variance that is taken by half binary orders."""
    n = len(spec.states)
    if "_real_t D[" in header:
        wide, variances = [f"U[{i}]" for i in range(n * (n - 1) // 2)], [f"D[{i}]" for i in range(n)]
    else:
        diagonal = [j * (j + 3) // 2 for j in range(n)]
        wide = [f"P[{i}]" for i in range(n * (n + 1) // 2) if i not in diagonal]
        variances = [f"P[{i}]" for i in diagonal]
    ranges = [(field, -INSIDE) for field in wide] + [(field, 0) for field in variances]
    proved = [(field, low if "P" in field else -INSIDE) for field, low in ranges]
    fields = [f"kf.{field} = Frama_C_interval({low}, {INSIDE});" for field, low in ranges]
    fields += [f"kf.x[{i}] = any();" for i in range(n)] + ["kf.nis = any();"]
    invariants = [f"/*@ check {low} <= kf.{field} <= {INSIDE}; */" for field, low in proved]
    calls = ["NAME_set_state(&kf, x);", "NAME_set_covariance(&kf, P);", "NAME_get_covariance(&kf, P);"]
    made = [f"any_state(); any_arguments(); {call} invariants();" for call in calls]
    steps = ["NAME_predict(&kf);"]
    for sensor in spec.measurements:
        z = ", ".join("any()" for _ in sensor.components)
        steps.append(f"{{ NAME_{sensor.name}_t z = {{ {z} }}; NAME_update_{sensor.name}(&kf, &z); }}")
    for low, high in [(0, INSIDE)] if split is None else ORDERS:
        chosen = f"kf.{variances[split or 0]} = Frama_C_interval({low}, {high});"
        made += [f"any_state(); {chosen} {step} invariants();" for step in steps]
    text = FILTER.replace("INVARIANTS", lines(*invariants)).replace("FIELDS", lines(*fields))
    return text.replace("CALLS", lines(*made)).replace("STATES", str(n))


def analysed(folder: Path, text: str, name: str, *options: str) -> set[str]:
    """The alarms of a harness, with the functions in which they are, and what was not proved of contracts."""
    (folder / "harness.c").write_text(text.replace("NAME", name))
    here = {**os.environ, "PWD": str(folder)}  # by which frama-c finds files
    done = subprocess.run(["frama-c", *OPTIONS, *options, "harness.c"], cwd=folder, env=here, capture_output=True,
                          text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr
    assert "100% of the logical properties reached have been proven" in done.stdout or _ALARM.search(done.stdout)
    found = {f"{_function(folder / file, int(line))}, line {line}: {' '.join(what.split())}"
             for file, line, what in _ALARM.findall(done.stdout)}  # fmt: skip
    assert found or "\n  0 alarms generated" in done.stdout, done.stdout[-3000:]
    return found


def _function(path: Path, line: int) -> str:
    """The function that a line is in."""
    heads = [text for text in path.read_text().splitlines()[:line] if re.match(r"\w[^;{]*\(", text)]
    return str(re.findall(r"(\w+)\(", heads[-1])[0]) if heads else path.name


def too_large(folder: Path, name: str, shift: int) -> bool:
    """Whether there is a reciprocal that its contract excludes."""
    program = f"reciprocal{shift}"
    (folder / f"{program}.c").write_text(RECIPROCALS.replace("NAME", name).replace("SHIFT", str(shift)))
    subprocess.run(["gcc", "-O2", "-w", f"{program}.c", "-o", program], cwd=folder, check=True)
    return subprocess.run([f"./{program}"], cwd=folder, check=False).returncode != 0


def written(spec: Spec, folder: Path) -> tuple[str, str, list[int]]:
    """Build a filter; its header, its source with NAME for its name, and the shifts of its reciprocals."""
    files = build(spec).files
    for file, content in files.items():
        (folder / file).write_text(content)
    text = files[f"{spec.name}.c"].replace(spec.name, "NAME")
    return files[f"{spec.name}.h"], text, shifts(text)


def assumed(known: list[int]) -> str:
    """What the analysis of the functions takes for granted."""
    return CONTRACT.replace("SHIFTS", " || ".join(f"s == {s}" for s in known))


def alarms(spec: Spec, folder: Path) -> dict[str, set[str]]:
    """Part -> alarms."""
    header, text, known = written(spec, folder)
    left: set[str] | None = None
    for split in (None, *range(len(spec.states))):
        if left != set():
            found = analysed(folder, assumed(known) + HEAD + functions(spec, header, split), spec.name,
                             "-eva-use-spec", f"{spec.name}_q_reciprocal")  # fmt: skip
            left = found if left is None else left & found
    return {"routines": analysed(folder, HEAD + routines(text), spec.name), "functions": left or set()}


def main() -> int:
    left, tried = 0, set()
    with TemporaryDirectory(prefix="kfgen-") as temporary, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(temporary)
        for spec in filters():
            for part, found in alarms(spec, folder).items():
                count = f"{len(found) or 'no'} alarm{'s' * (len(found) != 1)}"
                print(f"{spec.name} {spec.filter.covariance} {spec.filter.update}: {part}: {count}", *sorted(found),
                      sep="\n  ", flush=True)  # fmt: skip
                left += len(found)
            known = sorted(set(written(spec, folder)[2]) - tried)
            wrong = pool.map(partial(too_large, folder, spec.name), known)
            for shift, large in zip(known, wrong, strict=True):
                print(f"reciprocals, 2^{shift} / b: {'too large' if large else 'as large as was taken for granted'}")
                left += large
            tried |= set(known)
    return left > 0


if __name__ == "__main__":
    sys.exit(main())
