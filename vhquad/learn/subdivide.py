"""One Catmull-Clark step that remembers where each new quad lies in its parent (design: targets).

Every quad (v0, v1, v2, v3) of the input becomes four, one at each corner; the parent's unit square
has corner 0 at (0, 0), corner 1 at (1, 0), corner 2 at (1, 1) and corner 3 at (0, 1).

Reference: Catmull and Clark 1978, "Recursively generated B-spline surfaces"; boundary vertices by
the cubic B-spline rule.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

__all__ = ["SubdividedQuads", "catmull_clark"]

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class SubdividedQuads:
    """The mesh after one step.

    Attributes
    ----------
    vertices : (n + e + k, 3) float64
        Old vertices moved, then edge points, then face points.
    quads : (4k, 4) int64
        Rows 4i..4i+3 lie in quad i of the input; row 4i+j sits at its corner j.
    parent : (4k,) int64
        Quad of the input.
    st : (4k, 4, 2) float64
        Where each corner lies in the parent's unit square.
    """

    vertices: NDArray[np.float64]
    quads: NDArray[np.int64]
    parent: NDArray[np.int64]
    st: NDArray[np.float64]


def catmull_clark(vertices: NDArray[np.float64], quads: NDArray[np.int64]) -> SubdividedQuads:
    """Subdivide once.

    Parameters
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
        Consistently oriented or not; an edge may have any number of quads (those with other than
        two count as creases, as a boundary does).

    Returns
    -------
    SubdividedQuads
    """
    n, k = len(vertices), len(quads)
    tail, head = quads.reshape(-1), np.roll(quads, -1, axis=1).reshape(-1)
    key = np.minimum(tail, head) * np.int64(n) + np.maximum(tail, head)
    unique, edge_of, count = np.unique(key, return_inverse=True, return_counts=True)
    ends = np.stack([unique // n, unique % n], axis=1)
    n_edges, inner = len(unique), count == 2
    face_point = vertices[quads].mean(axis=1)
    middle = vertices[ends].mean(axis=1)

    # An inner edge point is the mean of its ends and its two face points.
    rows = np.repeat(np.arange(k), 4)
    to_edge = coo_matrix((np.ones(4 * k), (edge_of, rows)), shape=(n_edges, k)).tocsr()
    around_edge = to_edge @ face_point / count[:, None]
    edge_point = np.where(inner[:, None], 0.5 * (middle + around_edge), middle)

    # An inner vertex of valence m: (mean of faces + 2 mean of edge middles + (m - 3) itself) / m.
    to_vertex = coo_matrix((np.ones(4 * k), (tail, rows)), shape=(n, k)).tocsr()
    n_faces = np.asarray(to_vertex.sum(axis=1)).ravel()
    flat = ends.reshape(-1)
    edge_rows = np.repeat(np.arange(n_edges), 2)
    by_edge = coo_matrix((np.ones(2 * n_edges), (flat, edge_rows)), shape=(n, n_edges)).tocsr()
    valence = np.asarray(by_edge.sum(axis=1)).ravel()
    used = np.maximum(valence, 1.0)[:, None]
    faces_mean = to_vertex @ face_point / np.maximum(n_faces, 1.0)[:, None]
    moved = (faces_mean + 2.0 * (by_edge @ middle) / used + (used - 3.0) * vertices) / used

    # A vertex with two boundary edges: 3/4 itself, 1/8 each neighbour; those with others stay.
    sharp = by_edge[:, ~inner]
    n_sharp = np.asarray(sharp.sum(axis=1)).ravel()
    on_curve = 0.5 * vertices + 0.25 * (sharp @ middle[~inner])
    corner = (n_sharp == 1) | (n_sharp > 2) | (valence == 0) | ((n_sharp == 2) & (n_faces == 1))
    moved = np.where((n_sharp == 2)[:, None], on_curve, moved)
    moved = np.where(corner[:, None], vertices, moved)

    edge_id = n + edge_of.reshape(k, 4)  # edge j runs from corner j to corner j + 1
    face_id = np.broadcast_to((n + n_edges + np.arange(k))[:, None], (k, 4))
    children = np.stack([quads, edge_id, face_id, np.roll(edge_id, 1, axis=1)], axis=2)
    after, before = np.roll(SQUARE, -1, axis=0), np.roll(SQUARE, 1, axis=0)
    centre = np.full((4, 2), 0.5)
    st = np.stack([SQUARE, 0.5 * (SQUARE + after), centre, 0.5 * (SQUARE + before)], axis=1)
    return SubdividedQuads(
        vertices=np.concatenate([moved, edge_point, face_point]),
        quads=children.reshape(-1, 4),
        parent=np.repeat(np.arange(k), 4),
        st=np.tile(st, (k, 1, 1)),
    )
