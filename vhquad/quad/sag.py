"""Shorter quad edges where creases are curved, so that they stay near them.

An edge of length s whose ends lie on a curve of radius R is ``s^2 / 8R`` away from it in its
middle, its sag. Where this is more than a share of the length, sizes are bounded; away from the
crease they grow again. Sizes alone do not do it: a map cannot have them all, and around a cone it
has far too few quads where the rulings are far apart. So pulls on the map make edges along creases
as short as their sag asks for (:class:`CreasePulls`). The count asked for stays: elsewhere edges
get longer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import dijkstra

from vhquad.field.align import AlignedField
from vhquad.mesh.triangle import TriMesh, next_halfedge
from vhquad.quad.seamless import SeamlessSpace, irregular_vertices

__all__ = ["CreasePulls", "CurvedSizes", "sizes_for_creases"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAG = 0.006
"""Of the wanted edge length, that an edge may be off its crease: at 2,000 quads 0.01 to 0.02 % of
the diagonal in the middle of the edge, where it is most."""
UNSEEN = 2e-4  # of the diagonal: no edge need be nearer to its crease
FINEST = 2.5  # times shorter than wanted otherwise: more costs squareness and sizes elsewhere
GROWTH = 0.25  # of the edge length, from one edge to the next away from a crease
PULL = 10.0  # weight of the length of crease edges, against directions over a strip of quads
HARDER = 3.0  # times the weight, where this has not been enough
HARDEST = 9.0  # times the weight in the end
SHORT = 0.98  # of the length in the map that is wanted: below, an edge is pulled
PLACES = np.linspace(-0.5, 0.5, 16)
"""Edge lengths around a point of a crease over which its bend is averaged: the zigzag of a
remeshed crease is no curve."""


@dataclass(frozen=True, eq=False)
class CurvedSizes:
    """Sizes that the sag of creases bounds.

    Attributes
    ----------
    aligned : AlignedField
        The field with these sizes.
    density : (3m,) float64
        Least quad edges per length along crease halfedges, for their sag; 0 elsewhere.
    """

    aligned: AlignedField
    density: Floats


def sizes_for_creases(aligned: AlignedField, adaptivity: float = 1.0) -> CurvedSizes:
    """Bound the sizes of a field by the sag of its creases, at the same count.

    Parameters
    ----------
    aligned : AlignedField
        With sizes.
    adaptivity : float
        1 for all that the sag asks for, less for less.
    """
    mesh, size = aligned.mesh, aligned.size
    density = np.zeros(3 * mesh.n_faces)
    if size is None:
        return CurvedSizes(aligned, density)
    bound = np.full(mesh.n_vertices, np.inf)
    for chain in _crease_chains(aligned):  # few
        vertices = np.append(mesh.tail[chain], mesh.head[chain[-1]])
        wanted = size[np.append(chain, chain[-1]) // 3]
        sag = np.maximum(chord_sags(mesh.vertices[vertices], wanted), 1e-12 * wanted)
        allowed = np.maximum(SAG * wanted, UNSEEN * mesh.diagonal)
        ratio = np.maximum(np.sqrt(allowed / sag), 1.0 / FINEST)
        np.minimum.at(bound, vertices, wanted * np.minimum(ratio, 1.0) ** adaptivity)
        density[chain] = 1.0 / (np.minimum(ratio[1:], ratio[:-1]) * wanted[:-1])
    bent = np.minimum(size, _spread(mesh, bound)[mesh.faces].mean(axis=1))
    scale = np.sqrt((mesh.face_areas / bent**2).sum() / (mesh.face_areas / size**2).sum())
    return CurvedSizes(replace(aligned, size=bent * scale), density)


class CreasePulls:
    """Pulls on the lengths that crease edges have in a map, where they are too short there.

    Parameters
    ----------
    aligned : AlignedField
    space : SeamlessSpace
    density : (3m,) float64
        Least quad edges per length along crease halfedges; 0 for none.
    """

    def __init__(self, aligned: AlignedField, space: SeamlessSpace, density: Floats) -> None:
        mesh = aligned.mesh
        h = np.flatnonzero(density > 0)
        face, corner = h // 3, h % 3
        inner = mesh.corner_angles[face]
        # Halfedge 0 is the axis of the frame.
        turn = np.choose(corner, [np.zeros(len(h)), np.pi - inner[:, 1], np.pi + inner[:, 0]])
        axis = np.rint((turn - space.angle[face]) / (np.pi / 2)).astype(np.int64) % 4
        start, end = (space.wedge.reshape(-1)[c] for c in (h, next_halfedge(h)))
        row = np.tile(np.arange(len(h)), 2)
        column = 2 * np.concatenate([end, start]) + np.tile(axis % 2, 2)
        sign = np.where(axis < 2, 1.0, -1.0)
        shape = (len(h), space.basis.shape[0])
        self.lengths: csr_matrix = coo_matrix(
            (np.concatenate([sign, -sign]), (row, column)), shape
        ).tocsr()
        span = mesh.edge_lengths.reshape(-1)[h]
        self.least = span * density[h]
        self.weight = np.zeros(len(h))
        size = np.ones(len(h)) if aligned.size is None else aligned.size[face]
        self._full = PULL * size / span

    def tighten(self, flat: Floats) -> bool:
        """Pull the edges that are too short in a map, ``(u_0, v_0, u_1, ...)``; whether any.

        Those that were pulled before are pulled harder.
        """
        short = self.lengths @ flat < SHORT * self.least
        harder = np.clip(HARDER * self.weight, self._full, HARDEST * self._full)
        self.weight[short] = harder[short]
        return bool(short.any())

    @property
    def matrix(self) -> csr_matrix:
        """Of the quadratic energy of the pulls."""
        return (self.lengths.T @ diags(self.weight) @ self.lengths).tocsr()

    @property
    def right(self) -> Floats:
        """Right hand side that goes with the matrix."""
        return np.asarray(self.lengths.T @ (self.weight * self.least))


def chord_sags(points: Floats, size: Floats) -> Floats:
    """How far the middle of a chord is from a curve, near each of its points; (p,).

    Parameters
    ----------
    points : (p, 3) float64
        In order; a closed curve ends at its first point.
    size : (p,) float64
        Length of the chord at each point. On a curve that is shorter, a shorter chord's sag counts
        with the square of the lengths.
    """
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    whole = arc[-1]
    closed = bool((points[0] == points[-1]).all())
    half = np.minimum(0.5 * size, 0.5 * whole)[:, None]

    def at(t: Floats) -> Floats:
        t = np.mod(t, whole) if closed else t
        return np.stack([np.interp(t, arc, points[:, i]) for i in range(3)], axis=-1)

    middle = arc[:, None] + PLACES * size[:, None]
    if not closed:  # the places move inwards, as far as they can
        reach = np.minimum(half + 0.5 * size[:, None], 0.5 * whole)
        middle = np.clip(arc[:, None], reach, whole - reach) + PLACES * size[:, None]
        middle = np.clip(middle, half, whole - half)
    off = 0.5 * (at(middle - half) + at(middle + half)) - at(middle)
    return np.asarray(np.linalg.norm(off.mean(axis=1), axis=1) * (0.5 * size / half[:, 0]) ** 2)


def _crease_chains(aligned: AlignedField) -> list[Ints]:
    """Crease halfedges in order, from corner to corner or all round; each edge once."""
    mesh = aligned.mesh
    stops = irregular_vertices(aligned)
    crease = np.flatnonzero(aligned.feature & (mesh.twin >= 0))
    crease = crease[np.argsort(~stops[mesh.tail[crease]], kind="stable")]  # loops come last
    edge, head = mesh.halfedge_edge, mesh.head
    leaving: dict[int, list[int]] = {}
    for h in crease.tolist():
        leaving.setdefault(int(mesh.tail[h]), []).append(h)
    used: set[int] = set()
    chains: list[Ints] = []
    for first in crease.tolist():
        chain: list[int] = []
        following = [first]
        while following and int(edge[following[0]]) not in used:
            chain.append(following[0])
            used.add(int(edge[chain[-1]]))
            end = int(head[chain[-1]])
            ways = [] if stops[end] else leaving[end]
            following = [h for h in ways if int(edge[h]) not in used]
        if chain:
            chains.append(np.array(chain))
    return chains


def _spread(mesh: TriMesh, bound: Floats) -> Floats:
    """Bounds at some vertices, growing with the distance from these; (n,), infinite if none."""
    n, known = mesh.n_vertices, np.flatnonzero(bound < np.inf)
    i, j = mesh.edges.T
    step = GROWTH * np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
    ends = (np.append(i, np.full(len(known), n)), np.append(j, known))
    graph = coo_matrix((np.append(step, bound[known]), ends), (n + 1, n + 1))
    return np.asarray(dijkstra(graph.tocsr(), directed=False, indices=np.array([n]))[0, :n])
