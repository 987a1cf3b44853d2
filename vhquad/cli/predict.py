"""`vhquad predict`: the cross field that a trained network sees in a mesh, to a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from vhquad.cli.guard import Shell, guarded, warn
from vhquad.cli.options import (
    Device,
    FullResolution,
    JsonFile,
    Mesh,
    ModelFile,
    NoCache,
    Threads,
    limit_threads,
)
from vhquad.cli.outputs import MESHES, check_outputs, json_file

__all__ = ["FIELDS", "predict"]

FIELDS = (".ffield", ".vfield", ".rosy", ".rawfield", ".dmat")


@guarded
def predict(
    ctx: typer.Context,
    mesh: Mesh,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="The field's file; the suffix gives the format: .ffield, .rosy, .rawfield and "
            ".dmat hold a cross for each face, .vfield one for each vertex.  "
            "[default: MESH with the suffix .ffield]",
            show_default=False,
        ),
    ] = None,
    model: ModelFile = None,
    device: Device = "auto",
    full_resolution: FullResolution = False,
    no_cache: NoCache = False,
    threads: Threads = None,
    mesh_out: Annotated[
        Path | None,
        typer.Option(
            "--mesh-out",
            metavar="FILE",
            help="Write the mesh that the field belongs to: MESH as triangles, repaired.",
            show_default=False,
        ),
    ] = None,
    json: JsonFile = None,
) -> None:
    """Predict a cross field and write it beside the mesh.

    A cross says in which directions the edges of quads should run. Use the file with
    `vhquad remesh --field`, QuadWild, Directional or libigl.
    """
    limit_threads(threads)
    target = mesh.with_suffix(".ffield") if out is None else out
    check_outputs(
        [
            ("--out", target, FIELDS),
            ("--mesh-out", mesh_out, MESHES),
            ("--json", json_file(json), (".json",)),
        ],
        inputs=[mesh],
    )
    shell: Shell = ctx.obj
    from vhquad.cli.progress import Progress
    from vhquad.cli.show import publish

    with Progress(shell.quiet, "loading libraries") as progress:
        from vhquad import api
        from vhquad.field.io import FORMAT_LOSSES, write_field
        from vhquad.mesh.io import write_triangle_mesh
        from vhquad.watch import Watch

        watch = Watch()
        progress(f"reading {mesh}")
        with watch("read and repair"):
            loaded = api.load(mesh) if no_cache else api.load_kept(mesh)
        progress("predicting the field")
        with watch("predict"):
            field = api.predict(
                loaded.mesh,
                model,
                resolution="full" if full_resolution else "auto",
                device=device,
                cache=not no_cache,
                progress=progress,
            )
        progress("writing")
        with watch("write"):
            write_field(target, loaded.mesh, field)
            if mesh_out is not None:
                write_triangle_mesh(mesh_out, loaded.mesh)
        report = api.describe_field(loaded.mesh, field, loaded.lines(), watch.seconds)
        report = replace(report, lost=FORMAT_LOSSES[target.suffix.lower()])
    if loaded.report.changed and mesh_out is None:
        warn(
            f"{mesh} was repaired, and the field has a row for each element of the repaired mesh; "
            "--mesh-out FILE writes that mesh"
        )
    publish(shell, json, report, f"{target}")
