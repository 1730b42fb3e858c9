"""`kfgen build`: write the C files, or tell whether they are up to date."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kfgen.commands.built import Built
from kfgen.commands.options import example, load_spec, quiet_option, read_ranges, scalar_option, tell_advice
from kfgen.commands.plain import json_option, of_build, tell
from kfgen.commands.progress import progress
from kfgen.commands.tables import Notes, Part, Paths, Table, show
from kfgen.errors import KfgenError, Mistake, SpecError
from kfgen.layouts import Package, arrange, layouts
from kfgen.scalar_names import is_fixed
from kfgen.seal import is_edited, is_same, sealed

if TYPE_CHECKING:
    from kfgen.generate import Generated
    from kfgen.spec.types import Spec


@click.command(
    short_help="Write the C files of specs, or check that they are up to date.",
    epilog=example(
        "kfgen build specs/vehicle.yaml",
        "kfgen build specs/*.yaml -o src/filters",
        "kfgen build specs/vehicle.yaml --selftest --layout cmake -o lib",
        "kfgen build --check specs/*.yaml",
    ),
)
@click.argument("specs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SPEC...")
@click.option(
    "-o", "directory", type=click.Path(path_type=Path), default=Path("generated"), show_default=True,
    metavar="DIR", help="Write to DIR/<name>/.",
)  # fmt: skip
@scalar_option
@click.option(
    "--check", "only_check", is_flag=True,
    help="Write nothing; exit 1 with a unified diff when the files on disk are not what would be written.",
)  # fmt: skip
@click.option(
    "--log", "--ranges", "log", type=click.Path(path_type=Path), metavar="LOG.csv",
    help="A log whose ranges a fixed-point filter is to hold, beside those of simulated runs.",
)  # fmt: skip
@click.option("--force", is_flag=True, help="Also write over files that were edited by hand, or are not kfgen's.")
@quiet_option
@json_option
@click.option(
    "--selftest", is_flag=True,
    help="Also write <name>_selftest.c, which replays a recorded run: <name>_selftest() is 0 where the filter works.",
)  # fmt: skip
@click.option(
    "--layout", type=click.Choice(layouts()), default="plain", show_default=True,
    help="What the files are arranged for: a library of that build system.",
)  # fmt: skip
def build(
    specs: Sequence[Path],
    directory: Path,
    scalar: str | None,
    only_check: bool,
    log: Path | None,
    selftest: bool,
    layout: str,
    force: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Write the C files of one or more specs to DIR/<name>/, and print what they take.

    All specs are checked before anything is written. A file that is as it would be written is left untouched; one that
    was edited since it was written is refused. In the last line of each stands the hash of its body.
    """
    built = generate_all(specs, directory, scalar, selftest, layout, log)
    if not quiet:
        for each in built:
            tell_advice(each.spec, each.generated if not only_check else None)
    if only_check:
        sys.exit(1 if report_differences(built) else 0)
    from kfgen.files import write_all

    write_all(changed({path: text for each in built for path, text in each.files.items()}, force))
    if as_json:
        tell(of_build(built))
    else:
        show(*report(built))


def generate_all(
    paths: Sequence[Path],
    directory: Path,
    scalar: str | None,
    selftest: bool = False,
    layout: str = "plain",
    log: Path | None = None,
) -> list[Built]:
    """Generate every spec; a SpecError holds the mistakes of all of them. KfgenError for two of one name."""
    specs: list[Spec] = []
    mistakes: list[Mistake] = []
    for path in paths:
        try:
            specs.append(load_spec(path, scalar))
        except SpecError as error:
            mistakes += error.mistakes
    if mistakes:
        raise SpecError(mistakes)
    places: dict[str, Path] = {}
    for path, spec in zip(paths, specs, strict=True):
        # folders that differ only in case are one on some file systems
        other = places.setdefault(spec.name.lower(), path)
        if other is not path:
            raise KfgenError(f"{other} and {path} are both named `{spec.name}`; their files would overwrite each other")
    from kfgen.generate import build as generate

    built = []
    long = len(specs) > 1 or any(is_fixed(spec.scalar) for spec in specs)
    with progress(len(specs), long) as advance:
        for done, spec in enumerate(specs):
            advance(done, spec.name)
            try:
                generated = generate(spec, log=read_ranges(log, spec))
                texts = dict(generated.files)
                if selftest:
                    from kfgen.selftest import selftest as recorded

                    texts |= recorded(spec, generated)
                if layout != "plain":
                    texts = arrange(layout, _package(spec, generated, texts, layout))
                texts = {name: sealed(name, text) for name, text in texts.items()}
                built.append(Built(spec, generated, texts, directory / spec.name))
            except SpecError as error:
                mistakes += error.mistakes
    if mistakes:
        raise SpecError(mistakes)
    return built


def _package(spec: Spec, generated: Generated, texts: Mapping[str, str], layout: str) -> Package:
    """What a layout arranges."""
    from kfgen.cost.advice import recommended_flags
    from kfgen.spec.constants import value

    declared = generated.declarations
    functions = ["predict", *(f"update_{sensor.name}" for sensor in spec.measurements)]
    selftest = " --selftest" if f"{spec.name}_selftest.c" in texts else ""
    return Package(
        view=generated.view,
        sources=texts,
        command=f"{generated.view.command}{selftest} --layout {layout}",
        flags=tuple(recommended_flags(generated.view)),
        step=1.0 if spec.dt is None else float(value(spec.dt.nominal.tree, spec)),
        run_time=declared.takes("predict", "dt"),
        takes_inputs=tuple(name for name in functions if declared.takes(name, "u")),
    )


def changed(files: Mapping[Path, str], force: bool) -> dict[Path, str]:
    """Those of the files that the disk does not hold as they are. KfgenError names those on it that were edited."""
    out: dict[Path, str] = {}
    edited: list[Path] = []
    for path, text in files.items():
        old = _on_disk(path)
        if old == text:
            continue
        out[path] = text
        if old is not None and is_edited(old):
            edited.append(path)
    if edited and not force:
        listed = "\n".join(f"  {path}" for path in edited)
        raise KfgenError(
            "edited by hand since kfgen wrote them, or not written by kfgen:\n"
            f"{listed}\nnothing is written; move the changes elsewhere, or write over them with --force"
        )
    return out


def _on_disk(path: Path) -> str | None:
    try:
        return path.read_bytes().decode("utf-8", "surrogateescape")
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return None  # what cannot be written is told by who writes


def report_differences(built: Sequence[Built]) -> int:
    """Print a unified diff from the disk to what would be written; the number of files that differ.

    Files that differ in their stamp or line ends alone are named, and do not count.
    """
    count = 0
    for each in built:
        for path, text in each.files.items():
            old = _on_disk(path)
            if old == text:
                continue
            if old is not None and is_same(old, text):
                click.echo(f"kfgen: {path} differs in its stamp or line ends alone", err=True)
                continue
            count += 1
            before = "/dev/null" if old is None else str(path)
            # split at line feeds only: a carriage return on the disk is a difference, not a line end
            lines = difflib.unified_diff(_lines(old or ""), _lines(text), before, f"{path} (would be written)")
            shown = "".join(line if line.endswith("\n") else f"{line}\n" for line in lines)
            click.echo(shown.encode("utf-8", "replace").decode(), nl=False)
    if count:
        click.echo(f"kfgen: {count} file{'s differ' if count > 1 else ' differs'}; run `kfgen build`", err=True)
    return count


def _lines(text: str) -> list[str]:
    return [f"{line}\n" for line in text.split("\n")[:-1]] + [line for line in text.split("\n")[-1:] if line]


# --- what is shown


def report(built: Sequence[Built]) -> list[Part]:
    """Per filter its sizes and RAM, per function its flash, stack and arithmetic; then remarks, and the files."""
    filters = [("filter", "scalar", "size", "RAM")]
    functions = [("filter", "function", "flash", "stack", "operations")]
    notes: list[tuple[str, str]] = []
    for each in built:
        name, summary = each.spec.name, each.generated.summary
        forms, found = summary.forms, summary.prediction
        filters.append((name, each.spec.scalar, _sizes(each.spec), f"{summary.ram} B"))
        for function, counts in summary.rows:
            operations = _operations(counts) if counts or function not in forms else ""
            about = (_about(found.flash.get(function)), _about(found.stack.get(function)))
            functions.append((name, _with_form(function, forms), *about, operations))
        notes += [(name, note) for note in summary.notes]
        notes.append((name, _predicted(each.spec, found.totals)))
    files = [str(path) for each in built for path in each.files]
    return [Table(filters, right=(3,)), "", Table(functions, right=(2, 3)), "", Notes(notes), "", Paths(files)]


_TITLES = {"flash": "flash", "ram": "RAM", "stack": "stack"}


def _about(size: int | None) -> str:
    return "" if size is None else f"~{size}"


def _predicted(spec: Spec, totals: Mapping[str, int]) -> str:
    """Flash and stack, and the budgets there are."""
    parts = []
    for key, size in totals.items():
        budget = getattr(spec.code, key)
        if key != "ram" or budget is not None:
            of = "" if budget is None else f" of {budget}"
            parts.append(f"{'' if key == 'ram' else 'about '}{size}{of} bytes of {_TITLES[key]}")
    return f"{', '.join(parts)} on a Cortex-M4F, as predicted; `kfgen cost` measures"


def _sizes(spec: Spec) -> str:
    def plural(number: int, what: str) -> str:
        return f"{number} {what}{'s' if number != 1 else ''}"

    sizes = [plural(len(spec.states), "state")]
    if spec.inputs:
        sizes.append(plural(len(spec.inputs), "input"))
    return ", ".join([*sizes, *(f"{sensor.name}: {len(sensor.components)}" for sensor in spec.measurements)])


def _with_form(name: str, forms: Mapping[str, str]) -> str:
    """A function, and what was chosen for it."""
    return f"{name}: {forms[name]}" if name in forms else name


def _operations(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{number} {operation}" for operation, number in counts.items() if number) or "none"
