"""The linear space of seamless maps of a cross field, with every constraint eliminated exactly.

A seamless map gives each face a chart ``z = u + iv`` such that across the halfedge ``h`` from face
``f`` to ``g`` the charts differ by ``z_g = i^r z_f + t``, that feature edges run along an axis, and
that the quarter turns ``r`` are those of the field (Kälberer et al. 2007; Bommes et al. 2009). The
charts are combed over a dual spanning tree, so that only the edges of a cut graph have ``r`` or
``t`` other than zero, and the remaining linear relations are solved in rational arithmetic: every
combination of the basis is seamless exactly, in floating point up to rounding and in integers
without any error.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from vhquad.field.align import AlignedField
from vhquad.mesh.triangle import next_halfedge
from vhquad.quad.elimination import Link, eliminate

__all__ = ["SeamlessSpace", "irregular_vertices", "seamless_space", "special_vertices"]

Ints = NDArray[np.int64]

# Real and imaginary part of i^r z in terms of (u, v): (source of u', sign), (source of v', sign).
_TURN = (((0, 1), (1, 1)), ((1, -1), (0, 1)), ((0, -1), (1, -1)), ((1, 1), (0, -1)))


@dataclass(frozen=True, eq=False)
class SeamlessSpace:
    """Seamless maps as combinations of a sparse basis.

    Attributes
    ----------
    wedge : (m, 3) int64
        Wedge of each corner: corners of one vertex that share their coordinates.
    rotation : (3m,) int64
        Quarter turns r across each halfedge, after combing.
    angle : (m,) float64
        Angle of the chart's u axis in the frame of the face, after combing.
    basis : (2 w, d) csr_matrix of int64
        Coordinates ``(u_0, v_0, u_1, v_1, ...)`` of the wedges are ``basis @ x / denominator``.
    denominator : int
        Common denominator; a power of two in all known cases.
    even : (d,) bool
        Unknowns on which the place of an isoline through a special vertex or along a feature
        depends, translations across the cut included; the others move ordinary vertices only (see
        ``vhquad.quad.seamless_map``).
    """

    wedge: Ints
    rotation: Ints
    angle: NDArray[np.float64]
    basis: csr_matrix
    denominator: int
    even: NDArray[np.bool_]

    @property
    def n_wedges(self) -> int:
        """Number of wedges."""
        return self.basis.shape[0] // 2


def seamless_space(aligned: AlignedField) -> SeamlessSpace:
    """Comb the charts of an aligned field, cut it open and eliminate all seamless constraints."""
    mesh = aligned.mesh
    turns, tree = _comb(aligned)
    inner = np.flatnonzero(mesh.twin >= 0)
    rotation = np.zeros(3 * mesh.n_faces, dtype=np.int64)
    rotation[inner] = (
        aligned.rotation[inner] + turns[mesh.twin[inner] // 3] - turns[inner // 3]
    ) % 4
    cut = _cut_edges(aligned, tree)
    wedge = _wedges(aligned, cut)
    segments = _segments(aligned, cut)
    links = _scalar_links(aligned, turns, rotation, wedge, segments)
    basis, denominator, linked, shifts = eliminate(2 * (int(wedge.max()) + 1), links)

    special = np.zeros(basis.shape[0], dtype=bool)
    corner_special = special_vertices(aligned)[mesh.faces]
    for axis in (0, 1):
        special[2 * wedge[corner_special] + axis] = True
    rows = basis[special | linked]
    even = shifts.copy()
    even[rows.indices] = True
    return SeamlessSpace(
        wedge=wedge,
        rotation=rotation,
        angle=aligned.angle - turns * (np.pi / 2),
        basis=basis,
        denominator=denominator,
        even=even,
    )


def irregular_vertices(aligned: AlignedField) -> NDArray[np.bool_]:
    """Vertices with a sector of other than 4 quads inside or 2 along a feature, and ends and
    junctions of features; (n,) bool."""
    mesh = aligned.mesh
    regular = np.where(aligned.sector_is_feature, 2, 4)
    irregular = np.zeros(mesh.n_vertices, dtype=bool)
    irregular[aligned.sector_vertex[aligned.sector_quads != regular]] = True
    valence = np.bincount(_feature_edges(aligned).ravel(), minlength=mesh.n_vertices)
    return irregular | ((valence != 0) & (valence != 2))


def special_vertices(aligned: AlignedField) -> NDArray[np.bool_]:
    """Vertices where isolines start: the irregular ones, and seeds where there would be none.

    A feature curve without an irregular vertex gets one regular vertex as a seed, and so does a
    closed surface without any. (n,) bool.
    """
    mesh = aligned.mesh
    special = irregular_vertices(aligned)
    edges = _feature_edges(aligned)
    if len(edges):
        graph = coo_matrix(
            (np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])),
            shape=(mesh.n_vertices, mesh.n_vertices),
        )
        curve = connected_components(graph, directed=False)[1]
        on_curve = np.unique(edges)
        bare = np.setdiff1d(curve[on_curve], curve[on_curve[special[on_curve]]])
        for label in bare:
            special[on_curve[curve[on_curve] == label][0]] = True
    if not special.any():
        special[mesh.faces[0, 0]] = True
    return special


def _feature_edges(aligned: AlignedField) -> Ints:
    mesh = aligned.mesh
    return mesh.edges[np.unique(mesh.halfedge_edge[aligned.feature])]


def _comb(aligned: AlignedField) -> tuple[Ints, NDArray[np.bool_]]:
    """Quarter turns that make r = 0 over a dual spanning forest, and its edges as a mask."""
    mesh = aligned.mesh
    inner = np.flatnonzero(mesh.twin >= 0)
    graph = coo_matrix(
        (np.ones(len(inner), dtype=np.int8), (inner // 3, mesh.twin[inner] // 3)),
        shape=(mesh.n_faces, mesh.n_faces),
    ).tocsr()
    turns = np.zeros(mesh.n_faces, dtype=np.int64)
    tree = np.zeros(mesh.n_edges, dtype=bool)
    twin_face = np.where(mesh.twin >= 0, mesh.twin // 3, -1).reshape(-1, 3)
    roots = np.unique(mesh.face_component, return_index=True)[1]
    for root in roots:
        order, parent = breadth_first_order(graph, root, directed=False)
        children = order[1:]
        above = parent[children]
        # The halfedge of the parent that faces the child.
        side = np.argmax(twin_face[above] == children[:, None], axis=1)
        h = 3 * above + side
        tree[mesh.halfedge_edge[h]] = True
        steps = aligned.rotation[h].tolist()
        value = turns.tolist()
        for child, up, step in zip(children.tolist(), above.tolist(), steps, strict=True):
            value[child] = (value[up] - step) % 4
        turns = np.array(value, dtype=np.int64)
    return turns, tree


def _cut_nodes(aligned: AlignedField) -> NDArray[np.bool_]:
    """Vertices at which the transition across a cut may change: singular or on a feature."""
    mesh = aligned.mesh
    node = special_vertices(aligned)
    node[mesh.tail[aligned.feature]] = True
    node[mesh.head[aligned.feature]] = True
    return node


def _cut_edges(aligned: AlignedField, tree: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Interior edges off the tree, without loose ends at ordinary vertices."""
    mesh = aligned.mesh
    cut = ~tree & (mesh.edge_halfedges >= 0).all(axis=1)
    keep = _cut_nodes(aligned)
    ends = mesh.edges
    degree = np.bincount(ends[cut].ravel(), minlength=mesh.n_vertices)
    incident: list[set[int]] = [set() for _ in range(mesh.n_vertices)]
    for e in np.flatnonzero(cut).tolist():
        incident[ends[e, 0]].add(e)
        incident[ends[e, 1]].add(e)
    loose = deque(np.flatnonzero((degree == 1) & ~keep).tolist())
    while loose:
        v = loose.popleft()
        if len(incident[v]) != 1:
            continue
        e = incident[v].pop()
        cut[e] = False
        other = int(ends[e, 0] + ends[e, 1] - v)
        incident[other].discard(e)
        if len(incident[other]) == 1 and not keep[other]:
            loose.append(other)
    return cut


def _wedges(aligned: AlignedField, cut: NDArray[np.bool_]) -> Ints:
    """Classes of corners joined across edges that are not cut; (m, 3)."""
    mesh = aligned.mesh
    h = np.flatnonzero((mesh.twin >= 0) & ~cut[mesh.halfedge_edge])
    other = next_halfedge(mesh.twin[h])
    size = 3 * mesh.n_faces
    graph = coo_matrix((np.ones(len(h), dtype=np.int8), (h, other)), shape=(size, size))
    label = connected_components(graph, directed=False)[1]
    return label.astype(np.int64).reshape(-1, 3)


def _segments(aligned: AlignedField, cut: NDArray[np.bool_]) -> list[list[int]]:
    """Chains of cut halfedges with one transition each, from node to node of the cut graph."""
    mesh = aligned.mesh
    node = _cut_nodes(aligned)
    edges = np.flatnonzero(cut)
    degree = np.bincount(mesh.edges[edges].ravel(), minlength=mesh.n_vertices)
    node |= degree != 2
    leaving: dict[int, list[int]] = {}
    for h in mesh.edge_halfedges[edges].ravel().tolist():
        leaving.setdefault(int(mesh.tail[h]), []).append(h)
    used: set[int] = set()
    segments: list[list[int]] = []

    def walk(first: int) -> None:
        chain = [first]
        used.add(int(mesh.halfedge_edge[first]))
        while not node[mesh.head[chain[-1]]]:
            back = int(mesh.twin[chain[-1]])
            following = [h for h in leaving[int(mesh.head[chain[-1]])] if h != back]
            if int(mesh.halfedge_edge[following[0]]) in used:
                break
            chain.append(following[0])
            used.add(int(mesh.halfedge_edge[following[0]]))
        segments.append(chain)

    for v in np.flatnonzero(node & (degree > 0)).tolist():
        for h in leaving[v]:
            if int(mesh.halfedge_edge[h]) not in used:
                walk(h)
    for h in mesh.edge_halfedges[edges, 0].tolist():  # closed curves without a node
        if int(mesh.halfedge_edge[h]) not in used:
            node[mesh.tail[h]] = True
            walk(h)
    return segments


def _scalar_links(
    aligned: AlignedField,
    turns: Ints,
    rotation: Ints,
    wedge: Ints,
    segments: list[list[int]],
) -> list[Link]:
    mesh = aligned.mesh
    flat = wedge.reshape(-1)
    links: list[Link] = []
    for s, chain in enumerate(segments):
        h = np.array(chain)
        g = mesh.twin[h]
        r = int(rotation[h[0]])
        if (rotation[h] != r).any():
            raise AssertionError("a cut segment changes its rotation")
        near = np.append(flat[h], flat[next_halfedge(h[-1:])])
        far = np.append(flat[next_halfedge(g)], flat[g[-1:]])
        for a, b in zip(near.tolist(), far.tolist(), strict=True):
            for axis in (0, 1):
                source, sign = _TURN[r][axis]
                links.append((2 * a + source, 2 * b + axis, sign, 2 * s + axis))
    # Each feature edge once; a crease's other side follows from its transition.
    h = np.flatnonzero(aligned.feature)
    h = h[(mesh.twin[h] < 0) | (h < mesh.twin[h])]
    fixed = 1 - (aligned.axis[h] + turns[h // 3]) % 2  # u-parallel edges keep v
    near, far = 2 * flat[h] + fixed, 2 * flat[next_halfedge(h)] + fixed
    links.extend((a, b, 1, -1) for a, b in zip(near.tolist(), far.tolist(), strict=True))
    return links
