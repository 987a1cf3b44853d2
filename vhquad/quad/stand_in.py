"""StandIn: a decimated copy that is remeshed in place of a mesh far finer than its quads.

A map needs some ten triangles a quad; a scan has hundreds. The copy keeps what the quads must
meet exactly, the vertices of borders and creases, and one vertex in every cell of a grid as fine as
the quads, so that no triangle outgrows them. The rest goes by quadric error, and edges are flipped
until triangles are shapely. The quads are polished on the original surface in the end, and judged
against it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vhquad.cache import (
    code_digest,
    content_key,
    default_cache_dir,
    read_arrays,
    write_arrays,
)
from vhquad.errors import MeshError
from vhquad.field.creases import LOOSE, TOGETHER, creases_for_quads
from vhquad.field.features import drop_short_creases
from vhquad.field.prune import prune_branches
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.shapely import shapely
from vhquad.mesh.thinning import slim, thin_out
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.counts import narrow_map_quads, stand_in_quads

__all__ = ["StandIn", "make_stand_in"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FACES_A_QUAD = 10
FEWEST_FACES = 50_000  # below this there is little to gain
WORTH_FROM = 2.0  # times as many faces must there be
CELL = 0.8  # of the grid, in quad edges
MOST_SLIVERS = 1e-4  # of the faces

_ARRAYS = ("vertices", "faces", "creases")


@dataclass(frozen=True, eq=False)
class StandIn:
    """A mesh that is remeshed in place of another.

    Attributes
    ----------
    mesh : TriMesh
        As many components as the original, in its order, each of its topology.
    creases : (k, 2) int64 or None
        Vertex pairs of the stand-in that lie on the creases of the original, edge for edge; None:
        those of the stand-in itself.
    original : TriMesh
    """

    mesh: TriMesh
    creases: Ints | None
    original: TriMesh

    def carry(self, values: Floats) -> Floats:
        """Values at the vertices of the original, interpolated at those of the stand-in."""
        hits = ClosestPoints(self.original).query(self.mesh.vertices)
        return np.asarray(hits.interpolate(values[self.original.faces]))


def make_stand_in(
    mesh: TriMesh,
    n_quads: int,
    creases: Ints | None = None,
    angle: float | None = None,
    cache: bool = False,
) -> StandIn | None:
    """A stand-in for a mesh that is to become about so many quads.

    Parameters
    ----------
    mesh : TriMesh
        Sound, any components and borders.
    n_quads : int
    creases : (k, 2) int64, optional
        Edges that quads must follow, in place of those sharper than the angle.
    angle : float, optional
        In degrees; no creases if neither is given.
    cache : bool
        Keep the stand-in, and take one that was kept. It serves other numbers of quads of the
        class too (:mod:`vhquad.quad.counts`).

    Returns
    -------
    StandIn or None
        None where the mesh is not much finer than its quads, or where decimation would not leave
        the topology, the borders and the creases as they are: the mesh then serves itself.
    """
    # Hence 14 triangles a quad at the coarse end of a class, 3.5 at the fine end.
    budget = max(round(FACES_A_QUAD * stand_in_quads(n_quads)), FEWEST_FACES)
    if mesh.n_faces < WORTH_FROM * budget:
        return None
    quads = budget / FACES_A_QUAD
    if cache:
        lines = np.full((1, 2), -1) if creases is None else creases
        key = content_key([code_digest(), budget, angle], lines, mesh.vertices, mesh.faces)
        path = default_cache_dir() / f"stand-in-{key}.npz"
        found = _kept(path)
        if found is None:
            found = _made(mesh, budget, quads, creases, angle)
            if found is not None:
                arrays = (found[0].vertices, found[0].faces, found[1])
                write_arrays(path, dict(zip(_ARRAYS, arrays, strict=True)))
    else:
        found = _made(mesh, budget, quads, creases, angle)
    if found is None:
        return None
    copy, lines = found
    if creases is None and len(lines):
        edge = float(np.sqrt(mesh.area / narrow_map_quads(n_quads)))
        lines = drop_short_creases(copy, lines, TOGETHER * edge)
        lines = prune_branches(copy, lines, LOOSE * edge)
    return StandIn(copy, lines, mesh)


def _kept(path: Path) -> tuple[TriMesh, Ints] | None:
    """An entry of the cache: a mesh, and edges of it; None if it is absent or damaged."""
    found = read_arrays(path, _ARRAYS)
    if found is None:
        return None
    vertices, faces, lines = found
    try:
        copy = TriMesh(vertices, faces)
    except MeshError:
        return None
    fits = lines.ndim == 2 and lines.shape[1:] == (2,) and lines.dtype == np.int64
    return (copy, lines) if fits and np.isin(lines, copy.faces).all() else None


def _made(
    mesh: TriMesh, budget: int, quads: float, creases: Ints | None, angle: float | None
) -> tuple[TriMesh, Ints] | None:
    """The copy, with about so many faces, and creases on it."""
    edge = float(np.sqrt(mesh.area / quads))
    if creases is None:
        creases = np.zeros((0, 2), dtype=np.int64)
        if angle is not None:
            creases = creases_for_quads(mesh, angle, edge)
    feature = mesh.is_boundary_vertex.copy()
    feature[creases] = True
    vertices, faces = [], []
    place = np.full(mesh.n_vertices, -1)
    start = 0
    count = mesh.n_components
    for part in range(count):  # few, as a rule
        everything = mesh, np.arange(mesh.n_vertices)
        piece, used = everything if count == 1 else mesh.submesh(mesh.face_component == part)
        share = round(budget * piece.area / mesh.area)
        kept = feature[used]
        kept[_one_a_cell(piece.vertices, CELL * edge)] = True
        small, where = thin_out(piece, kept, share)
        if small is None:
            return None
        place[used] = np.where(where < 0, -1, where + start)
        vertices.append(small.vertices)
        faces.append(small.faces + start)
        start += small.n_vertices
    copy = TriMesh(np.concatenate(vertices), np.concatenate(faces))
    if copy.n_faces * WORTH_FROM > mesh.n_faces:
        return None
    lines = place[creases]
    bound = np.zeros(copy.n_vertices, dtype=bool)
    bound[place[feature & (place >= 0)]] = True
    copy = shapely(copy, ~bound, lines, ClosestPoints(mesh))
    return None if slim(copy).mean() > MOST_SLIVERS else (copy, lines)


def _one_a_cell(points: Floats, cell: float) -> Ints:
    """The first point in each cell of a grid."""
    index = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    shape = index.max(axis=0) + 1
    key = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
    return np.asarray(np.unique(key, return_index=True)[1], dtype=np.int64)
