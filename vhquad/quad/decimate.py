"""Edge collapses that cannot change the topology: fewer triangles on vertices of the input.

An edge is collapsed only if its ends share no neighbours but those across its faces (the link
condition; Dey et al. 1999), no neighbour's fan gets too small, and, unless the edge is a boundary
one, not both ends lie on the boundary. Many edges with disjoint neighbourhoods go at once, short
ones and those at flat vertices first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from vhquad.mesh.triangle import TriMesh

__all__ = ["decimate"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SHARPNESS_COST = 4.0  # how much longer an edge counts whose lost vertex is a sharp corner


def decimate(mesh: TriMesh, target_faces: int) -> tuple[TriMesh, Ints]:
    """Collapse edges until at most ``target_faces`` are left, or no collapse is possible.

    Parameters
    ----------
    mesh : TriMesh
        Manifold, any topology.
    target_faces : int
        Wanted number of faces; a round may end up to a few per cent below.

    Returns
    -------
    TriMesh
        Same Euler characteristic, loops and components; its vertices are vertices of the input,
        boundary ones from the boundary.
    (n',) int64
        Index of each of its vertices in the input.
    """
    faces, sharpness = np.array(mesh.faces), _sharpness(mesh)
    rng = np.random.default_rng(0)
    refused: Ints = np.zeros(0, dtype=np.int64)
    while len(faces) > target_faces:
        part = TriMesh(mesh.vertices, faces)
        lost, kept, key = _candidates(part, sharpness, refused, rng)
        if lost.size == 0:
            break
        lost, kept, key = (a[: 1 + (len(faces) - target_faces) // 2] for a in (lost, kept, key))
        into = np.arange(mesh.n_vertices)
        into[lost] = kept
        turned = _turned_vertices(mesh.vertices, faces, into)
        bad = turned[lost]
        into[lost[bad]] = lost[bad]
        # An edge refused for its normals comes up again only once others have changed nearby.
        refused = key[bad] if not bad.all() else np.union1d(refused, key)
        faces = into[faces]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, local = np.unique(faces, return_inverse=True)
    return TriMesh(mesh.vertices[used], local.reshape(-1, 3)), used


def _sharpness(mesh: TriMesh) -> Floats:
    """1 - the least cosine between a vertex's normal and its faces'; boundaries by their turn."""
    cosine = np.einsum("mki,mi->mk", mesh.vertex_normals[mesh.faces], mesh.face_normals)
    least = np.ones(mesh.n_vertices)
    np.minimum.at(least, mesh.faces, cosine)
    border = np.flatnonzero(mesh.twin < 0)
    along = mesh.vertices[mesh.head[border]] - mesh.vertices[mesh.tail[border]]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    entering, leaving = np.zeros((mesh.n_vertices, 3)), np.zeros((mesh.n_vertices, 3))
    entering[mesh.head[border]] = along
    leaving[mesh.tail[border]] = along
    rim = mesh.is_boundary_vertex
    least[rim] = np.minimum(least, np.einsum("vi,vi->v", entering, leaving))[rim]
    return 1.0 - least


def _adjacency(part: TriMesh) -> csr_matrix:
    i, j = part.edges.T
    n = part.n_vertices
    one = np.ones(len(i), dtype=np.int32)
    half = coo_matrix((one, (i, j)), shape=(n, n))
    return csr_matrix(half + half.T)


def _candidates(
    part: TriMesh, sharpness: Floats, refused: Ints, rng: np.random.Generator
) -> tuple[Ints, Ints, Ints]:
    """Vertices to lose, the neighbours they go into, and keys; cheap first, rings disjoint."""
    i, j = part.edges.T
    border_edge = (part.edge_halfedges < 0).any(axis=1)
    rim = part.is_boundary_vertex
    near = _adjacency(part)
    common = np.asarray((near @ near)[i, j]).reshape(-1)
    fine = (common == np.where(border_edge, 1, 2)) & (border_edge | ~(rim[i] & rim[j]))
    # The vertices across lose an edge: three must stay inside, two on the boundary.
    spare = np.diff(near.indptr) - np.where(rim, 2, 3)
    across = part.tail[_opposite(part.edge_halfedges)]
    fine &= ((spare[across] > 0) | (part.edge_halfedges < 0)).all(axis=1)
    # Lose the flatter end, but never a boundary vertex into the inside.
    swap = np.where(rim[i] == rim[j], sharpness[i] > sharpness[j], rim[i])
    lost, kept = np.where(swap, j, i), np.where(swap, i, j)
    key = lost * np.int64(part.n_vertices) + kept
    fine &= ~np.isin(key, refused)
    lost, kept, key = lost[fine], kept[fine], key[fine]
    length = np.linalg.norm(part.vertices[lost] - part.vertices[kept], axis=1)
    order = np.argsort(length * (1.0 + SHARPNESS_COST * sharpness[lost]), kind="stable")
    lost, kept, key = lost[order], kept[order], key[order]
    # Lots drawn among the cheaper third (few are cheapest of all around, so ranking by cost alone
    # takes many rounds); a collapse is done if its lot is the least in all that it touches.
    count = min(len(lost), 20 + len(lost) // 3)
    lost, kept, key = lost[:count], kept[:count], key[:count]
    rank = rng.permutation(count)
    first = np.full(part.n_vertices, count)
    np.minimum.at(first, lost, rank)
    np.minimum.at(first, kept, rank)
    for _ in range(2):
        around = first.copy()
        np.minimum.at(around, i, first[j])
        np.minimum.at(around, j, first[i])
        first = around
    chosen = (first[lost] == rank) & (first[kept] == rank)
    return lost[chosen], kept[chosen], key[chosen]


def _opposite(halfedges: Ints) -> Ints:
    """Halfedge whose tail is the vertex across, in the same face; -1 stays in range as 0."""
    h = np.maximum(halfedges, 0)
    return h - h % 3 + (h + 2) % 3


def _turned_vertices(vertices: Floats, faces: Ints, into: Ints) -> Bools:
    """Vertices whose collapse would turn a face by more than about 78 degrees, or flatten it."""
    moved = into[faces]
    stays = (moved != np.roll(moved, 1, axis=1)).all(axis=1) & (moved != faces).any(axis=1)
    old, new = vertices[faces[stays]], vertices[moved[stays]]
    before = np.cross(old[:, 1] - old[:, 0], old[:, 2] - old[:, 0])
    after = np.cross(new[:, 1] - new[:, 0], new[:, 2] - new[:, 0])
    size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    bad = np.einsum("fi,fi->f", before, after) <= 0.2 * size
    flag = np.zeros(len(vertices), dtype=bool)
    touched = faces[stays][bad]
    flag[touched[into[touched] != touched]] = True
    return flag
