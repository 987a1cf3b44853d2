"""TriMesh: an oriented manifold triangle mesh and its halfedge topology.

Conventions, used everywhere in vhquad:

- Halfedge ``h = 3 * f + k`` runs from corner ``k`` to corner ``(k + 1) % 3`` of face ``f``; the
  face lies to its left, seen from outside.
- ``twin[h]`` is the opposite halfedge, or -1 on a boundary.
- The first outgoing halfedge of a vertex, ``outgoing[v]``, is the boundary one if there is one
  (the clockwise-most), else the one of lowest index. Angles turn counter-clockwise from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.errors import MeshError

__all__ = ["TriMesh", "next_halfedge", "prev_halfedge"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def next_halfedge(h: Ints) -> Ints:
    """Next halfedge of the same face, counter-clockwise."""
    return np.where(h % 3 == 2, h - 2, h + 1)


def prev_halfedge(h: Ints) -> Ints:
    """Previous halfedge of the same face."""
    return np.where(h % 3 == 0, h + 2, h - 1)


@dataclass(frozen=True, eq=False)
class TriMesh:
    """An oriented triangle mesh whose edges are manifold; arrays are copied and read-only.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Positions, stored as float64.
    faces : (m, 3) array_like
        Vertex indices, counter-clockwise seen from outside, stored as int64.

    Raises
    ------
    MeshError
        If shapes, indices or values are unusable. Topology is checked on first use: an edge with
        more than two faces, or two faces of unlike orientation, raises when ``twin`` is asked for.
        :func:`vhquad.mesh.repair.repair` makes any triangle soup fit.
    """

    vertices: Floats
    faces: Ints

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        v = np.array(vertices, dtype=np.float64)
        f = np.array(faces)
        if v.ndim != 2 or v.shape[1] != 3:
            raise MeshError(f"vertices must have shape (n, 3), not {v.shape}")
        if f.ndim != 2 or f.shape[1] != 3 or len(f) == 0:
            raise MeshError(f"faces must have shape (m, 3) with m > 0, not {f.shape}")
        if not np.issubdtype(f.dtype, np.integer):
            raise MeshError(f"faces must hold integers, not {f.dtype}")
        f = f.astype(np.int64)
        if not np.isfinite(v).all():
            bad = np.flatnonzero(~np.isfinite(v).all(axis=1))
            raise MeshError(f"{len(bad)} vertices are NaN or infinite, the first is {bad[0]}")
        if f.min() < 0 or f.max() >= len(v):
            bad = np.flatnonzero(((f < 0) | (f >= len(v))).any(axis=1))
            raise MeshError(
                f"{len(bad)} faces name vertices outside 0..{len(v) - 1}, the first is {bad[0]}"
            )
        v.flags.writeable = False
        f.flags.writeable = False
        object.__setattr__(self, "vertices", v)
        object.__setattr__(self, "faces", f)

    # ---- counts ---------------------------------------------------------------------------

    @property
    def n_vertices(self) -> int:
        """Number of vertices, n."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of faces, m."""
        return len(self.faces)

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return len(self.edges)

    @property
    def euler_characteristic(self) -> int:
        """V - E + F over the vertices that some face uses."""
        return int(self.is_used_vertex.sum()) - self.n_edges + self.n_faces

    @cached_property
    def is_used_vertex(self) -> Bools:
        """Whether some face uses a vertex; (n,)."""
        return np.bincount(self.faces.reshape(-1), minlength=self.n_vertices) > 0

    # ---- halfedges ------------------------------------------------------------------------

    @cached_property
    def tail(self) -> Ints:
        """Vertex at which each halfedge starts; (3m,)."""
        return self.faces.reshape(-1)

    @cached_property
    def head(self) -> Ints:
        """Vertex at which each halfedge ends; (3m,)."""
        return np.roll(self.faces, -1, axis=1).reshape(-1)

    @cached_property
    def _edge_tables(self) -> tuple[Ints, Ints, Ints]:
        """Edges (ne, 2), edge of each halfedge (3m,), halfedges of each edge (ne, 2)."""
        low, high = np.minimum(self.tail, self.head), np.maximum(self.tail, self.head)
        key = low * np.int64(self.n_vertices) + high
        unique, edge_of, count = np.unique(key, return_inverse=True, return_counts=True)
        edges = np.stack([unique // self.n_vertices, unique % self.n_vertices], axis=1)
        if (edges[:, 0] == edges[:, 1]).any():
            raise MeshError("a face names the same vertex twice; run repair first")
        if (count > 2).any():
            i, j = edges[count > 2][0]
            raise MeshError(
                f"{int((count > 2).sum())} edges have more than two faces, the first joins "
                f"vertices {i} and {j}; run repair first"
            )
        forward = self.tail < self.head
        halfedges = np.full((len(edges), 2), -1, dtype=np.int64)
        order = np.arange(len(key))
        halfedges[edge_of[forward], 0] = order[forward]
        halfedges[edge_of[~forward], 1] = order[~forward]
        bad = (count == 2) & (halfedges < 0).any(axis=1)
        if bad.any():
            i, j = edges[bad][0]
            raise MeshError(
                f"{int(bad.sum())} edges join faces of unlike orientation, the first joins "
                f"vertices {i} and {j}; run repair first"
            )
        return edges, edge_of.astype(np.int64), halfedges

    @property
    def edges(self) -> Ints:
        """Vertex pairs (lower, higher); (ne, 2), sorted."""
        return self._edge_tables[0]

    @property
    def halfedge_edge(self) -> Ints:
        """Edge of each halfedge; (3m,)."""
        return self._edge_tables[1]

    @property
    def edge_halfedges(self) -> Ints:
        """Halfedges low->high and high->low of each edge, -1 where absent; (ne, 2)."""
        return self._edge_tables[2]

    @cached_property
    def twin(self) -> Ints:
        """Opposite halfedge, -1 on a boundary; (3m,)."""
        _, edge_of, halfedges = self._edge_tables
        pair = halfedges[edge_of]
        return np.where(pair[:, 0] == np.arange(len(edge_of)), pair[:, 1], pair[:, 0])

    @cached_property
    def outgoing(self) -> Ints:
        """First outgoing halfedge of each vertex (see the module head), -1 if unused; (n,)."""
        out = np.full(self.n_vertices, -1, dtype=np.int64)
        order = np.arange(3 * self.n_faces)[::-1]
        out[self.tail[order]] = order
        border = np.flatnonzero(self.twin < 0)[::-1]
        out[self.tail[border]] = border
        return out

    @cached_property
    def fan_rank(self) -> Ints:
        """Place of each halfedge in the counter-clockwise fan about its tail; (3m,).

        0 is ``outgoing``. Halfedges that the turn about the vertex does not reach (a vertex where
        several fans meet) keep -1.
        """
        rank = np.full(3 * self.n_faces, -1, dtype=np.int64)
        current = self.outgoing[self.outgoing >= 0]
        step = 0
        while current.size:
            rank[current] = step
            step += 1
            current = self.twin[prev_halfedge(current)]
            current = current[current >= 0]
            current = current[rank[current] < 0]
        return rank

    @cached_property
    def has_manifold_vertices(self) -> bool:
        """Whether every vertex has a single fan of faces."""
        return bool((self.fan_rank >= 0).all())

    # ---- boundary and components ----------------------------------------------------------

    @cached_property
    def is_boundary_vertex(self) -> Bools:
        """Whether a vertex lies on a boundary; (n,)."""
        flag = np.zeros(self.n_vertices, dtype=bool)
        border = self.twin < 0
        flag[self.tail[border]] = True
        flag[self.head[border]] = True
        return flag

    @property
    def is_closed(self) -> bool:
        """Whether there is no boundary."""
        return bool((self.twin >= 0).all())

    @cached_property
    def boundary_loops(self) -> tuple[Ints, ...]:
        """Boundary halfedges of each loop, in the order of travel (face to the left)."""
        border = np.flatnonzero(self.twin < 0)
        following = border.copy()
        # Turn about the head of each boundary halfedge, through the fan, to the next boundary one.
        turning = next_halfedge(border)
        active = np.arange(len(border))
        while active.size:
            other = self.twin[turning[active]]
            arrived = other < 0
            following[active[arrived]] = turning[active[arrived]]
            active = active[~arrived]
            turning[active] = next_halfedge(other[~arrived])
        successor = dict(zip(border.tolist(), following.tolist(), strict=True))
        loops = []
        while successor:
            start = next(iter(successor))
            loop = [start]
            h = successor.pop(start)
            while h != start:
                loop.append(h)
                h = successor.pop(h)
            loops.append(np.array(loop, dtype=np.int64))
        return tuple(loops)

    @cached_property
    def face_component(self) -> Ints:
        """Label of the edge-connected component of each face, 0-based; (m,)."""
        inner = np.flatnonzero(self.twin >= 0)
        graph = coo_matrix(
            (np.ones(len(inner), dtype=np.int8), (inner // 3, self.twin[inner] // 3)),
            shape=(self.n_faces, self.n_faces),
        )
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    @property
    def n_components(self) -> int:
        """Number of edge-connected components."""
        return int(self.face_component.max()) + 1

    # ---- metric ---------------------------------------------------------------------------

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box of the used vertices."""
        used = self.vertices[self.is_used_vertex]
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))

    @cached_property
    def edge_lengths(self) -> Floats:
        """Length of halfedge k of each face; (m, 3)."""
        p = self.vertices[self.faces]
        return np.asarray(np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2))

    @cached_property
    def _area_vectors(self) -> Floats:
        p = self.vertices[self.faces]
        return 0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])

    @cached_property
    def face_areas(self) -> Floats:
        """Area of each face; (m,)."""
        return np.asarray(np.linalg.norm(self._area_vectors, axis=1))

    @property
    def area(self) -> float:
        """Total area."""
        return float(self.face_areas.sum())

    @cached_property
    def face_normals(self) -> Floats:
        """Unit normal of each face, zero where the area is zero; (m, 3)."""
        area = self.face_areas[:, None]
        return np.divide(
            self._area_vectors, area, out=np.zeros_like(self._area_vectors), where=area > 0
        )

    @cached_property
    def face_altitudes(self) -> Floats:
        """Distance of corner k of each face from the opposite edge; (m, 3)."""
        opposite = np.roll(self.edge_lengths, -1, axis=1)
        twice = np.repeat(2.0 * self.face_areas, 3).reshape(-1, 3)
        return np.divide(twice, opposite, out=np.zeros_like(twice), where=opposite > 0)

    @cached_property
    def corner_angles(self) -> Floats:
        """Interior angle at corner k of each face, radians; (m, 3)."""
        p = self.vertices[self.faces]
        forward = np.roll(p, -1, axis=1) - p
        backward = np.roll(p, 1, axis=1) - p
        sine = np.linalg.norm(np.cross(forward, backward), axis=2)
        cosine = np.einsum("mki,mki->mk", forward, backward)
        return np.asarray(np.arctan2(sine, cosine))

    @cached_property
    def dihedral_angles(self) -> Floats:
        """Angle between the normals across halfedges, positive if convex, 0 on a border; (3m,)."""
        inner = np.flatnonzero(self.twin >= 0)
        n = self.face_normals
        here, there = n[inner // 3], n[self.twin[inner] // 3]
        along = self.vertices[self.head[inner]] - self.vertices[self.tail[inner]]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
        sine = np.einsum("hi,hi->h", np.cross(here, there), along)
        angle = np.zeros(3 * self.n_faces)
        angle[inner] = np.arctan2(sine, np.einsum("hi,hi->h", here, there))
        return angle

    @cached_property
    def vertex_normals(self) -> Floats:
        """Angle-weighted unit normals; (n, 3), zero at unused vertices."""
        total = np.zeros((self.n_vertices, 3))
        weighted = self.corner_angles[:, :, None] * self.face_normals[:, None, :]
        np.add.at(total, self.faces.reshape(-1), weighted.reshape(-1, 3))
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return np.divide(total, length, out=np.zeros_like(total), where=length > 0)

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the area of the faces around each vertex (lumped mass); (n,)."""
        total = np.zeros(self.n_vertices)
        np.add.at(total, self.faces.reshape(-1), np.repeat(self.face_areas / 3.0, 3))
        return total

    # ---- parts ----------------------------------------------------------------------------

    def submesh(self, face_mask: ArrayLike) -> tuple[TriMesh, Ints]:
        """The faces of a mask or index list as a mesh, and the old indices of its vertices.

        The mesh itself, with all that it knows already, if the mask leaves nothing out.
        """
        mask = np.asarray(face_mask)
        if mask.dtype == np.bool_ and mask.all() and self.is_used_vertex.all():
            return self, np.arange(self.n_vertices)
        chosen = self.faces[mask]
        used, local = np.unique(chosen, return_inverse=True)
        return TriMesh(self.vertices[used], local.reshape(-1, 3)), used
