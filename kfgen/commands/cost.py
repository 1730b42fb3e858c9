"""`kfgen cost`: what a filter costs on a microcontroller."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kfgen.commands.options import example, load_spec, ranges_option, read_ranges, scalar_option, spec_argument
from kfgen.commands.progress import progress
from kfgen.commands.tables import Part, Table, show

if TYPE_CHECKING:
    from kfgen.cost import Cost
    from kfgen.cost.target import Target
    from kfgen.spec.types import Spec

BUDGET_TARGET = "cortex-m4f"  # what the budgets of a spec are for


@click.command(
    short_help="Measure instructions, flash, RAM and stack in an emulator.",
    epilog=example(
        "kfgen cost specs/vehicle.yaml",
        "kfgen cost specs/vehicle.yaml --target cortex-m0 --mhz 48",
        "kfgen cost specs/vehicle.yaml --log drive.csv --rows 500 --json",
    ),
)
@spec_argument
@click.option(
    "--target", metavar="T", default="cortex-m4f", show_default=True,
    help="cortex-m4f, cortex-m0, cortex-m3, cortex-m7, cortex-m33, rv32imc, rv32imafc, avr or host.",
)  # fmt: skip
@click.option("--log", type=click.Path(path_type=Path), metavar="LOG", help="The log to run; a simulated one without.")
@click.option("--rows", type=click.IntRange(1), default=60, show_default=True, help="Rows of the log that are run.")
@click.option("--mhz", type=click.FloatRange(0, min_open=True), metavar="N", help="Clock: also estimate microseconds.")
@click.option("--compiler", type=click.Choice(["gcc", "zig"]), help="In place of the preferred one that is installed.")
@click.option("--cflags", metavar="FLAGS", default="", help="Further options of the compiler.")
@scalar_option
@ranges_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def cost(
    spec: Path,
    target: str,
    log: Path | None,
    rows: int,
    mhz: float | None,
    compiler: str | None,
    cflags: str,
    scalar: str | None,
    ranges: Path | None,
    as_json: bool,
) -> None:
    """Cross-compile a filter and run it in an emulator over a log; no board is needed.

    Prints for each function the mean and the largest number of instructions (AVR: cycles), library functions
    included, its bytes of flash and its deepest stack; for the filter its flash, alone and with the libraries it pulls
    in, and its RAM. The code is compiled with -O2 -fno-math-errno; where the header recommends further flags for a
    gcc, also with these. Microseconds are an estimate: they leave out caches and the wait states of a flash.

    The Cortex-M and RISC-V targets need `pip install 'kfgen[cost]'`; an installed arm-none-eabi-gcc or
    riscv64-unknown-elf-gcc is preferred to the clang that this brings. AVR needs avr-gcc and simavr.

    Where the spec has budgets (code: flash, ram, stack) and the target is a cortex-m4f, the figures are held against
    them, those with the recommended flags if there are any: exit status 1 where one is exceeded.
    """
    from kfgen import logs
    from kfgen.cost import measure, recommended_flags, target_of
    from kfgen.generate import build
    from kfgen.simulate import simulate

    processor = target_of(target)
    loaded = load_spec(spec, scalar)
    with progress(4) as advance:
        advance(0, "log")
        data = simulate(loaded, rows) if log is None else logs.read(log, loaded)
        advance(1, "filter")
        generated = build(loaded, log=read_ranges(ranges, loaded), judge=False)
        advance(2, "measuring")
        plain = measure(generated, data, target, cflags.split(), compiler=compiler, rows=rows)
        found = {"measured": plain}
        flags = recommended_flags(generated.view)
        if flags and processor.takes_gcc_flags(compiler):
            advance(3, "measuring with the recommended flags")
            more = [*flags, *cflags.split()]
            found["recommended"] = measure(generated, data, target, more, compiler=compiler, rows=rows)
    over = exceeded(loaded, list(found.values())[-1])
    if as_json:
        click.echo(json.dumps(_plain(found, mhz, over, min(rows, data.rows), log), indent=2))
    else:
        source = "a simulated log" if log is None else str(log)
        show(*report(processor, found, mhz, f"{min(rows, data.rows)} rows of {source}"))
    for message in over:
        click.echo(f"kfgen: {message}", err=True)
    sys.exit(1 if over else 0)


def exceeded(spec: Spec, found: Cost) -> list[str]:
    """The budgets that a measurement exceeds, as messages."""
    if found.target != BUDGET_TARGET:
        return []
    pairs = {"flash": found.flash, "ram": found.ram, "stack": found.stack}
    messages = []
    for key, size in pairs.items():
        budget = getattr(spec.code, key)
        if budget is not None and size > budget:
            title = "RAM" if key == "ram" else key
            messages.append(f"{spec.name}: {size} bytes of {title}, {size - budget} above the budget of {budget}")
    return messages


def _plain(
    found: Mapping[str, Cost], mhz: float | None, over: Sequence[str], rows: int, log: Path | None
) -> dict[str, Any]:
    plain = found["measured"].as_json(mhz)
    recommended = found["recommended"].as_json(mhz) if "recommended" in found else None
    return {
        **plain, "rows": rows, "log": None if log is None else str(log), "mhz": mhz, "recommended": recommended,
        "over_budget": list(over),
    }  # fmt: skip


def report(target: Target, found: Mapping[str, Cost], mhz: float | None, source: str) -> list[Part]:
    """The tables, one for each set of flags."""
    first = found["measured"]
    parts: list[Part] = [f"{first.name} ({first.scalar}) on {target.title}, over {source}"]
    parts.append(f"compiled by {first.compiler}")
    parts += [f"note: {first.remark}"] if first.remark else []
    for cost in found.values():
        why = "recommended in the header" if len(found) > 1 and cost is not first else ""
        flags = " ".join(cost.flags)
        usual = "with -O2 -fno-math-errno"
        head = f"{usual}, {why}: {flags}" if why else f"{usual} {flags}".rstrip()
        parts += ["", head, _table(cost, mhz)]
        parts.append(
            f"flash {cost.flash} bytes, {cost.flash_linked} with the library functions it calls; "
            f"RAM {cost.ram} bytes a filter; stack {cost.stack} bytes"
        )
        if cost.errors:
            parts.append(f"{cost.errors} calls returned an error")
    if mhz is not None:
        parts += ["", f"us: estimated from cycles at {mhz:g} MHz, without caches and wait states"]
    return parts


def _table(cost: Cost, mhz: float | None) -> Table:
    rows: list[list[str]] = [["function", "calls", cost.unit, "worst", "us, estimate", "flash", "stack"]]
    for name, each in cost.functions.items():
        mean = "not called" if each.mean is None else f"{each.mean:.1f}".removesuffix(".0")
        worst = "" if each.worst is None else str(each.worst)
        stack = str(each.stack) if each.counts else ""
        rows.append([name, str(len(each.counts)), mean, worst, _time(each.cycles, mhz), str(each.flash), stack])
    total = sum(each.cycles or 0.0 for each in cost.functions.values())
    rows.append(["init and shared", "", "", "", "", str(cost.shared), str(cost.init_stack)])
    rows.append(["one of each", "", f"{cost.step:.0f}", "", _time(total, mhz), "", ""])
    if mhz is None:
        rows = [[*row[:4], *row[5:]] for row in rows]
    return Table(rows, right=range(1, len(rows[0])))


def _time(cycles: float | None, mhz: float | None) -> str:
    return "" if cycles is None or mhz is None else f"{cycles / mhz:.3g}"
