"""`python -m tests.fixed.exhaustive [FUNCTION ...]`: all 2^32 arguments of the one-argument routines, in q16.16.

Prints, for each function, the largest error in units of the last place and where it occurs, and fails if that is
beyond the function's bound, a result goes down where the function goes up, or a flag is wrong. Takes minutes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from jinja2 import Environment

FUNCTIONS = (
    "floor", "sqrt", "reciprocal", "sin", "cos", "tan", "atan", "asin", "acos", "exp", "log", "sinh", "cosh", "tanh",
)  # fmt: skip
BOUNDS = dict.fromkeys(FUNCTIONS, 1.0) | {"tan": 2.0}
"""The largest error, in units of the last place."""
PARTS = 32


@dataclass(frozen=True)
class Found:
    """What the program prints."""

    error: float
    at: int
    crossed: int
    crossed_at: int
    wrong: int
    wrong_at: int


def build(folder: Path, routines: str, flags: Sequence[str] = ("-O2",), compiler: str = "gcc") -> Path:
    """The program, made of the text of the routines."""
    template = Path(__file__).with_name("exhaustive.c.j2").read_text()
    environment = Environment(trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    (folder / "exhaustive.c").write_text(environment.from_string(template).render(routines=routines))
    command = [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", *flags, "exhaustive.c", "-lm", "-o", "exhaustive"]
    subprocess.run(command, cwd=folder, check=True)
    return folder / "exhaustive"


def run(
    program: Path, function: str, fa: int, fr: int, first: int, count: int, block: int = 2**33, skip: int = 0
) -> Found:
    """Of `count` arguments from `first` on, in blocks with gaps."""
    numbers = [str(each) for each in (fa, fr, first, count, block, skip)]
    done = subprocess.run([program, function, *numbers], capture_output=True, text=True, check=True)
    assert done.stderr == "", done.stderr
    error, *others = done.stdout.split()
    return Found(float(error), *map(int, others))


def main(names: Sequence[str]) -> int:
    sys.path.insert(0, str(Path(__file__).parent))
    from routines import source

    wrong = 0
    with TemporaryDirectory() as name, ThreadPoolExecutor(os.cpu_count()) as pool:
        program = build(Path(name), source(FUNCTIONS))
        # parts share an argument, so that the step from one to the next is seen too
        parts = [(max(-(2**31), -(2**31) + k * 2**32 // PARTS - 1), 2**32 // PARTS + 1) for k in range(PARTS)]
        for function in names or FUNCTIONS:
            start = time.perf_counter()
            found = list(pool.map(lambda part, f=function: run(program, f, 16, 16, *part), parts))
            worst = max(found, key=lambda each: each.error)
            crossed, flags = sum(each.crossed for each in found), sum(each.wrong for each in found)
            good = worst.error <= BOUNDS[function] and crossed == 0 and flags == 0
            wrong += not good
            seconds = time.perf_counter() - start
            print(
                f"{function:10} error {worst.error:.6f} ulp at {worst.at:11}, against the function's course {crossed}, "
                f"wrong flags {flags}, {seconds:.0f} s{'' if good else '  WRONG'}",
                flush=True,
            )
    return wrong != 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
