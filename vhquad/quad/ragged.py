"""PolygonMesh: polygons of any number of sides glued along halfedges, and their split into quads.

Halfedge h of a polygon runs from corner h to the next corner of the same polygon, so corners and
halfedges share their numbers. Gluing is by ``twin``, not by vertex pairs: an edge may join a vertex
to itself, and two edges may join the same two vertices, as happens on coarse layouts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import MeshError
from vhquad.mesh.quad import QuadMesh

__all__ = ["PolygonMesh", "midpoint_split", "twins_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def twins_of(tail: Ints, head: Ints) -> Ints:
    """Opposite halfedge of each, -1 on a boundary, where vertex pairs tell them apart; (c,).

    Raises
    ------
    MeshError
        If two halfedges run from the same vertex to the same vertex.
    """
    n = np.int64(max(tail.max(initial=0), head.max(initial=0)) + 1)
    key, back = tail * n + head, head * n + tail
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    if (ranked[1:] == ranked[:-1]).any():
        first = order[1:][ranked[1:] == ranked[:-1]][0]
        raise MeshError(
            f"two polygons run from vertex {tail[first]} to vertex {head[first]}; "
            "give the twins of the halfedges"
        )
    if len(key) == 0:
        return np.zeros(0, dtype=np.int64)
    place = np.clip(np.searchsorted(ranked, back), 0, len(key) - 1)
    return np.where(ranked[place] == back, order[place], -1)


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Polygons over vertices.

    Attributes
    ----------
    vertices : (n, 3) float64
        Positions.
    corners : (c,) int64
        Vertex at each corner, polygon after polygon, counter-clockwise seen from outside.
    start : (p + 1,) int64
        First corner of each polygon; the last entry is c.
    twin : (c,) int64
        Opposite halfedge, -1 on a boundary.
    """

    vertices: Floats
    corners: Ints
    start: Ints
    twin: Ints

    @classmethod
    def from_lists(cls, vertices: ArrayLike, polygons: Iterable[Sequence[int]]) -> PolygonMesh:
        """Polygons as lists of vertices, glued along equal vertex pairs.

        Raises
        ------
        MeshError
            If vertex pairs do not tell the edges apart.
        """
        rows = [np.array(p, dtype=np.int64) for p in polygons]
        corners = np.concatenate([*rows, np.zeros(0, dtype=np.int64)])
        start = np.cumsum([0, *(len(p) for p in rows)]).astype(np.int64)
        loose = cls(np.array(vertices, dtype=np.float64), corners, start, np.zeros(0, np.int64))
        return cls(loose.vertices, corners, start, twins_of(corners, corners[loose.next]))

    @property
    def n_polygons(self) -> int:
        """Number of polygons, p."""
        return len(self.start) - 1

    @property
    def sides(self) -> Ints:
        """Number of sides of each polygon; (p,)."""
        return np.diff(self.start)

    @cached_property
    def polygon(self) -> Ints:
        """Polygon of each corner; (c,)."""
        return np.repeat(np.arange(self.n_polygons), self.sides)

    @cached_property
    def next(self) -> Ints:
        """Next halfedge of the same polygon; (c,)."""
        following = np.arange(1, len(self.corners) + 1)
        filled = self.sides > 0
        following[self.start[1:][filled] - 1] = self.start[:-1][filled]
        return following

    @cached_property
    def prev(self) -> Ints:
        """Previous halfedge of the same polygon; (c,)."""
        back = np.zeros_like(self.next)
        back[self.next] = np.arange(len(back))
        return back

    @cached_property
    def edge(self) -> Ints:
        """Edge of each halfedge, numbered by its first halfedge; (c,)."""
        h = np.arange(len(self.corners))
        lead = np.where(self.twin >= 0, np.minimum(h, self.twin), h)
        return np.unique(lead, return_inverse=True)[1].astype(np.int64).reshape(-1)

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return len(self.corners) - int((self.twin >= 0).sum()) // 2

    @property
    def euler_characteristic(self) -> int:
        """V - E + F over the vertices that some polygon uses."""
        return int(np.unique(self.corners).size) - self.n_edges + self.n_polygons

    def polygons(self) -> list[list[int]]:
        """Vertices of each polygon, as lists."""
        flat, start = self.corners.tolist(), self.start.tolist()
        return [flat[a:b] for a, b in pairwise(start)]

    def quads(self) -> QuadMesh:
        """The mesh as quads.

        Raises
        ------
        MeshError
            If a polygon has other than four sides.
        """
        other = np.flatnonzero(self.sides != 4)
        if other.size:
            raise MeshError(f"{len(other)} polygons are no quads, the first is {other[0]}")
        return QuadMesh(self.vertices, self.corners.reshape(-1, 4))


def midpoint_split(mesh: PolygonMesh) -> PolygonMesh:
    """Cut each polygon into quads by lines from its centre to the middles of its sides.

    A polygon of k sides gives k quads, so any polygons become quads only, of the same topology.
    Vertices keep their indices; the middles of the edges follow, by ``mesh.edge``, then the centres
    of the polygons. Quad h holds corner h of the mesh, first.
    """
    c, n = len(mesh.corners), len(mesh.vertices)
    tail, head = mesh.vertices[mesh.corners], mesh.vertices[mesh.corners[mesh.next]]
    middle = np.zeros((mesh.n_edges, 3))
    middle[mesh.edge] = 0.5 * (tail + head)
    total = np.stack(
        [np.bincount(mesh.polygon, tail[:, i], mesh.n_polygons) for i in range(3)], axis=1
    )
    centre = total / np.maximum(mesh.sides, 1)[:, None]
    ahead = n + mesh.edge
    quads = np.stack(
        [mesh.corners, ahead, n + len(middle) + mesh.polygon, ahead[mesh.prev]], axis=1
    )
    # Sides of quad h: 0 first half of h, 1 and 2 inner, 3 second half of the halfedge before.
    h = np.arange(c)
    twin = np.full((c, 4), -1, dtype=np.int64)
    paired = mesh.twin >= 0
    other = np.where(paired, mesh.next[mesh.twin], 0)
    twin[:, 0] = np.where(paired, 4 * other + 3, -1)
    twin[:, 1] = 4 * mesh.next + 2
    twin[:, 2] = 4 * mesh.prev + 1
    before = mesh.twin[mesh.prev]
    twin[:, 3] = np.where(before >= 0, 4 * before, -1)
    return PolygonMesh(
        np.concatenate([mesh.vertices, middle, centre]),
        quads.reshape(-1),
        np.append(4 * h, 4 * c),
        twin.reshape(-1),
    )
