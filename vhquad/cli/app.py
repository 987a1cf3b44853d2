"""The app: global options, the commands, and `main`, the entry point.

Only typer is imported here; numpy, torch, rich and the rest of vhquad wait for a command to run,
so that ``vhquad --help`` answers at once.
"""

from __future__ import annotations

import atexit
import gc
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import Annotated

import typer

from vhquad import __version__
from vhquad.cli.check import check
from vhquad.cli.evaluate import evaluate
from vhquad.cli.guard import INTERRUPTED, Shell
from vhquad.cli.predict import predict
from vhquad.cli.preprocess import preprocess
from vhquad.cli.remesh import remesh
from vhquad.cli.train import train

__all__ = ["app", "main"]

GLOBAL = ("--debug", "--quiet", "-q")

app = typer.Typer(
    name="vhquad",
    help="From a triangle mesh to quads whose edges flow as an artist would have drawn them.",
    epilog="`vhquad COMMAND --help` explains the options of a command.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
app.command()(remesh)
app.command()(predict)
app.command()(check)
app.command()(preprocess)
app.command()(train)
app.command()(evaluate)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"vhquad {__version__}")
        raise typer.Exit


@app.callback()
def options(
    ctx: typer.Context,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks.")] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print errors and warnings only.")
    ] = False,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """From a triangle mesh to quads whose edges flow as an artist would have drawn them."""
    ctx.obj = Shell(debug=debug, quiet=quiet)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; leaves by SystemExit, as ``sys.exit`` does."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    # Importing torch makes half a million objects that stay. Looking through them for garbage takes
    # 0.2 s of CPU time on the way and 0.5 s on leaving.
    gc.set_threshold(100_000, 20, 20)
    atexit.register(gc.freeze)
    signal.signal(signal.SIGTERM, _terminated)
    try:
        app(args=_global_first(given), prog_name="vhquad")
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


def _global_first(arguments: list[str]) -> list[str]:
    """Let the global options stand after the command too."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    moved = [a for a in arguments[:end] if a in GLOBAL]
    return moved + [a for a in arguments[:end] if a not in GLOBAL] + arguments[end:]


def _terminated(signum: int, frame: FrameType | None) -> None:
    """On SIGTERM leave as on an exception, so that temporary files are removed."""
    sys.exit(128 + signum)
