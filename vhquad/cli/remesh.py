"""`vhquad remesh`: a triangle mesh to quads."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vhquad.cli.guard import INVALID, Shell, guarded, warn
from vhquad.cli.options import (
    Device,
    FullResolution,
    JsonFile,
    Mesh,
    ModelFile,
    NoCache,
    Threads,
    limit_threads,
    parse_crease,
)
from vhquad.cli.outputs import MESHES, check_outputs, json_file
from vhquad.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vhquad.field.cross import CrossField
    from vhquad.mesh.load import LoadedMesh
    from vhquad.mesh.triangle import TriMesh
    from vhquad.quad.pipeline import RemeshResult

__all__ = ["remesh"]


class Method(str, Enum):
    """Where the cross field comes from."""

    learned = "learned"
    curvature = "curvature"


class Symmetry(str, Enum):
    """Where the mirror plane is sought."""

    off = "off"
    x = "x"
    y = "y"
    z = "z"
    auto = "auto"


@guarded
def remesh(
    ctx: typer.Context,
    mesh: Mesh,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="The quads: .obj, .ply or .off.  [default: MESH_quads.obj]",
            show_default=False,
        ),
    ] = None,
    target_quads: Annotated[
        int | None,
        typer.Option(
            "--target-quads",
            "-n",
            metavar="N",
            help="How many quads to make.  [default: what the predicted sizes amount to]",
            show_default=False,
        ),
    ] = None,
    edge_length: Annotated[
        float | None,
        typer.Option(
            "--edge-length",
            metavar="L",
            help="Mean edge length of the quads, in units of the mesh, in place of a number.",
            show_default=False,
        ),
    ] = None,
    adaptivity: Annotated[
        float,
        typer.Option(
            "--adaptivity",
            metavar="A",
            help="0 for quads of one size, 1 for the sizes of the field, or between.",
        ),
    ] = 1.0,
    density: Annotated[
        str | None,
        typer.Option(
            "--density",
            metavar="NAME",
            help="A positive factor on the quads per area from the mesh's file: a vertex property "
            "of a PLY by its name, or `color` (white 4, mid-grey 1, black 1/4).",
            show_default=False,
        ),
    ] = None,
    symmetry: Annotated[
        Symmetry,
        typer.Option(
            "--symmetry",
            help="Quads that are exactly their own mirror image, with an edge loop on the plane: "
            "the best one across an axis, or (auto) the best of all, if the mesh is symmetric.",
        ),
    ] = Symmetry.off,
    crease: Annotated[
        str,
        typer.Option(
            "--crease",
            metavar="DEG|off",
            help="Keep edges whose faces turn by more than so many degrees. Line elements (l) of "
            "an OBJ file count as creases in place of those found.",
        ),
    ] = "40",
    sharp: Annotated[
        Path | None,
        typer.Option(
            "--sharp",
            metavar="FILE",
            help="Edges to keep from a QuadWild .sharp file, in place of --crease.",
            show_default=False,
        ),
    ] = None,
    method: Annotated[
        Method,
        typer.Option("--method", help="Cross field by the network, or along the curvature."),
    ] = Method.learned,
    field: Annotated[
        Path | None,
        typer.Option(
            "--field",
            metavar="FILE",
            help="A cross field of your own: .ffield, .vfield, .rosy, .rawfield, .dmat, or "
            "NeurCross .txt.",
            show_default=False,
        ),
    ] = None,
    model: ModelFile = None,
    device: Device = "auto",
    full_resolution: FullResolution = False,
    no_cache: NoCache = False,
    threads: Threads = None,
    seed: Annotated[int, typer.Option("--seed", help="The same seed gives the same quads.")] = 0,
    uv_out: Annotated[
        Path | None,
        typer.Option(
            "--uv-out",
            metavar="FILE",
            help="Write the triangles with the integer-grid map as texture (.obj, for libQEx).",
            show_default=False,
        ),
    ] = None,
    json: JsonFile = None,
    preview: Annotated[
        Path | None,
        typer.Option(
            "--preview",
            metavar="FILE",
            help="Draw input, field and quads to a .png (needs: pip install 'vhquad[viz]').",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Turn a triangle mesh into an all-quad mesh.

    The cross field comes from the network unless --method or --field say otherwise.
    """
    limit_threads(threads)
    target = mesh.with_name(f"{mesh.stem}_quads.obj") if out is None else out
    angle = parse_crease(crease)
    check_outputs(
        [
            ("--out", target, MESHES),
            ("--uv-out", uv_out, (".obj",)),
            ("--json", json_file(json), (".json",)),
            ("--preview", preview, (".png",)),
        ],
        inputs=[mesh, field, sharp],
    )
    if field is not None and (model is not None or method is Method.curvature):
        raise ConfigError("--field brings its own field; leave out --model and --method")
    if model is not None and method is Method.curvature:
        raise ConfigError("--method curvature uses no model; leave out --model")
    shell: Shell = ctx.obj
    from vhquad.cli.progress import Progress
    from vhquad.cli.show import publish

    with Progress(shell.quiet, "loading libraries") as progress:
        from vhquad import api
        from vhquad.mesh.io import write_quad_mesh
        from vhquad.mesh.scalars import read_density
        from vhquad.quad.pipeline import RemeshSettings
        from vhquad.quad.remeshing import remesh_predicted, remesh_with
        from vhquad.quad.sizing import checked_density
        from vhquad.watch import Watch

        if preview is not None:
            from vhquad.picture import check_viz

            check_viz()
        settings = RemeshSettings(
            target_quads=target_quads,
            edge_length=edge_length,
            crease=angle,
            adaptivity=adaptivity,
            symmetry=symmetry.value,
            seed=seed,
        )
        watch = Watch()
        progress(f"reading {mesh}")
        with watch("read and repair"):
            loaded = api.load(mesh) if no_cache else api.load_kept(mesh)
        factor = None
        if density is not None:
            count = loaded.mesh.n_vertices
            factor = checked_density(read_density(loaded, density), count, f"--density {density}")
        creases = _given_creases(loaded, angle, sharp)
        progress("the cross field")
        if field is not None:
            with watch("field"):
                cross = api.own_field(loaded.mesh, field)
            surface = loaded.mesh
            result = remesh_with(
                surface,
                cross,
                settings,
                creases=creases,
                density=factor,
                with_uv=uv_out is not None,
                cache=not no_cache,
                repair_lines=loaded.lines(),
                watch=watch,
                progress=progress,
            )
        else:

            def predicted(surface: TriMesh, of: TriMesh | None) -> CrossField:
                return api.predict(
                    surface,
                    model,
                    method=method.value,
                    resolution="full" if full_resolution else "auto",
                    device=device,
                    cache=not no_cache,
                    of=of,
                    progress=progress,
                )

            made = remesh_predicted(
                loaded.mesh,
                predicted,
                settings,
                creases=creases,
                density=factor,
                stand_in=not full_resolution,
                cache=not no_cache,
                with_uv=uv_out is not None,
                repair_lines=loaded.lines(),
                watch=watch,
                progress=progress,
            )
            result, cross, surface = made.result, made.field, made.mesh
        progress("writing")
        write_quad_mesh(target, result.quads)
        if uv_out is not None:
            _write_uv(uv_out, result)
        if preview is not None:
            from vhquad.preview import draw_preview

            progress("drawing the preview")
            draw_preview(preview, surface, cross, result.quads)
    publish(shell, json, result.report, str(target))
    _judge(loaded, result)


def _given_creases(
    loaded: LoadedMesh, angle: float | None, sharp: Path | None
) -> NDArray[np.int64] | None:
    """Vertex pairs from a file of edges, else from the mesh file's lines; None to look for some."""
    if sharp is not None:
        from vhquad.field.sharp import read_sharp

        return read_sharp(sharp, loaded.mesh)
    return None if angle is None else loaded.crease_edges


def _write_uv(path: Path, result: RemeshResult) -> None:
    from vhquad.mesh.io import write_obj_with_uv

    if result.uv is None:
        warn(f"{path} was not written: some component has no integer-grid map (see the report)")
        return
    write_obj_with_uv(path, result.uv.mesh, result.uv.uv)
    if result.uv.flips:
        warn(f"{path}: {result.uv.flips} triangles of the map are folded; ask for more quads")


def _judge(loaded: LoadedMesh, result: RemeshResult) -> None:
    """Say what fell short; leave with a code of its own if the quads are no valid mesh."""
    report = result.report
    for line in report.shortfalls():
        warn(line)
    if loaded.report.lost_components:
        warn(f"{loaded.report.lost_components} components of the input have no area and are lost")
    if report.quality is not None and not report.quality.is_valid:
        raise typer.Exit(INVALID)
