"""QuadMesh: a mesh of quads only, and its topology, valid or not.

Unlike :class:`vhquad.mesh.triangle.TriMesh` it never refuses bad topology, since its purpose is to
tell what is wrong with a result. Halfedge ``h = 4 * q + k`` runs from corner ``k`` to corner
``(k + 1) % 4`` of quad ``q``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.errors import MeshError

__all__ = ["QuadMesh"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class QuadMesh:
    """Vertices and quads; arrays are copied and read-only.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Positions, stored as float64.
    quads : (k, 4) array_like
        Vertex indices, counter-clockwise seen from outside, stored as int64; k may be 0.

    Raises
    ------
    MeshError
        If shapes, indices or values are unusable.
    """

    vertices: Floats
    quads: Ints

    def __init__(self, vertices: ArrayLike, quads: ArrayLike) -> None:
        v = np.array(vertices, dtype=np.float64)
        q = np.array(quads)
        if v.ndim != 2 or v.shape[1] != 3:
            raise MeshError(f"vertices must have shape (n, 3), not {v.shape}")
        if q.ndim != 2 or q.shape[1] != 4:
            raise MeshError(f"quads must have shape (k, 4), not {q.shape}")
        if not np.issubdtype(q.dtype, np.integer):
            raise MeshError(f"quads must hold integers, not {q.dtype}")
        q = q.astype(np.int64)
        if not np.isfinite(v).all():
            bad = np.flatnonzero(~np.isfinite(v).all(axis=1))
            raise MeshError(f"{len(bad)} vertices are NaN or infinite, the first is {bad[0]}")
        if q.size and (q.min() < 0 or q.max() >= len(v)):
            bad = np.flatnonzero(((q < 0) | (q >= len(v))).any(axis=1))
            raise MeshError(
                f"{len(bad)} quads name vertices outside 0..{len(v) - 1}, the first is {bad[0]}"
            )
        v.flags.writeable = False
        q.flags.writeable = False
        object.__setattr__(self, "vertices", v)
        object.__setattr__(self, "quads", q)

    # ---- edges ----------------------------------------------------------------------------

    @property
    def n_vertices(self) -> int:
        """Number of vertices, n, used or not."""
        return len(self.vertices)

    @property
    def n_quads(self) -> int:
        """Number of quads, k."""
        return len(self.quads)

    @cached_property
    def tail(self) -> Ints:
        """Vertex at which each halfedge starts; (4k,)."""
        return self.quads.reshape(-1)

    @cached_property
    def head(self) -> Ints:
        """Vertex at which each halfedge ends; (4k,)."""
        return np.roll(self.quads, -1, axis=1).reshape(-1)

    @cached_property
    def _edge_tables(self) -> tuple[Ints, Ints, Ints]:
        low, high = np.minimum(self.tail, self.head), np.maximum(self.tail, self.head)
        n = np.int64(max(self.n_vertices, 1))
        key, edge_of, count = np.unique(low * n + high, return_inverse=True, return_counts=True)
        return np.stack([key // n, key % n], axis=1), edge_of.astype(np.int64), count

    @property
    def edges(self) -> Ints:
        """Vertex pairs (lower, higher); (ne, 2), sorted."""
        return self._edge_tables[0]

    @property
    def halfedge_edge(self) -> Ints:
        """Edge of each halfedge; (4k,)."""
        return self._edge_tables[1]

    @property
    def edge_quads(self) -> Ints:
        """How many quads have each edge; (ne,): 1 on a boundary, 2 inside, more is non-manifold."""
        return self._edge_tables[2]

    @cached_property
    def twin(self) -> Ints:
        """The other halfedge of an edge with two quads, else -1; (4k,)."""
        order = np.argsort(self.halfedge_edge, kind="stable")
        inner = order[self.edge_quads[self.halfedge_edge[order]] == 2].reshape(-1, 2)
        twin = np.full(4 * self.n_quads, -1, dtype=np.int64)
        twin[inner[:, 0]], twin[inner[:, 1]] = inner[:, 1], inner[:, 0]
        return twin

    # ---- validity -------------------------------------------------------------------------

    @cached_property
    def degenerate_quads(self) -> Ints:
        """Quads that name a vertex twice."""
        s = np.sort(self.quads, axis=1)
        return np.flatnonzero((s[:, 1:] == s[:, :-1]).any(axis=1))

    @property
    def nonmanifold_edges(self) -> Ints:
        """Edges with more than two quads."""
        return np.flatnonzero(self.edge_quads > 2)

    @cached_property
    def misoriented_edges(self) -> Ints:
        """Edges whose two quads run along it in the same direction."""
        inner = np.flatnonzero(self.twin >= 0)
        same = self.tail[inner] == self.tail[self.twin[inner]]
        return np.unique(self.halfedge_edge[inner[same]])

    @cached_property
    def _corner_fan(self) -> Ints:
        """Label of the fan of quads, joined across two-quad edges, of each corner; (4k,)."""
        h = np.flatnonzero(self.twin >= 0)
        t = self.twin[h]
        after_h, after_t = h - h % 4 + (h + 1) % 4, t - t % 4 + (t + 1) % 4
        same = self.tail[h] == self.tail[t]
        a = np.concatenate([h, after_h])
        b = np.concatenate([np.where(same, t, after_t), np.where(same, after_t, t)])
        return _labels(4 * self.n_quads, a, b)

    @cached_property
    def nonmanifold_vertices(self) -> Ints:
        """Vertices where several fans of quads meet, ends of non-manifold edges included."""
        pairs = np.unique(np.stack([self.tail, self._corner_fan], axis=1), axis=0)
        return np.flatnonzero(np.bincount(pairs[:, 0], minlength=self.n_vertices) > 1)

    @cached_property
    def is_manifold(self) -> bool:
        """Whether edges and vertices are manifold, winding is consistent, no quad degenerate."""
        return not (
            len(self.nonmanifold_edges)
            or len(self.nonmanifold_vertices)
            or len(self.misoriented_edges)
            or len(self.degenerate_quads)
        )

    # ---- global topology ------------------------------------------------------------------

    @cached_property
    def is_boundary_vertex(self) -> Bools:
        """Whether a vertex lies on an edge with a single quad; (n,)."""
        flag = np.zeros(self.n_vertices, dtype=bool)
        flag[self.edges[self.edge_quads == 1]] = True
        return flag

    @cached_property
    def n_boundary_loops(self) -> int:
        """Number of closed chains of boundary edges; chains that touch at a vertex stay apart."""
        border = np.flatnonzero(self.edge_quads[self.halfedge_edge] == 1)
        ends = np.stack(
            [self._corner_fan[border], self._corner_fan[border - border % 4 + (border + 1) % 4]], 1
        )
        nodes, local = np.unique(ends, return_inverse=True)
        local = local.reshape(-1, 2)
        return int(np.unique(_labels(len(nodes), local[:, 0], local[:, 1])).size)

    @cached_property
    def quad_component(self) -> Ints:
        """Label of the edge-connected component of each quad, 0-based; (k,)."""
        order = np.argsort(self.halfedge_edge, kind="stable")
        linked = np.flatnonzero(np.diff(self.halfedge_edge[order]) == 0)
        return _labels(self.n_quads, order[linked] // 4, order[linked + 1] // 4)

    @property
    def n_components(self) -> int:
        """Number of edge-connected components."""
        return int(self.quad_component.max()) + 1 if self.n_quads else 0

    @property
    def euler_characteristic(self) -> int:
        """V - E + F over the vertices that some quad uses."""
        return int((self.valence > 0).sum()) - len(self.edges) + self.n_quads

    @property
    def genus(self) -> int:
        """Handles of all components together, from V - E + F = 2 c - 2 g - loops."""
        return (2 * self.n_components - self.n_boundary_loops - self.euler_characteristic) // 2

    # ---- valences -------------------------------------------------------------------------

    @cached_property
    def valence(self) -> Ints:
        """Number of edges at each vertex, 0 if unused; (n,)."""
        return np.bincount(self.edges.reshape(-1), minlength=self.n_vertices)

    @property
    def irregular_interior(self) -> dict[int, int]:
        """How many interior vertices have each valence other than 4."""
        return _tally(self.valence[~self.is_boundary_vertex & (self.valence > 0)], 4)

    @property
    def irregular_boundary(self) -> dict[int, int]:
        """How many boundary vertices have each valence other than 3; 2 is a convex corner."""
        return _tally(self.valence[self.is_boundary_vertex], 3)

    @property
    def doublets(self) -> Ints:
        """Interior vertices of valence 2: their two quads share two edges."""
        return np.flatnonzero(~self.is_boundary_vertex & (self.valence == 2))

    # ---- metric ---------------------------------------------------------------------------

    @cached_property
    def edge_lengths(self) -> Floats:
        """Length of each edge; (ne,)."""
        i, j = self.edges.T
        return np.asarray(np.linalg.norm(self.vertices[j] - self.vertices[i], axis=1))

    def triangles(self) -> Ints:
        """The quads cut along shorter diagonals: faces 2q and 2q + 1 are of quad q; (2k, 3)."""
        p = self.vertices[self.quads]
        d02 = np.linalg.norm(p[:, 2] - p[:, 0], axis=1)
        d13 = np.linalg.norm(p[:, 3] - p[:, 1], axis=1)
        cut = np.where((d02 <= d13)[:, None], [0, 1, 2, 0, 2, 3], [0, 1, 3, 1, 2, 3])
        return np.take_along_axis(self.quads, cut, axis=1).reshape(-1, 3)


def _labels(n: int, a: Ints, b: Ints) -> Ints:
    """Component labels of a graph of n nodes with edges (a, b)."""
    graph = coo_matrix((np.ones(len(a), dtype=np.int8), (a, b)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _tally(values: Ints, regular: int) -> dict[int, int]:
    valence, count = np.unique(values[values != regular], return_counts=True)
    return dict(zip(valence.tolist(), count.tolist(), strict=True))
