"""Cut the faces of a mesh exactly along a plane.

Vertices near the plane first slide on to it along an edge that crosses it, so that no slivers
arise; all other crossing edges are split, and the faces beside them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.triangle import TriMesh

__all__ = ["Pieces", "cut_faces"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SLIDE = 0.1
"""A vertex nearer to the plane than this share of a crossing edge slides on to it."""
_ON = 1e-9
"""Vertices nearer than this share of the diagonal lie on the plane."""
_ROUNDS = 5


@dataclass(frozen=True, eq=False)
class Pieces:
    """A mesh of whose chosen faces none crosses a plane.

    Attributes
    ----------
    points : (n, 3) float64
        The vertices of the mesh, some slid on to the plane, then new ones, exactly on it.
    faces : (m, 3) int64
    source : (m,) int64
        Face of the mesh that each face is part of; ascending.
    side : (m,) int64
        1 or -1, 0 for a face in the plane; only of use for the chosen faces.
    ends : (n, 2) int64
        Vertices of the mesh between which each vertex lies; its own number twice if it is one.
    """

    points: Floats
    faces: Ints
    source: Ints
    side: Ints
    ends: Ints


def cut_faces(mesh: TriMesh, plane: MirrorPlane, chosen: Bools) -> Pieces:
    """Cut some components of a mesh along a plane, and leave the others as they are.

    Parameters
    ----------
    mesh : TriMesh
        Sound.
    plane : MirrorPlane
    chosen : (m,) bool
        Faces to cut; all or none of each component.
    """
    active = np.zeros(mesh.n_vertices, dtype=bool)
    active[mesh.faces[chosen]] = True
    points, height = _slid(mesh, plane, active)
    return _split(mesh.faces, points, np.where(active, height, 1.0), plane)


def _slid(mesh: TriMesh, plane: MirrorPlane, active: Bools) -> tuple[Floats, Floats]:
    """Positions and heights of the vertices once those near the plane lie on it.

    A vertex slides along the edge that takes it there soonest, at a boundary a boundary edge;
    it stays where that would turn a face over or leave it flat on the plane.
    """
    start, height = np.array(mesh.vertices), plane.height(mesh.vertices)
    on = active & (np.abs(height) <= _ON * mesh.diagonal)
    start[on], height[on] = plane.project(start[on]), 0.0
    a, b = np.concatenate([mesh.edges, mesh.edges[:, ::-1]]).T
    border = np.tile((mesh.edge_halfedges < 0).any(axis=1), 2)
    may = active[a] & (height[a] * height[b] < 0) & (border | ~mesh.is_boundary_vertex[a])
    a, b = a[may], b[may]
    share = height[a] / (height[a] - height[b])
    move = share * np.linalg.norm(start[b] - start[a], axis=1)
    order = np.argsort(move, kind="stable")
    order = order[share[order] < _SLIDE]
    vertex, first = np.unique(a[order], return_index=True)
    edge = order[first]
    goal = plane.project(start[vertex] + share[edge, None] * (start[b[edge]] - start[vertex]))
    before = _area_vectors(start, mesh.faces)
    least = 0.2 * np.einsum("fi,fi->f", before, before)
    slides = np.ones(len(vertex), dtype=bool)
    for _ in range(_ROUNDS):
        points, level = start.copy(), height.copy()
        points[vertex[slides]], level[vertex[slides]] = goal[slides], 0.0
        bad = np.einsum("fi,fi->f", before, _area_vectors(points, mesh.faces)) < least
        bad |= (level[mesh.faces] == 0.0).all(axis=1)
        hurt = slides & np.isin(vertex, mesh.faces[bad])
        if not hurt.any():
            return points, level
        slides &= ~hurt
    return start, height


def _split(faces: Ints, points: Floats, height: Floats, plane: MirrorPlane) -> Pieces:
    """Split the edges whose ends have heights of unlike sign, and the faces beside them."""
    n = len(points)
    a, b = faces, np.roll(faces, -1, axis=1)
    crossing = height[a] * height[b] < 0
    key = np.minimum(a, b)[crossing] * np.int64(n) + np.maximum(a, b)[crossing]
    found, place = np.unique(key, return_inverse=True)
    low, high = found // n, found % n
    share = height[low] / (height[low] - height[high])
    new = plane.project(points[low] + share[:, None] * (points[high] - points[low]))
    points = np.concatenate([points, new])
    height = np.concatenate([height, np.zeros(len(new))])
    middle = np.full(faces.shape, -1, dtype=np.int64)
    middle[crossing] = n + place
    count = crossing.sum(axis=1)
    whole, one, two = (np.flatnonzero(count == c) for c in range(3))

    # One crossing edge, k: its opposite corner lies on the plane.
    k = crossing[one].argmax(axis=1)
    p, q, r, x = (
        _turned(t[one], k)[:, c] for t, c in ((faces, 0), (faces, 1), (faces, 2), (middle, 0))
    )
    singles = [np.stack(t, axis=1) for t in ((p, x, r), (x, q, r))]
    # Two: the corner between them is alone on its side.
    k = (~crossing[two]).argmax(axis=1)
    p, q, r = _turned(faces[two], k + 2).T
    x, y = _turned(middle[two], k + 2)[:, [0, 2]].T
    short = np.linalg.norm(points[x] - points[r], axis=1) <= np.linalg.norm(
        points[q] - points[y], axis=1
    )
    doubles = [
        np.stack([p, x, y], axis=1),
        np.stack([x, q, np.where(short, r, y)], axis=1),
        np.stack([np.where(short, x, q), r, y], axis=1),
    ]
    made = np.concatenate([faces[whole], *singles, *doubles])
    source = np.concatenate([whole, one, one, two, two, two])
    order = np.argsort(source, kind="stable")
    made, source = made[order], source[order]
    own = np.arange(n)
    return Pieces(
        points=points,
        faces=made,
        source=source,
        side=np.sign(np.sign(height[made]).sum(axis=1)).astype(np.int64),
        ends=np.concatenate([np.stack([own, own], axis=1), np.stack([low, high], axis=1)]),
    )


def _turned(table: Ints, first: Ints) -> Ints:
    """Rows of three, each turned so that the given place comes first."""
    return np.take_along_axis(table, (first[:, None] + np.arange(3)) % 3, axis=1)


def _area_vectors(points: Floats, faces: Ints) -> Floats:
    p = points[faces]
    return np.asarray(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
