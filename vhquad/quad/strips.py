"""Strips of quads (side by side across opposite edges) split lengthwise: still all quads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.mesh.quad import QuadMesh

__all__ = ["StripSplit", "split_strips"]

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class StripSplit:
    """Quads of which some strips are split.

    Attributes
    ----------
    mesh : QuadMesh
        The vertices given come first, as they were; new ones are in the middle of edges and quads.
    edge : (j,) int64
        Edge of the mesh before that each new vertex is in the middle of; -1 in a quad.
    """

    mesh: QuadMesh
    edge: Ints


def split_strips(mesh: QuadMesh, edges: ArrayLike) -> StripSplit:
    """Split the strips that run across some edges, which get a vertex in the middle each.

    Where strips cross, or one crosses itself, a quad is split in four. Topology is kept, and so is
    the valence of every vertex.

    Parameters
    ----------
    mesh : QuadMesh
        Manifold.
    edges : (k,) array_like of int
        Of ``mesh.edges``.
    """
    sides = mesh.halfedge_edge.reshape(-1, 4)
    a, b = np.concatenate([sides[:, [0, 2]], sides[:, [1, 3]]]).T
    shape = (len(mesh.edges), len(mesh.edges))
    links = coo_matrix((np.ones(len(a), dtype=np.int8), (a, b)), shape)
    strip = connected_components(links, directed=False)[1]
    cut = np.isin(strip, strip[np.asarray(edges, dtype=np.int64)])

    n, v = mesh.n_vertices, mesh.vertices
    split = np.flatnonzero(cut)
    number = np.full(len(mesh.edges), -1, dtype=np.int64)
    number[split] = n + np.arange(len(split))
    first, second = cut[sides[:, 0]], cut[sides[:, 1]]  # edges 0 and 2, edges 1 and 3
    four = np.flatnonzero(first & second)
    centre = np.full(mesh.n_quads, -1, dtype=np.int64)
    centre[four] = n + len(split) + np.arange(len(four))

    # By name: corners a b c d; middles p of ab, q of bc, r of cd, s of da; centre o.
    names = dict(
        zip("abcdpqrs", np.concatenate([mesh.quads, number[sides]], axis=1).T, strict=True)
    )
    names["o"] = centre
    made, source = [mesh.quads[~first & ~second]], [np.flatnonzero(~first & ~second)]
    for chosen, pieces in (
        (first & ~second, ("aprd", "pbcr")),
        (second & ~first, ("abqs", "sqcd")),
        (first & second, ("apos", "pbqo", "oqcr", "sord")),
    ):
        for piece in pieces:
            made.append(np.stack([names[k][chosen] for k in piece], axis=1))
            source.append(np.flatnonzero(chosen))
    order = np.argsort(np.concatenate(source), kind="stable")
    ends = mesh.edges[split]
    vertices = np.concatenate([v, v[ends].mean(axis=1), v[mesh.quads[four]].mean(axis=1)])
    return StripSplit(
        QuadMesh(vertices, np.concatenate(made)[order]),
        np.concatenate([split, np.full(len(four), -1, dtype=np.int64)]),
    )
