"""The command `kfgen`: its group, and the one place that turns exceptions into messages and exit statuses.

Exit status: 0 done, 1 a check failed, 2 the spec, the call or its surroundings are wrong.
"""

from __future__ import annotations

import gc
import os
import sys
from typing import Any

import click

from kfgen import __version__
from kfgen.commands.build import build
from kfgen.commands.check import check
from kfgen.commands.cost import cost
from kfgen.commands.diff import diff
from kfgen.commands.doctor import doctor
from kfgen.commands.language import language
from kfgen.commands.new import new
from kfgen.commands.report import report
from kfgen.commands.run import run
from kfgen.commands.schema import schema
from kfgen.commands.simulate import simulate
from kfgen.commands.smooth import smooth
from kfgen.commands.tune import tune
from kfgen.errors import KfgenError

# matrices here are small: a pool of threads only makes them wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

INTERRUPTED = 130  # 128 + SIGINT, as shells have it


class Group(click.Group):
    """Runs a command; errors become one message on stderr and a status, never a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            result = super().invoke(ctx)
            if sys.stdout is not None:  # None where the caller has closed it
                sys.stdout.flush()
            return result
        except KfgenError as error:
            _fail(ctx, str(error))
        except BrokenPipeError:
            # the reader has gone; keep Python from complaining about it again at exit
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(2)
        except OSError as error:
            name = f"{error.filename}: " if error.filename else ""
            _fail(ctx, f"{name}{error.strerror or error}")
        except KeyboardInterrupt:
            click.echo("kfgen: interrupted", err=True)
            ctx.exit(INTERRUPTED)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except Exception as error:
            if os.environ.get("KFGEN_TRACEBACK"):
                raise
            text = f"internal error: {type(error).__name__}: {error}"
            _fail(ctx, f"{text}\nPlease report it with the output of the same call under KFGEN_TRACEBACK=1.")


def _fail(ctx: click.Context, message: str) -> None:
    """Print an error and leave with status 2; lines that name a place in a file stand as they are."""
    click.echo(message if _names_a_place(message) else f"kfgen: {message}", err=True)
    ctx.exit(2)


def _names_a_place(message: str) -> bool:
    parts = message.partition("\n")[0].split(":")
    return len(parts) > 2 and parts[1].isdigit()


@click.group(
    cls=Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Example: kfgen build specs/vehicle.yaml",
)
@click.version_option(__version__, prog_name="kfgen")
def cli() -> None:
    """Turn Kalman-filter specs in YAML into specialised C."""


_COMMANDS = (new, build, check, run, report, tune, smooth, simulate, cost, diff, language, schema, doctor)
for command in _COMMANDS:
    cli.add_command(command)


def main() -> None:
    """The entry point of the console script."""
    gc.set_threshold(100_000)  # a build makes many expressions and few cycles: looking for these is a tenth of it
    cli(prog_name="kfgen")
