"""StandIn: a decimated copy that is remeshed in place of a mesh far finer than its quads.

A map needs some ten triangles a quad; a scan has hundreds. The copy keeps what the quads must
meet exactly, the vertices of borders and creases, and one vertex in every cell of a grid as fine as
the quads, so that no triangle outgrows them. The rest goes by quadric error, and edges are flipped
until triangles are shapely. The quads are polished on the original surface in the end, and judged
against it.
"""

from __future__ import annotations

from dataclasses import dataclass

import fast_simplification
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.field.features import find_creases
from vhquad.field.prune import prune_branches
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.flips import flip_edges
from vhquad.mesh.triangle import TriMesh

__all__ = ["StandIn", "make_stand_in"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FACES_A_QUAD = 10
FEWEST_FACES = 50_000  # below this there is little to gain
WORTH_FROM = 2.0  # times as many faces must there be
CELL = 0.8  # of the grid, in quad edges
ATTEMPTS, AROUND = 5, 40  # rounds of keeping so many more vertices around each unsound place
RELAXING_ROUNDS, UNDOING_ROUNDS = 2, 5
MOST_SLIVERS = 1e-4  # of the faces
LEAST_COSINE = 0.3  # between a face's normals before and after its corners have moved
SLIVER = 1e-3  # of a triangle's area over its longest side squared
CREASE_LENGTH, LOOSE_CREASE = 2.5, 1.5  # quad edges; as for meshes without a stand-in


@dataclass(frozen=True, eq=False)
class StandIn:
    """A decimated mesh and what it stands for.

    Attributes
    ----------
    mesh : TriMesh
        As many components as the original, in its order, each of its topology.
    creases : (k, 2) int64
        Vertex pairs of the stand-in that lie on the creases of the original, edge for edge.
    original : TriMesh
    """

    mesh: TriMesh
    creases: Ints
    original: TriMesh

    def carry(self, values: Floats) -> Floats:
        """Values at the vertices of the original, interpolated at those of the stand-in."""
        hits = ClosestPoints(self.original).query(self.mesh.vertices)
        return np.asarray(hits.interpolate(values[self.original.faces]))


def make_stand_in(
    mesh: TriMesh, n_quads: int, creases: Ints | None = None, angle: float | None = None
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

    Returns
    -------
    StandIn or None
        None where the mesh is not much finer than its quads, or where decimation would not leave
        the topology, the borders and the creases as they are: the mesh then serves itself.
    """
    budget = max(FACES_A_QUAD * n_quads, FEWEST_FACES)
    if mesh.n_faces < WORTH_FROM * budget:
        return None
    edge = float(np.sqrt(mesh.area / n_quads))
    if creases is None:
        creases = np.zeros((0, 2), dtype=np.int64)
        if angle is not None:
            found = find_creases(mesh, angle, CREASE_LENGTH * edge)
            creases = prune_branches(mesh, found, LOOSE_CREASE * edge)
    feature = mesh.is_boundary_vertex.copy()
    feature[creases] = True
    vertices, faces = [], []
    place = np.full(mesh.n_vertices, -1)
    start = 0
    for part in range(mesh.n_components):  # few, as a rule
        piece, used = mesh.submesh(mesh.face_component == part)
        share = round(budget * piece.area / mesh.area)
        small, where = _decimated(piece, feature[used], share, CELL * edge)
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
    copy = _relaxed(copy, ~bound, lines, ClosestPoints(mesh))
    return None if _slim(copy).mean() > MOST_SLIVERS else StandIn(copy, lines, mesh)


def _decimated(
    piece: TriMesh, feature: Bools, n_faces: int, cell: float
) -> tuple[TriMesh | None, Ints]:
    """A component with about so many faces, and the new number of each vertex kept for sure.

    None in place of the mesh if its topology was lost. Collapses that do not look at topology make
    an edge of three faces now and then: the vertices around are then kept as well.
    """
    if piece.n_faces <= n_faces:
        return piece, np.arange(piece.n_vertices)
    locked = feature.copy()
    locked[_one_a_cell(piece.vertices, cell)] = True
    wanted = _topology(piece)
    for _ in range(ATTEMPTS):
        points, faces, where = _collapsed(piece, locked, n_faces)
        bad = _unsound(points, faces, where[where >= 0])
        if not bad.any():
            small = TriMesh(points, faces)
            return (small if _topology(small) == wanted else None), where
        _, near = cKDTree(piece.vertices).query(points[bad], k=min(AROUND, piece.n_vertices))
        locked[near] = True
    return None, where


def _collapsed(piece: TriMesh, locked: Bools, n_faces: int) -> tuple[Floats, Ints, Ints]:
    """Positions, faces, and the new number of each locked vertex, -1 of others, by quadric error.

    To keep a vertex, a face of three times itself is put in. Such a face has no plane: its quadric
    is NaN, and so is the error of every edge at the vertex, none of which then is collapsed. These
    faces come out last, as they went in, which also tells the vertices' new numbers.
    """
    kept = np.flatnonzero(locked)
    low, size = piece.vertices.min(axis=0), piece.diagonal
    # The algorithm compares errors with fixed bounds, so it needs a mesh of unit size.
    points, triangles = fast_simplification.simplify(
        (piece.vertices - low) / size,
        np.concatenate([piece.faces, np.repeat(kept[:, None], 3, axis=1)]).astype(np.int32),
        target_count=n_faces + len(kept),
    )
    faces = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    pins, faces = faces[-len(kept) :], faces[: -len(kept)]
    where = np.full(piece.n_vertices, -1)
    where[kept] = pins[:, 0]
    new = np.array(points, dtype=np.float64) * size + low
    off = np.abs(new[where[kept]] - piece.vertices[kept]).max(initial=0.0)
    if (pins != pins[:, :1]).any() or off > 1e-6 * size:
        raise AssertionError("decimation moved vertices that were to be kept")
    new[where[kept]] = piece.vertices[kept]
    return new, faces, where


def _unsound(points: Floats, faces: Ints, held: Ints) -> Bools:
    """Vertices at edges that are not manifold, of several fans, or of slivers that cannot be cured.

    Those are slivers between three held vertices: their corners will not move.
    """
    bad = np.zeros(len(points), dtype=bool)
    tail, head = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    _, edge, count = np.unique(
        tail * np.int64(len(points)) + head, return_inverse=True, return_counts=True
    )
    twice = count[edge] > 1  # more than two faces, or two of unlike orientation
    bad[tail[twice]] = bad[head[twice]] = True
    mesh = TriMesh(points, faces)
    stays = np.zeros(len(points), dtype=bool)
    stays[held] = True
    bad[faces[_slim(mesh) & stays[faces].all(axis=1)]] = True
    if not bad.any():
        bad[mesh.tail[mesh.fan_rank < 0]] = True
    return bad


def _relaxed(copy: TriMesh, free: Bools, lines: Ints, surface: ClosestPoints) -> TriMesh:
    """Triangles made shapely: edges flipped, free vertices moved among their neighbours, in turn.

    Decimation leaves slivers, and now and then a vertex on top of another.
    """
    for _ in range(RELAXING_ROUNDS):
        copy = flip_edges(copy, lines)
        tail, head = np.concatenate([copy.edges, copy.edges[:, ::-1]]).T
        valence = np.bincount(tail, minlength=copy.n_vertices)[:, None]
        total = [np.bincount(tail, copy.vertices[head, k], copy.n_vertices) for k in range(3)]
        middle = np.stack(total, axis=1) / valence
        moved = np.array(copy.vertices)
        moved[free] = surface.query(middle[free]).point
        before = np.array(copy.face_normals)
        doubtful = _around(copy, _slim(copy))
        beneath = surface.query(copy.vertices[copy.faces[doubtful]].mean(axis=1)).face
        before[doubtful] = surface.mesh.face_normals[beneath]
        for _ in range(UNDOING_ROUNDS):
            now = TriMesh(moved, copy.faces).face_normals
            turned = np.einsum("fi,fi->f", now, before) < LEAST_COSINE
            if not turned.any():
                break
            back = np.unique(copy.faces[turned])
            moved[back] = copy.vertices[back]
        copy = TriMesh(moved, copy.faces)
    return flip_edges(copy, lines)


def _around(mesh: TriMesh, core: Bools) -> Ints:
    """Faces that share a vertex with some faces."""
    touched = np.zeros(mesh.n_vertices, dtype=bool)
    touched[mesh.faces[core]] = True
    return np.flatnonzero(touched[mesh.faces].any(axis=1))


def _slim(mesh: TriMesh) -> Bools:
    """Triangles so slim that their normal says little; (m,)."""
    return np.asarray(mesh.face_areas < SLIVER * mesh.edge_lengths.max(axis=1) ** 2)


def _one_a_cell(points: Floats, cell: float) -> Ints:
    """The first point in each cell of a grid."""
    index = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    shape = index.max(axis=0) + 1
    key = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
    return np.asarray(np.unique(key, return_index=True)[1], dtype=np.int64)


def _topology(mesh: TriMesh) -> tuple[int, int, int]:
    """Components, Euler characteristic, boundary loops."""
    return mesh.n_components, mesh.euler_characteristic, len(mesh.boundary_loops)
