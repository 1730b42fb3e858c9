"""`python -m tests.benchmarks`: measure every problem, print it beside its ceilings and the other libraries.

    python -m tests.benchmarks             # measured/ceiling, in aligned columns
    python -m tests.benchmarks --markdown  # the table of the README

Exit status 1 where a ceiling is exceeded, 2 where a tool is missing.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor

from kfgen.commands.tables import aligned
from kfgen.cost import Cost
from tests.benchmarks.budgets import CEILINGS, GENERATION, INERTIAL, PROBLEMS, cost, inertial_cost
from tests.benchmarks.generation import cold_build
from tests.benchmarks.tools import missing

HEAD = ("problem", "n, m", "form", "instructions", "flash", "RAM", "stack", "YAFL insn / flash", "TinyEKF insn")


def main(arguments: list[str]) -> int:
    """Measure and print; the exit status."""
    if missing():
        print(f"not measured: {', '.join(missing())} not found", file=sys.stderr)
        return 2
    with ProcessPoolExecutor() as pool:
        costs = dict(zip(CEILINGS, pool.map(cost, *zip(*CEILINGS, strict=True)), strict=True))
    wall, processor = cold_build(PROBLEMS["chain16"].spec)
    if "--markdown" in arguments:
        rows = [HEAD, ("---",) * len(HEAD), *(_row(*key, found, ceilings=False) for key, found in costs.items())]
        print("\n".join(f"| {' | '.join(row)} |" for row in rows))
    else:
        print("\n".join(aligned([HEAD, *(_row(*key, found, ceilings=True) for key, found in costs.items())])))
        print("\nmeasured/ceiling, in bytes; instructions of one predict and one update, the mean over the log")
    print(f"\nkfgen build of chain16 in a cold process: {wall:.2f} s, {processor:.2f} s of them processor time")
    seconds = cold_build(INERTIAL.read_text())[0]
    count = inertial_cost().instructions["predict"][0]
    print(f"24-state inertial filter, full: predict {count} instructions, built in {seconds:.2f} s")
    over = [f"{', '.join(key)}: {'; '.join(CEILINGS[key].exceeded(found))}" for key, found in costs.items()
            if CEILINGS[key].exceeded(found)]  # fmt: skip
    if wall > GENERATION:
        over.append(f"kfgen build of chain16: {wall:.2f} s > {GENERATION:g} s")
    for each in over:
        print(f"over its ceiling: {each}", file=sys.stderr)
    return 1 if over else 0


def _row(name: str, form: str, found: Cost, ceilings: bool) -> tuple[str, ...]:
    problem, most = PROBLEMS[name], CEILINGS[name, form]
    pairs = (
        (round(found.step), most.instructions), (found.flash, most.flash), (found.ram, most.ram),
        (found.stack, most.stack),
    )  # fmt: skip
    figures = (f"{value}/{ceiling}" if ceilings else str(value) for value, ceiling in pairs)
    yafl = f"{problem.yafl[0]} / {problem.yafl[1]}"
    return (name, f"{problem.n}, {problem.m}", form, *figures, yafl, str(problem.tinyekf))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
