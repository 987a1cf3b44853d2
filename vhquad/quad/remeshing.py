"""A remesh as its report tells it: a field predicted on the mesh or on its stand-in, then quads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.component import PAIRED
from vhquad.quad.mapping import Progress
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh
from vhquad.quad.refined_planes import refine_planes
from vhquad.quad.stand_in import StandIn, make_stand_in
from vhquad.report import MeshCounts
from vhquad.watch import Watch

__all__ = ["Predicted", "remesh_predicted", "remesh_with"]

GUESSED_QUADS = 10_000  # where only the field will say; predicted sizes make fewer, as a rule


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
        Whether another mesh may take the place of this one: a decimated copy, if it is far finer
        than its quads and neither the map was asked for nor a symmetry, or else a copy with its
        planes refined, if their triangles are far larger. If no map is found on it, all is done
        again on the mesh itself.
    cache : bool
        Keep the stand-in and continuous maps, and use those that were kept.

    Other parameters are those of :func:`remesh_with`.
    """
    settings = settings or RemeshSettings()
    watch = watch or Watch()
    guess = GUESSED_QUADS
    if settings.target_quads is not None:
        guess = settings.target_quads
    elif settings.edge_length is not None:
        guess = max(1, round(mesh.area / settings.edge_length**2))
    given = None if creases is None else np.asarray(creases, dtype=np.int64).reshape(-1, 2)
    copy: StandIn | None = None
    decimated = False
    with watch("stand-in"):
        if stand_in and not with_uv and settings.symmetry == "off":
            copy = make_stand_in(mesh, guess, given, settings.crease, cache)
            decimated = copy is not None
        if stand_in and copy is None:
            copy = refine_planes(mesh, guess, given)
    if copy is not None:
        with watch("field"):
            cross = field_of(copy.mesh, mesh if decimated else None)
        result = remesh_with(
            copy.mesh,
            cross,
            settings,
            creases=copy.creases,
            density=None if density is None else copy.carry(np.asarray(density, dtype=np.float64)),
            # The planes of a refined copy are the mesh's own, and its normals are better.
            onto=mesh if decimated else None,
            with_uv=with_uv,
            cache=cache,
            repair_lines=repair_lines,
            watch=watch,
            progress=progress,
        )
        report = result.report
        if not decimated:
            report = replace(report, input=MeshCounts.of(mesh), stand_in=copy.mesh.n_faces)
        if report.asked <= 2 * guess and all(p.method != PAIRED for p in report.components):
            return Predicted(replace(result, report=report), cross, copy.mesh)
    with watch("field"):
        cross = field_of(mesh, None)
    result = remesh_with(
        mesh,
        cross,
        settings,
        creases=given,
        density=density,
        with_uv=with_uv,
        cache=cache,
        repair_lines=repair_lines,
        watch=watch,
        progress=progress,
    )
    return Predicted(result, cross, mesh)


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
