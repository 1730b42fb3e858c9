"""`python -m tests.benchmarks.fixed`: what fixed point costs, on a Cortex-M0 and on an AVR, beside soft float.

On the AVR also with the compiler's own products of 64 bits and the library's division, in place of those emitted.
Exit status 2 where a tool is missing.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from shutil import which

from kfgen.commands.tables import aligned
from kfgen.cost import Cost, measure
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.oracle import problems

ROWS = 20
SPECS = {"cv4": problems.CV4, "ball": problems.BALL}
FORMS = {"full": "standard", "ud": "bierman"}
HEAD = ("problem", "form", "target", "scalar", "instructions", "linked flash")
LIBRARY = """
static int32_t {q}_library(int32_t b, int s, {name}_status_t *status)
{{
    const int64_t size = b < 0 ? -(int64_t)b : b;
    if (b == 0) {{ return {q}_limit(false, status); }}
    const int64_t ratio = ((INT64_C(1) << s) + (size >> 1)) / size * (b < 0 ? -1 : 1);
    return ratio > INT32_MAX || ratio < -INT32_MAX ? {q}_limit(ratio < 0, status) : (int32_t)ratio;
}}
"""


def cost(problem: str, covariance: str, target: str, scalar: str = "q16.16", plain: bool = False) -> Cost:
    """One predict and one update of a problem. plain: with nothing but what C offers."""
    filter_ = {"covariance": covariance, "update": FORMS[covariance]}
    spec = override(loads(SPECS[problem]), scalar, filter=filter_)
    generated = build(spec)
    log = simulate(spec, ROWS)
    if not plain:
        return measure(generated, log, target=target)
    generated = replace(generated, files=_plain(spec.name, generated.files))
    return measure(generated, log, target=target, flags=("-w",))


def _plain(name: str, files: Mapping[str, str]) -> dict[str, str]:
    """With the library's division, and sums of 64 bits."""
    q = f"{name}_q"
    head, end, tail = files[f"{name}.c"].rpartition(f"{name}_status_t {name}_predict(")
    definition = re.compile(rf"^static int32_t {q}_reciprocal\(.*?^}}\n", re.DOTALL | re.MULTILINE)
    assert definition.search(head)
    head = definition.sub(LIBRARY.format(q=q, name=name), head)
    head = head.replace("__AVR_HAVE_MUL__", "OWN_PRODUCTS")  # which a header of the library would define again
    tail = tail.replace(f"{q}_mac(", f"{q}_clipped(")
    return {**files, f"{name}.c": (head + end + tail).replace(f"{q}_reciprocal(", f"{q}_library(")}


def main() -> int:
    """Measure and print; the exit status."""
    missing = [tool for tool in ("arm-none-eabi-gcc", "avr-gcc", "simavr") if which(tool) is None]
    if missing:
        print(f"not measured: {', '.join(missing)} not found", file=sys.stderr)
        return 2
    rows = [HEAD]
    for covariance in FORMS:
        for problem in SPECS:
            for scalar in ("q16.16", "float"):
                found = cost(problem, covariance, "cortex-m0", scalar)
                rows.append(_row(problem, covariance, "cortex-m0", scalar, found))
    for covariance in FORMS:
        for scalar, plain in (("q16.16", False), ("q16.16", True), ("float", False)):
            found = cost("cv4", covariance, "avr", scalar, plain)
            rows.append(_row("cv4", covariance, "avr (cycles)", f"{scalar}{', plain C' * plain}", found))
    print("\n".join(aligned(rows)))
    return 0


def _row(problem: str, covariance: str, target: str, scalar: str, found: Cost) -> tuple[str, ...]:
    return (problem, covariance, target, scalar, str(round(found.step)), str(found.flash_linked))


if __name__ == "__main__":
    sys.exit(main())
