"""Whole tasks in one call, for scripts and for the command line: load, predict, remesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from vhquad.errors import ConfigError, FieldError, MeshError
from vhquad.field.baseline import curvature_field
from vhquad.field.cross import CrossField
from vhquad.field.io import read_field
from vhquad.field.singular import find_singularities
from vhquad.mesh.io import read_polygons
from vhquad.mesh.kept import load_kept
from vhquad.mesh.load import LoadedMesh, load
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import check_quads
from vhquad.mesh.repair import repair
from vhquad.mesh.scalars import carried
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.mapping import Progress
from vhquad.quad.pipeline import RemeshResult, RemeshSettings
from vhquad.quad.remeshing import remesh_predicted, remesh_with
from vhquad.quad.sizing import SIZE_RANGE, checked_density
from vhquad.report import CheckReport, FieldReport, MeshCounts
from vhquad.watch import Watch

if TYPE_CHECKING:
    from vhquad.nn.checkpoint import Model

__all__ = [
    "LoadedMesh",
    "Method",
    "check",
    "describe_field",
    "load",
    "load_kept",
    "own_field",
    "predict",
    "remesh",
]

Method = Literal["learned", "curvature"]


def predict(
    mesh: TriMesh,
    model: Model | Path | str | None = None,
    *,
    method: Method = "learned",
    resolution: Literal["auto", "full"] = "auto",
    device: str = "auto",
    cache: bool = True,
    of: TriMesh | None = None,
    progress: Progress | None = None,
) -> CrossField:
    """A cross at every vertex or face of a mesh, with the size of the quads wanted there.

    Parameters
    ----------
    mesh : TriMesh
        Sound, as :func:`load` and :func:`vhquad.mesh.repair.repair` make it.
    model : Model or path, optional
        A trained model; the shipped one if not given.
    method : "learned" or "curvature"
        The network, helped out by the smoothest field along the directions of curvature where it
        is not sure; or the latter alone, which needs no model and has no sizes.
    resolution : "auto" or "full"
        "auto" predicts large components on a decimated copy and carries the field back.
    device : str
        For the network: "auto", "cpu", "cuda" ...
    cache : bool
        Keep the operators of the mesh and its field, and use those kept. Fields of a model that is
        given as an object are not kept.
    of : TriMesh, optional
        The mesh that this one is a decimated stand-in for: the network sees copies of that, the
        same for all its stand-ins.
    progress : callable, optional
        Called with (what runs, share done).

    Returns
    -------
    CrossField
        On vertices if predicted, on faces along the curvature; the confidence says how clear the
        directions are.

    Raises
    ------
    VhquadError
        If the mesh, the model or an option cannot be used.
    """
    if method not in ("learned", "curvature"):
        raise ConfigError(f'method must be "learned" or "curvature", not {method!r}')
    if method == "curvature":
        if model is not None:
            raise ConfigError("a model was given, but the method curvature uses none")
        return curvature_field(mesh)

    def on_component(done: int, count: int) -> None:
        if progress is not None:
            progress("predicting the field", done / count)

    from vhquad.learn.kept import predicted_field

    return predicted_field(
        mesh,
        model,
        resolution=resolution,
        device=device,
        cache=cache,
        of=of,
        on_component=on_component,
    )


def remesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    target_quads: int | None = None,
    edge_length: float | None = None,
    method: Method = "learned",
    field: CrossField | str | PathLike[str] | None = None,
    model: Model | Path | str | None = None,
    crease: float | None = 40.0,
    adaptivity: float = 1.0,
    density: ArrayLike | None = None,
    symmetry: str = "off",
    resolution: Literal["auto", "full"] = "auto",
    seed: int = 0,
    progress: Progress | None = None,
) -> RemeshResult:
    """Turn a triangle mesh into an all-quad mesh.

    Parameters
    ----------
    vertices : (n, 3) array_like
    faces : (m, 3) array_like of integers
        Any triangles; what is not sound is repaired first, and the report says so.
    target_quads : int, optional
        Quads wanted. Default: as many as the predicted sizes make.
    edge_length : float, optional
        Edge length of the quads, in units of the mesh, in place of `target_quads`.
    method : "learned" or "curvature"
        Where the cross field comes from, see :func:`predict`.
    field : CrossField or path, optional
        A cross field of one's own in place of `method`, on the vertices or faces of the mesh.
    model : Model or path, optional
        A trained model; the shipped one if not given.
    crease : float or None
        Edges whose faces turn by more than so many degrees are kept as edges; None keeps none.
    adaptivity : float
        0 for quads of one size, 1 for the sizes of the field, or between.
    density : (n,) array_like, optional
        Factor on the quads per area at each vertex.
    symmetry : str
        "x", "y", "z" or "auto" for quads that are their own mirror image; "off".
    resolution : "auto" or "full"
        "auto" predicts on decimated copies of large components, and maps a copy of a mesh far finer
        than its quads, or too coarse for them; either way quads lie on the mesh itself.
    seed : int
        The same seed gives the same quads.
    progress : callable, optional
        Called with (what runs, share done).

    Returns
    -------
    RemeshResult
        The quads, the report and the map.

    Raises
    ------
    VhquadError
        If the mesh, the field, the model or an option cannot be used.
    """
    settings = RemeshSettings(
        target_quads=target_quads,
        edge_length=edge_length,
        crease=crease,
        adaptivity=adaptivity,
        symmetry=symmetry,
        seed=seed,
    )
    watch = Watch()
    with watch("repair"):
        repaired = repair(vertices, faces)
    factor = None
    if density is not None:
        values = checked_density(density, len(np.asarray(vertices)))
        factor = carried(values, repaired.vertex_source, repaired.mesh)
    lines = repaired.report.lines()
    if field is not None:
        with watch("field"):
            cross = own_field(repaired.mesh, field)
        return remesh_with(
            repaired.mesh,
            cross,
            settings,
            density=factor,
            cache=True,
            repair_lines=lines,
            watch=watch,
            progress=progress,
        )

    def field_of(surface: TriMesh, of: TriMesh | None) -> CrossField:
        return predict(
            surface, model, method=method, resolution=resolution, of=of, progress=progress
        )

    made = remesh_predicted(
        repaired.mesh,
        field_of,
        settings,
        density=factor,
        stand_in=resolution == "auto",
        repair_lines=lines,
        watch=watch,
        progress=progress,
    )
    return made.result


def own_field(mesh: TriMesh, field: CrossField | str | PathLike[str]) -> CrossField:
    """A field as it is given, or read from a file (the format by its suffix).

    Raises
    ------
    FieldError
        If the file cannot be read or the field is not one of this mesh.
    """
    if not isinstance(field, CrossField):
        return read_field(field, mesh)
    expected = mesh.n_faces if field.domain == "faces" else mesh.n_vertices
    if len(field) != expected:
        raise FieldError(
            f"the field has {len(field)} crosses, the mesh {expected} {field.domain}; repair may "
            "have changed the mesh: predict on what vhquad.load gives"
        )
    return field


def check(quads: str | PathLike[str], against: str | PathLike[str] | None = None) -> CheckReport:
    """Judge the quad mesh in a file, on its own or against the surface it stands for.

    Raises
    ------
    MeshError
        If a file cannot be read.
    """
    soup = read_polygons(quads)
    faces, _ = soup.of_size(4)
    surface = None if against is None else load(against).mesh
    try:
        mesh = QuadMesh(soup.vertices, faces)
    except MeshError as error:
        raise MeshError(f"{quads}: {error}") from None
    quality = replace(check_quads(mesh, surface), non_quads=soup.n_faces - len(faces))
    return CheckReport(quality, None if surface is None else MeshCounts.of(surface))


def describe_field(
    mesh: TriMesh,
    field: CrossField,
    repair_lines: Sequence[str] = (),
    seconds: Mapping[str, float] | None = None,
) -> FieldReport:
    """Figures of a field on a mesh."""
    singular = find_singularities(mesh, field)
    size, quads, trust = None, None, None
    area = mesh.face_areas if field.domain == "faces" else mesh.vertex_areas
    if field.confidence is not None:
        share = area / area.sum()
        trust = {
            "mean": float(share @ field.confidence),
            "below_half": float(share @ (field.confidence < 0.5)),
        }
    if field.size is not None:
        known = field.size > 0
        if known.any():
            values = field.size[known]
            size = {
                "least": float(values.min()),
                "median": float(np.median(values)),
                "largest": float(values.max()),
            }
            middle = float(np.median(values))
            values = np.clip(values, middle / SIZE_RANGE, middle * SIZE_RANGE)
            quads = round(float((area[known] / values**2).sum()))
    return FieldReport(
        input=MeshCounts.of(mesh),
        singularities=singular.by_quads,
        index_sum=singular.total,
        size=size,
        quads=quads,
        trust=trust,
        repair=tuple(repair_lines),
        seconds=dict(seconds or {}),
    )
