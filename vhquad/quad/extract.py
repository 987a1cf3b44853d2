"""Polygons of an integer-grid map: quads wherever it is valid, always a mesh of its topology.

The isolines of the map are embedded in the surface exactly (:mod:`vhquad.quad.isolines`). Where the
map folds over itself they make spurious grid points, one that turns the grid over for each one too
many; arcs of no length in the map join these, and contracting them and dropping what then bounds
nothing leaves the grid as it is outside the fold. What cannot be mended so comes out as a polygon
with other than four sides, for :mod:`vhquad.quad.polygons`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.triangle import TriMesh
from vhquad.quad.darts import Darts, face_orbits
from vhquad.quad.grid import GRID, IntegerGridMap, settle
from vhquad.quad.isolines import IsolineGraph, trace_isolines
from vhquad.quad.ragged import PolygonMesh

__all__ = ["Extraction", "extract_polygons"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Extraction:
    """Polygons of a map, and where their vertices lie.

    Attributes
    ----------
    polygons : PolygonMesh
        Polygons on the surface, glued along halfedges; quads wherever the map is valid.
    face : (n,) int64
        Face of the triangle mesh that holds each vertex.
    barycentric : (n, 3) float64
        Place in that face: exact 0 and 1 on edges and vertices.
    vertex : (n,) int64
        Vertex of the triangle mesh that a vertex must keep (cone, corner), else -1.
    halfedge : (n,) int64
        Boundary halfedge on which a vertex lies, else -1.
    n_contracted : int
        Arcs of no length in the map that were contracted; 0 without folds.
    """

    polygons: PolygonMesh
    face: Ints
    barycentric: Floats
    vertex: Ints
    halfedge: Ints
    n_contracted: int


def extract_polygons(mesh: TriMesh, uv: Ints, rotation: Ints, translation: Ints) -> Extraction:
    """Cut a surface along the isolines of an integer-grid map.

    Parameters
    ----------
    mesh : TriMesh
        Manifold; closed or open, any topology.
    uv : (m, 3, 2) int64
        Map at corner k of face f, in units of 1/GRID of a grid cell; faces may be turned over.
    rotation : (3m,) int64
        r of each halfedge: z_g = i^r z_f + t takes the chart of its face to that of the face
        across.
    translation : (3m, 2) int64
        t of each halfedge, a multiple of GRID.

    Returns
    -------
    Extraction

    Raises
    ------
    ParametrizationError
        If the map is not one: coordinates do not fit the transitions, a boundary edge is not on an
        isoline, a cone is off the grid, or a boundary loop meets no isoline.

    References
    ----------
    The aim is that of Ebke et al., QEx: Robust quad mesh extraction, 2013; the method is another.
    """
    grid_map = IntegerGridMap(mesh, uv, rotation, translation)
    graph = trace_isolines(grid_map, settle(grid_map))
    darts, contracted = _unfold(mesh, graph)
    order, start = face_orbits(darts.turn, darts.across, darts.alive)
    outside = np.zeros(len(order), dtype=bool)
    if len(order):
        outside = np.repeat(darts.outer[order[start[:-1]]], np.diff(start))
    sides = np.diff(start)[~outside[start[:-1]]] if len(order) else np.zeros(0, dtype=np.int64)
    order = order[~outside]
    place = np.full(len(graph.point), -1, dtype=np.int64)
    place[order] = np.arange(len(order))
    used, corners = np.unique(darts.point[order], return_inverse=True)
    barycentric = _barycentric(grid_map, graph, used)
    face = graph.face[used]
    positions = np.einsum("nk,nki->ni", barycentric, mesh.vertices[mesh.faces[face]])
    vertex = graph.vertex[used]
    positions[vertex >= 0] = mesh.vertices[vertex[vertex >= 0]]
    polygons = PolygonMesh(
        positions,
        corners.reshape(-1).astype(np.int64),
        np.concatenate([[0], np.cumsum(sides)]).astype(np.int64),
        place[darts.across[order]],
    )
    return Extraction(polygons, face, barycentric, vertex, graph.halfedge[used], contracted)


def _unfold(mesh: TriMesh, graph: IsolineGraph) -> tuple[Darts, int]:
    """Undo the folds of the graph; its darts and the number of arcs contracted."""
    pinned = np.flatnonzero(graph.vertex >= 0)
    corner = np.zeros(len(graph.face), dtype=bool)
    corner[pinned] = mesh.is_boundary_vertex[graph.vertex[pinned]]
    darts = Darts(graph, corner)
    return darts, darts.unfold() if (graph.sign < 0).any() else 0


def _barycentric(grid_map: IntegerGridMap, graph: IsolineGraph, points: Ints) -> Floats:
    """Barycentric coordinates of grid points in their faces, by the map as it was given."""
    face = graph.face[points]
    z = grid_map.uv[face] - GRID * graph.place[points][:, None, :]
    after, before = z[:, [1, 2, 0]], z[:, [2, 0, 1]]
    weight = (after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]).astype(np.float64)
    total = weight.sum(axis=1, keepdims=True)
    share = np.divide(weight, total, out=np.full(weight.shape, 1.0 / 3.0), where=total != 0)
    share = np.clip(share, 0.0, None)
    h = graph.halfedge[points]
    on = np.flatnonzero(h >= 0)
    k = h[on] % 3
    tail, head = z[on, k].astype(np.float64), z[on, (k + 1) % 3].astype(np.float64)
    length = np.abs(head - tail).sum(axis=1)
    t = np.clip(-(tail * np.sign(head - tail)).sum(axis=1) / length, 0.0, 1.0)
    share[on] = 0.0
    share[on, k], share[on, (k + 1) % 3] = 1.0 - t, t
    return np.asarray(share / share.sum(axis=1, keepdims=True))
