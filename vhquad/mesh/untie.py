"""Edges that join the same two vertices as another edge, which no list of triangles can tell apart.

Gluing may leave two edges between one pair of vertices. All but one of them get a vertex in their
middle. In a tangle where that has no end, faces are cut loose instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.glue import Gluing, glue

__all__ = ["Soup", "clashing_edges", "untie"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class Soup:
    """Triangles on their way to a mesh."""

    points: Floats
    """(n, 3) positions."""
    unit: Floats
    """(n, 3) positions over the largest coordinate, for computing."""
    faces: Ints
    """(m, 3)"""
    weld: Ints
    """(n,) class of each vertex: the lowest index in it."""
    vertex_source: Ints
    """(n,) vertex of the input, -1 for one that was added in the middle of an edge."""
    face_source: Ints
    """(m,) face of the input."""


def untie(soup: Soup) -> tuple[Soup, Gluing]:
    """Glue the faces of a soup, adding vertices until no two edges join the same two vertices.

    Parameters
    ----------
    soup : Soup
        Without degenerate and duplicate faces.

    Returns
    -------
    Soup
        With the vertices and faces that were added.
    Gluing
        Of that soup; its counts are those of the soup as it came.
    """
    first = gluing = glue(soup.unit, soup.faces, soup.weld)
    clash, rounds = clashing_edges(gluing), 0
    while len(clash):  # none at all, as a rule
        soup = _split(soup, clash) if rounds < _ROUNDS else _cut_loose(soup, clash)
        gluing = glue(soup.unit, soup.faces, soup.weld)
        clash, rounds = clashing_edges(gluing), rounds + 1
    return soup, replace(gluing, crowded=first.crowded, cut=first.cut)


def clashing_edges(gluing: Gluing) -> Ints:
    """Edges that would have the same two vertices as another edge.

    Returns
    -------
    (c, 2) int64
        The two halfedges of each such edge, twice the same one on a boundary; of edges between the
        same vertices all but one.
    """
    single = np.ones(gluing.vertex.size, dtype=bool)
    single[gluing.first] = False
    single[gluing.second] = False
    lonely = np.flatnonzero(single)
    edges = np.concatenate(
        [np.stack([gluing.first, gluing.second], axis=1), np.stack([lonely, lonely], axis=1)]
    )
    tail, head = gluing.vertex.reshape(-1), np.roll(gluing.vertex, -1, axis=1).reshape(-1)
    key = (np.minimum(tail, head) * np.int64(len(tail)) + np.maximum(tail, head))[edges[:, 0]]
    _, keep = np.unique(key, return_index=True)
    return np.delete(edges, keep, axis=0)


def _split(soup: Soup, clash: Ints) -> Soup:
    """A new vertex on each edge of `clash`; a face takes part in one split at most."""
    faces, source, n = soup.faces, soup.face_source, len(soup.points)
    owner, number = clash // 3, np.arange(len(clash))[:, None]
    claim = np.full(len(faces), len(clash), dtype=np.int64)
    np.minimum.at(claim, owner, number)
    clash = clash[(claim[owner] == number).all(axis=1)]
    pair = clash[:, 0] != clash[:, 1]
    h = np.concatenate([clash[:, 0], clash[pair, 1]])
    new = n + np.concatenate([np.arange(len(clash)), np.flatnonzero(pair)])
    f, k = h // 3, h % 3
    tail, head, apex = faces[f, k], faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]
    stay = np.ones(len(faces), dtype=bool)
    stay[f] = False
    halves = [np.stack([tail, new, apex], axis=1), np.stack([new, head, apex], axis=1)]
    ends = soup.weld[np.stack([tail, head], axis=1)[: len(clash)]]
    return Soup(
        points=np.concatenate([soup.points, soup.points[ends].mean(axis=1)]),
        unit=np.concatenate([soup.unit, soup.unit[ends].mean(axis=1)]),
        faces=np.concatenate([faces[stay], *halves]),
        weld=np.concatenate([soup.weld, n + np.arange(len(clash))]),
        vertex_source=np.concatenate([soup.vertex_source, np.full(len(clash), -1)]),
        face_source=np.concatenate([source[stay], source[f], source[f]]),
    )


def _cut_loose(soup: Soup, clash: Ints) -> Soup:
    """The faces at the edges of `clash` with three vertices of their own."""
    f = np.flatnonzero(np.bincount(clash.reshape(-1) // 3, minlength=len(soup.faces)))
    old, n = soup.weld[soup.faces[f].reshape(-1)], len(soup.points)
    faces = soup.faces.copy()
    faces[f] = n + np.arange(3 * len(f)).reshape(-1, 3)
    return Soup(
        points=np.concatenate([soup.points, soup.points[old]]),
        unit=np.concatenate([soup.unit, soup.unit[old]]),
        faces=faces,
        weld=np.concatenate([soup.weld, n + np.arange(3 * len(f))]),
        vertex_source=np.concatenate([soup.vertex_source, soup.vertex_source[old]]),
        face_source=soup.face_source,
    )
