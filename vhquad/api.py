"""Whole tasks in one call, for scripts and for the command line: load, predict, remesh."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
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
from vhquad.quad.component import PAIRED
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh
from vhquad.quad.sizing import SIZE_RANGE, checked_density
from vhquad.quad.stand_in import StandIn, make_stand_in
from vhquad.report import CheckReport, FieldReport, MeshCounts

if TYPE_CHECKING:
    from vhquad.nn.checkpoint import Model

__all__ = [
    "LoadedMesh",
    "Method",
    "Predicted",
    "check",
    "clock",
    "describe_field",
    "load",
    "load_kept",
    "own_field",
    "predict",
    "remesh",
    "remesh_predicted",
    "remesh_with",
]

Method = Literal["learned", "curvature"]
Progress = Callable[[str, float], None]

GUESSED_QUADS = 10_000  # where only the field will say; predicted sizes make fewer, as a rule


def predict(
    mesh: TriMesh,
    model: Model | Path | str | None = None,
    *,
    method: Method = "learned",
    resolution: Literal["auto", "full"] = "auto",
    device: str = "auto",
    cache: bool = True,
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

    def make() -> CrossField:
        from vhquad.learn.blend import lean_on_curvature
        from vhquad.learn.predict import predict_field

        field = predict_field(
            mesh, model, resolution, device, cache=cache, on_component=on_component
        )
        return lean_on_curvature(mesh, field)

    if not cache or not (model is None or isinstance(model, str | Path)):
        return make()
    from vhquad.learn.kept import kept_field

    return kept_field(mesh, model, f"{resolution} {device}", make)


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
        "auto" predicts on decimated copies of large components, and maps a decimated copy of a mesh
        far finer than its quads; either way quads lie on the mesh itself.
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
    seconds: dict[str, float] = {}
    with clock(seconds, "repair"):
        repaired = repair(vertices, faces)
    factor = None
    if density is not None:
        values = checked_density(density, len(np.asarray(vertices)))
        factor = carried(values, repaired.vertex_source, repaired.mesh)
    lines = repaired.report.lines()
    if field is not None:
        with clock(seconds, "field"):
            cross = own_field(repaired.mesh, field)
        return remesh_with(
            repaired.mesh,
            cross,
            settings,
            density=factor,
            repair_lines=lines,
            seconds=seconds,
            progress=progress,
        )

    def field_of(surface: TriMesh) -> CrossField:
        return predict(surface, model, method=method, resolution=resolution, progress=progress)

    made = remesh_predicted(
        repaired.mesh,
        field_of,
        settings,
        density=factor,
        stand_in=resolution == "auto",
        repair_lines=lines,
        seconds=seconds,
        progress=progress,
    )
    return made.result


@dataclass(frozen=True, eq=False)
class Predicted:
    """A remesh along a predicted field, and the field with the mesh it lives on."""

    result: RemeshResult
    field: CrossField
    mesh: TriMesh
    """The mesh itself, or its stand-in."""


def remesh_predicted(
    mesh: TriMesh,
    field_of: Callable[[TriMesh], CrossField],
    settings: RemeshSettings | None = None,
    *,
    creases: ArrayLike | None = None,
    density: ArrayLike | None = None,
    stand_in: bool = True,
    cache: bool = True,
    with_uv: bool = False,
    repair_lines: Sequence[str] = (),
    seconds: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Predicted:
    """Predict a field and remesh by it, on a stand-in if the mesh is far finer than its quads.

    Parameters
    ----------
    mesh : TriMesh
    field_of : callable
        Gives the cross field of a mesh.
    stand_in : bool
        Whether a decimated copy may take the place of the mesh. It never does where the map was
        asked for or a symmetry, and if no map is found on it, all is done again on the mesh.
    cache : bool
        Keep the stand-in, and use one that was kept.

    Other parameters are those of :func:`remesh_with`.
    """
    settings = settings or RemeshSettings()
    spent = dict(seconds or {})
    guess = GUESSED_QUADS
    if settings.target_quads is not None:
        guess = settings.target_quads
    elif settings.edge_length is not None:
        guess = max(1, round(mesh.area / settings.edge_length**2))
    given = None if creases is None else np.asarray(creases, dtype=np.int64).reshape(-1, 2)
    copy: StandIn | None = None
    if stand_in and not with_uv and settings.symmetry == "off":
        with clock(spent, "stand-in"):
            copy = make_stand_in(mesh, guess, given, settings.crease, cache)
    if copy is not None:
        with clock(spent, "field"):
            cross = field_of(copy.mesh)
        result = remesh_with(
            copy.mesh,
            cross,
            settings,
            creases=copy.creases,
            density=None if density is None else copy.carry(np.asarray(density, dtype=np.float64)),
            onto=mesh,
            repair_lines=repair_lines,
            seconds=spent,
            progress=progress,
        )
        report = result.report
        if report.asked <= 2 * guess and all(p.method != PAIRED for p in report.components):
            return Predicted(result, cross, copy.mesh)
        spent = dict(report.seconds)
    with clock(spent, "field"):
        cross = field_of(mesh)
    result = remesh_with(
        mesh,
        cross,
        settings,
        creases=given,
        density=density,
        with_uv=with_uv,
        repair_lines=repair_lines,
        seconds=spent,
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
    repair_lines: Sequence[str] = (),
    seconds: Mapping[str, float] | None = None,
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
    repair_lines : sequence of str
        What was repaired.
    seconds : dict, optional
        Wall time of the steps before.
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
        progress=progress,
    )
    spent = dict(seconds or {})
    for step, value in result.report.seconds.items():
        spent[step] = spent.get(step, 0.0) + value
    report = replace(result.report, repair=(*repair_lines, *result.report.repair), seconds=spent)
    return replace(result, report=report)


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


@contextmanager
def clock(seconds: dict[str, float], step: str) -> Iterator[None]:
    """Add the wall time of a step."""
    start = time.perf_counter()
    try:
        yield
    finally:
        seconds[step] = seconds.get(step, 0.0) + time.perf_counter() - start
