"""`vhquad check`: is a quad mesh valid, and how good is it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vhquad.cli.guard import INVALID, Shell, guarded
from vhquad.cli.options import JsonFile
from vhquad.cli.outputs import check_outputs, json_file

__all__ = ["check"]


@guarded
def check(
    ctx: typer.Context,
    quads: Annotated[
        Path,
        typer.Argument(metavar="QUADS", help="The quad mesh: OBJ, PLY or OFF.", show_default=False),
    ],
    against: Annotated[
        Path | None,
        typer.Option(
            "--against",
            metavar="MESH",
            help="The surface it stands for: adds distances, topology and turned quads.",
            show_default=False,
        ),
    ] = None,
    json: JsonFile = None,
) -> None:
    """Judge a quad mesh, from vhquad or elsewhere; the exit code is 3 if it is not valid."""
    check_outputs([("--json", json_file(json), (".json",))], inputs=[quads, against])
    shell: Shell = ctx.obj
    from vhquad.cli.progress import Progress
    from vhquad.cli.show import publish

    with Progress(shell.quiet, "loading libraries") as progress:
        from vhquad import api

        progress(f"reading {quads}")
        report = api.check(quads, against)
    publish(shell, json, report, None)
    if not report.is_valid:
        raise typer.Exit(INVALID)
