"""A remesh as its report tells it: a field predicted on the mesh or on its stand-in, then quads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.component import PAIRED
from vhquad.quad.mapping import Progress
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh
from vhquad.quad.place import Chosen, Place, choose_place, guessed_quads
from vhquad.report import MeshCounts
from vhquad.watch import Watch

__all__ = ["Predicted", "remesh_predicted", "remesh_with"]


@dataclass(frozen=True, eq=False)
class Predicted:
    """A remesh along a predicted field, and the field with the mesh it lives on."""

    result: RemeshResult
    field: CrossField
    mesh: TriMesh
    """The mesh itself, or its stand-in."""


def remesh_predicted(
    mesh: TriMesh,
    field_of: Callable[[TriMesh, TriMesh | None], CrossField],
    settings: RemeshSettings | None = None,
    *,
    creases: ArrayLike | None = None,
    density: ArrayLike | None = None,
    stand_in: bool = True,
    cache: bool = True,
    with_uv: bool = False,
    repair_lines: Sequence[str] = (),
    watch: Watch | None = None,
    progress: Progress | None = None,
) -> Predicted:
    """Predict a field and remesh by it, on a stand-in where the triangles do not suit the quads.

    Parameters
    ----------
    mesh : TriMesh
    field_of : callable
        Gives the cross field of a mesh, told which mesh it stands for, if it is a stand-in.
    stand_in : bool
        Whether another mesh may take the place of this one: a copy with its planes refined, if
        their triangles are far larger than its quads. And if neither the map was asked for nor a
        symmetry: a decimated copy, if the mesh is far finer, or one with its curved surfaces
        refined, if it is not finer at all. If no map is found on it, all is done again on the mesh
        itself.
    cache : bool
        Keep the stand-in and continuous maps, and use those that were kept.

    Other parameters are those of :func:`remesh_with`.
    """
    settings = settings or RemeshSettings()
    watch = watch or Watch()
    given = None if creases is None else np.asarray(creases, dtype=np.int64).reshape(-1, 2)
    factor = None if density is None else np.asarray(density, dtype=np.float64)
    itself = Place(mesh, given, factor)
    chosen: Chosen | None = None
    if stand_in:
        whole = not with_uv and settings.symmetry == "off"
        chosen = choose_place(itself, field_of, settings, whole, cache, watch)

    def made(place: Place, cross: CrossField, settings: RemeshSettings) -> RemeshResult:
        return remesh_with(
            place.mesh,
            cross,
            settings,
            creases=place.creases,
            density=place.density,
            onto=place.onto,
            with_uv=with_uv,
            cache=cache,
            repair_lines=repair_lines,
            watch=watch,
            progress=progress,
        )

    if chosen is not None and chosen.place is not itself:
        result = made(chosen.place, chosen.field, chosen.settings)
        report = replace(
            result.report,
            input=MeshCounts.of(mesh),
            stand_in=chosen.place.mesh.n_faces,
            settings=asdict(settings),
        )
        suits = report.asked <= 2 * guessed_quads(mesh, chosen.settings)
        if suits and all(p.method != PAIRED for p in report.components):
            return Predicted(replace(result, report=report), chosen.field, chosen.place.mesh)
        chosen = None
    if chosen is None:
        with watch("field"):
            cross = field_of(mesh, None)
    else:
        cross = chosen.field
    return Predicted(made(itself, cross, settings), cross, mesh)


def remesh_with(
    mesh: TriMesh,
    field: CrossField,
    settings: RemeshSettings | None = None,
    *,
    creases: ArrayLike | None = None,
    density: ArrayLike | None = None,
    onto: TriMesh | None = None,
    with_uv: bool = False,
    cache: bool = False,
    repair_lines: Sequence[str] = (),
    watch: Watch | None = None,
    progress: Progress | None = None,
) -> RemeshResult:
    """Remesh a sound mesh by a field, with what happened before in the report.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On its vertices or faces.
    settings : RemeshSettings, optional
    creases : (k, 2) array_like, optional
        Vertex pairs of edges to keep, in place of those that the settings find.
    density : (n,) array_like, optional
        Factor on the quads per area at each vertex.
    onto : TriMesh, optional
        The surface that the mesh is a stand-in for, see :func:`vhquad.quad.pipeline.remesh_mesh`.
    with_uv : bool
        Make the integer-grid map on the triangles as well.
    cache : bool
        Keep continuous maps, and use those kept.
    repair_lines : sequence of str
        What was repaired.
    watch : Watch, optional
        Has timed the steps before, and goes on.
    progress : callable, optional

    Returns
    -------
    RemeshResult
    """
    result = remesh_mesh(
        mesh,
        field,
        settings,
        creases=creases,
        density=density,
        onto=onto,
        with_uv=with_uv,
        cache=cache,
        progress=progress,
    )
    watch = watch or Watch()
    watch.add(result.report.seconds)
    repaired = (*repair_lines, *result.report.repair)
    report = replace(result.report, repair=repaired, seconds=dict(watch.seconds))
    return replace(result, report=report)
