"""`kfgen diff`: what changed between two specs, or between generated files and a spec."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kfgen.commands.options import example
from kfgen.commands.tables import Part, Table, show
from kfgen.errors import KfgenError

if TYPE_CHECKING:
    from kfgen.cost import Cost
    from kfgen.difference import Behaviour, Change, Side


@click.command(
    short_help="What changed between two specs, or generated files and a spec.",
    epilog=example("kfgen diff old.yaml new.yaml", "kfgen diff generated/vehicle specs/vehicle.yaml --log drive.csv"),
)
@click.argument("old", type=click.Path(path_type=Path, exists=True), metavar="OLD")
@click.argument("new", type=click.Path(path_type=Path, exists=True), metavar="NEW")
@click.option("--log", type=click.Path(path_type=Path), metavar="LOG", help="The track; a simulated one without.")
@click.option("--target", metavar="T", default="cortex-m4f", show_default=True, help="What costs are measured for.")
@click.option("--no-cost", is_flag=True, help="Leave out the cost, which takes a cross compiler.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def diff(old: Path, new: Path, log: Path | None, target: str, no_cost: bool, as_json: bool) -> None:
    """Compare two filters: the C interface, what they compute over one track, what they cost.

    OLD and NEW are specs; one of them may be a folder of generated files (or one of the two files), as it was vendored.
    The track is a log, or is simulated from NEW's model. States are compared that both have: the largest difference
    of x, in units and in OLD's standard deviations, and the largest relative difference of the variance.
    """
    from kfgen.difference import behave, changes, sides
    from kfgen.logs import read
    from kfgen.simulate import simulate

    before, after = sides(old, new)
    track = simulate(after.generated.spec) if log is None else read(log, after.generated.spec)
    found = changes(before.header, after.header, (before.generated.spec.name, after.generated.spec.name))
    behaviour: Behaviour | str
    try:
        behaviour = behave(before, after, track)
    except KfgenError as error:
        behaviour = str(error)
    costs: tuple[Cost, Cost] | str = "" if no_cost else _costs(before, after, target)
    if as_json:
        click.echo(json.dumps(_plain(found, behaviour, costs), indent=2))
        return
    show(*_report(before, after, found, behaviour, costs))


def _costs(before: Side, after: Side, target: str) -> tuple[Cost, Cost] | str:
    """Both, each over a track of its own model; a message where they cannot be measured."""
    from kfgen.cost import measure
    from kfgen.simulate import simulate

    try:
        first, second = (measure(s.generated, simulate(s.generated.spec, 60), target) for s in (before, after))
    except KfgenError as error:
        return str(error)
    return first, second


def _report(
    before: Side, after: Side, found: Sequence[Change], behaviour: Behaviour | str, costs: tuple[Cost, Cost] | str
) -> list[Part]:
    parts: list[Part] = [f"old: {before.title}", f"new: {after.title}"]
    names = [side.generated.spec.name for side in (before, after)]
    parts += [f"name: {names[0]} is {names[1]} now, and so all prefixes"] if names[0] != names[1] else []
    parts += ["", "interface"]
    if found:
        parts.append("\n".join(line for each in found for line in _told(each)))
    else:
        parts.append("the same")
    parts += ["", "behaviour"]
    if isinstance(behaviour, str):
        parts.append(f"not compared: {behaviour}")
    else:
        rows = [(n, f"{x:.3g}", f"{s:.2g}", f"{v:.2g}") for n, (x, s, v) in behaviour.states.items()]
        header = ("state", "largest difference", "in sigma", "variance, relative")
        parts += [f"{behaviour.rows} rows", Table([header, *rows], right=(1, 2, 3))]
        parts += [f"{name}: another status in {n} rows" for name, n in behaviour.calls.items()]
    if isinstance(costs, str):
        return [*parts, "", "cost", f"not measured: {costs}"] if costs else parts
    return [*parts, "", "cost", _cost_table(*costs)]


def _told(change: Change) -> list[str]:
    """As `diff` prints it."""
    return [f"{sign} {text}" for sign, text in (("-", change.before), ("+", change.after)) if text]


def _cost_table(old: Cost, new: Cost) -> Table:
    rows = [("", "old", "new", "change")]
    for name in [*old.functions, *(name for name in new.functions if name not in old.functions)]:
        pair = [each.functions[name].mean if name in each.functions else None for each in (old, new)]
        rows.append((f"{name}, {new.unit}", *_pair(*pair)))
    for what in ("flash", "ram", "stack"):
        title = "RAM" if what == "ram" else what
        rows.append((f"{title}, bytes", *_pair(float(getattr(old, what)), float(getattr(new, what)))))
    return Table(rows, right=(1, 2, 3))


def _pair(old: float | None, new: float | None) -> tuple[str, str, str]:
    words = tuple("" if each is None else f"{each:.1f}".removesuffix(".0") for each in (old, new))
    change = f"{100 * (new / old - 1):+.1f} %" if old and new is not None else ""
    return words[0], words[1], change


def _plain(found: Sequence[Change], behaviour: Behaviour | str, costs: tuple[Cost, Cost] | str) -> dict[str, Any]:
    interface = [{"item": c.item, "kind": c.kind, "old": c.before, "new": c.after} for c in found]
    compared = {"not_compared": behaviour} if isinstance(behaviour, str) else behaviour.as_json()
    cost: Any = {"not_measured": costs} if costs else None
    if not isinstance(costs, str):
        cost = {"old": costs[0].as_json(), "new": costs[1].as_json()}
    return {"interface": interface, "behaviour": compared, "cost": cost}
