"""The doctor: any triangle soup becomes an oriented manifold TriMesh, and a report says how.

Steps, each in a module of its own: copies of faces go (duplicates), seams are welded (weld), faces
without area are collapsed or flipped away (degenerate), faces are paired at their edges so that
every edge and vertex is manifold and winding is consistent (glue, orient, untie), and parts are
turned outward (outward). All is repeated until nothing changes, so once is enough.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import MeshError
from vhquad.mesh.degenerate import is_degenerate, remove_degenerate
from vhquad.mesh.duplicates import drop_copies_of_parts, drop_duplicates
from vhquad.mesh.glue import Gluing
from vhquad.mesh.outward import inward_faces
from vhquad.mesh.repair_report import RepairReport
from vhquad.mesh.triangle import TriMesh
from vhquad.mesh.untie import Soup, untie
from vhquad.mesh.weld import components, open_vertices, position_classes, weld_seams

__all__ = ["RepairReport", "RepairResult", "repair"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_PASSES = 6


@dataclass(frozen=True, eq=False)
class RepairResult:
    """A sound mesh and where it came from."""

    mesh: TriMesh
    report: RepairReport
    vertex_source: Ints
    """(n,) vertex of the input, the lowest if several were welded; -1 for an added vertex."""
    face_source: Ints
    """(m,) face of the input that each face is or was cut from."""


def repair(vertices: ArrayLike, faces: ArrayLike) -> RepairResult:
    """Make an oriented manifold mesh of any triangles.

    The result has manifold edges and vertices, consistent winding, no face without area, no unused
    vertex, and every component that has area. Positions are not moved; a sound mesh comes back as
    it was, with the same numbers.

    Parameters
    ----------
    vertices : (n, 3) array_like
    faces : (m, 3) array_like of integers

    Returns
    -------
    RepairResult

    Raises
    ------
    MeshError
        If shapes or indices are wrong, there are no faces, a face uses a vertex that is NaN or
        infinite, coordinates are out of all bounds, or no face has any area.
    """
    v, f = _checked(vertices, faces)
    scale = float(np.abs(v[f]).max())
    unit = np.where(np.isfinite(v), v, 0.0) / scale if scale > 0 else np.zeros_like(v)
    before = _Stage(v, unit, f, np.arange(len(v)), np.arange(len(f)), RepairReport())
    for _ in range(_PASSES):
        after = _once(before)
        same = np.array_equal(after.faces, before.faces) and len(after.points) == len(before.points)
        before = after
        if same:
            break
    mesh = TriMesh(before.points, before.faces)
    counts = before.report
    kept = len(v) - counts.welded_vertices + counts.split_vertices + counts.added_vertices
    report = replace(
        counts,
        unused_vertices=kept - mesh.n_vertices,
        vertices_in=len(v),
        faces_in=len(f),
        vertices_out=mesh.n_vertices,
        faces_out=mesh.n_faces,
        components=mesh.n_components,
        lost_components=_lost(v, f, before.face_source),
    )
    return RepairResult(mesh, report, before.vertex_source, before.face_source)


# ---- one round ------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Stage:
    """A soup on its way: positions, positions over the largest coordinate, faces, sources."""

    points: Floats
    unit: Floats
    faces: Ints
    vertex_source: Ints
    face_source: Ints
    report: RepairReport


def _once(stage: _Stage) -> _Stage:
    faces, source, copies, folds = _without_copies(stage.unit, stage.faces)
    flat = remove_degenerate(stage.unit, faces, weld_seams(stage.unit, faces))
    faces, source = flat.faces, source[flat.source]
    if len(faces) == 0:
        raise MeshError(
            f"none of the {len(stage.faces)} faces has any area; check the scale and the export"
        )
    soup, gluing = untie(
        Soup(
            stage.points,
            stage.unit,
            faces,
            flat.weld,
            stage.vertex_source,
            stage.face_source[source],
        )
    )
    added = soup.vertex_source[len(stage.points) :]
    return _assemble(
        soup,
        gluing,
        stage.report
        + RepairReport(
            degenerate_faces=flat.removed,
            cut_faces=flat.cut,
            duplicate_faces=copies + flat.copies,
            folded_faces=folds + flat.folds,
            nonmanifold_edges=gluing.crowded,
            cut_edges=gluing.cut,
            added_vertices=int((added < 0).sum()),
            split_vertices=int((added >= 0).sum()),
        ),
    )


def _without_copies(points: Floats, faces: Ints) -> tuple[Ints, Ints, int, int]:
    """Faces left after dropping copies, by index and by place; their old numbers; both counts.

    Closed parts that are sound in themselves lose no single face: only whole copies of them go.
    """
    first = drop_duplicates(faces)
    source = np.flatnonzero(first.keep)
    faces = faces[source]
    place = position_classes(points)[faces]
    part = _face_parts(faces, len(points))
    open_part = np.zeros(int(part.max()) + 1, dtype=bool)
    border = open_vertices(faces, len(points))
    open_part[part[(border[faces]).any(axis=1)]] = True
    closed = ~open_part[part]
    copy = drop_copies_of_parts(place, part, closed)
    # Faces without area may well lie on one another in different layers: they are left for later.
    rest = np.flatnonzero(~copy & ~is_degenerate(points[faces])[0])
    kept = drop_duplicates(place[rest], closed[rest])
    stay = ~copy
    stay[rest] = kept.keep
    copies = first.copies + int(copy.sum()) + kept.copies
    return faces[stay], source[stay], copies, first.folds + kept.folds


def _face_parts(faces: Ints, n: int) -> Ints:
    """Label of the parts of a soup joined by shared vertices; (m,)."""
    vertex = components(
        n, np.concatenate([faces[:, 0], faces[:, 0]]), np.concatenate([faces[:, 1], faces[:, 2]])
    )
    return np.asarray(np.unique(vertex[faces[:, 0]], return_inverse=True)[1], dtype=np.int64)


def _assemble(soup: Soup, gluing: Gluing, report: RepairReport) -> _Stage:
    """Number the new vertices by their sources, turn faces over, and count."""
    own = soup.faces.reshape(-1)
    vertex = gluing.vertex.reshape(-1)
    lowest = np.full(int(vertex.max()) + 1, len(soup.points), dtype=np.int64)
    np.minimum.at(lowest, vertex, own)
    order = np.lexsort((np.arange(len(lowest)), lowest))
    number = np.zeros(len(lowest), dtype=np.int64)
    number[order] = np.arange(len(order))
    chosen = soup.weld[lowest[order]]
    points, unit = soup.points[chosen], soup.unit[chosen]

    by_source = np.argsort(soup.face_source, kind="stable")
    faces, turned = number[gluing.vertex][by_source], gluing.turned[by_source].copy()
    faces[turned] = faces[turned][:, [0, 2, 1]]
    inward = inward_faces(TriMesh(unit, faces), turned)
    faces[inward] = faces[inward][:, [0, 2, 1]]

    joint = np.sort(vertex * np.int64(len(soup.points)) + own)
    pairs = 1 + int((joint[1:] != joint[:-1]).sum())
    report += RepairReport(
        turned_faces=int((turned ^ inward).sum()),
        welded_vertices=pairs - len(lowest),
        split_vertices=pairs - int((np.bincount(own) > 0).sum()),
    )
    sources = soup.vertex_source[lowest[order]], soup.face_source[by_source]
    return _Stage(points, unit, faces, *sources, report)


# ---- checks and counts ------------------------------------------------------------------------


def _checked(vertices: ArrayLike, faces: ArrayLike) -> tuple[Floats, Ints]:
    v, f = np.array(vertices, dtype=np.float64), np.array(faces)
    if v.ndim != 2 or v.shape[1] != 3:
        raise MeshError(f"vertices must have shape (n, 3), not {v.shape}")
    if f.size == 0:
        raise MeshError("there are no faces; export the mesh as a surface")
    if f.ndim != 2 or f.shape[1] != 3 or not np.issubdtype(f.dtype, np.integer):
        raise MeshError(f"faces must be integers of shape (m, 3), not {f.dtype} {f.shape}")
    f = f.astype(np.int64)
    bad = np.flatnonzero(((f < 0) | (f >= len(v))).any(axis=1))
    if len(bad):
        raise MeshError(
            f"{len(bad)} faces name vertices outside 0..{len(v) - 1}, the first is {bad[0]}"
        )
    wrong = np.asarray(~np.isfinite(v).all(axis=1))
    bad = np.flatnonzero(wrong[f].any(axis=1))
    if len(bad):
        corners = f[bad[0]]
        raise MeshError(
            f"{len(bad)} faces use vertices that are NaN or infinite, the first is vertex"
            f" {corners[wrong[corners]][0]} of face {bad[0]}; delete them or export again"
        )
    corners = v[f].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float((high - low).max())
    if not (max(np.abs(low).max(), np.abs(high).max()) < 1e100 and (size == 0 or size > 1e-100)):
        raise MeshError("coordinates are beyond 1e100 or all within 1e-100; rescale the mesh")
    return v, f


def _lost(v: Floats, faces: Ints, face_source: Ints) -> int:
    """Components of the input, joined by place, of which no face is left."""
    part = _face_parts(position_classes(np.where(np.isfinite(v), v, 0.0))[faces], len(v))
    return int(part.max()) + 1 - int((np.bincount(part[face_source]) > 0).sum())
