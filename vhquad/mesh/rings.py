"""Faces within some rings of others, and the separate parts that faces make."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

__all__ = ["separate_parts", "within_rings"]


def within_rings(
    faces: NDArray[np.int64], inside: NDArray[np.bool_], rings: int = 1
) -> NDArray[np.bool_]:
    """Some faces and those around them that share a vertex, so many times; (m,).

    Parameters
    ----------
    faces : (m, c) int64
        Vertices of triangles or quads.
    inside : (m,) bool
    rings : int
    """
    for _ in range(rings):
        touched = np.zeros(int(faces.max(initial=-1)) + 1, dtype=bool)
        touched[faces[inside]] = True
        inside = np.asarray(touched[faces].any(axis=1))
    return inside


def separate_parts(faces: NDArray[np.int64], inside: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Some faces in parts that share no vertex, each by its face numbers.

    Parameters
    ----------
    faces : (m, c) int64
        Vertices of triangles or quads.
    inside : (m,) bool
    """
    which = np.flatnonzero(inside)
    rows = np.repeat(np.arange(len(which)), faces.shape[1])
    shape = (len(which), int(faces.max(initial=-1)) + 1)
    touching = coo_matrix((np.ones(len(rows)), (rows, faces[which].reshape(-1))), shape).tocsr()
    number, label = connected_components(touching @ touching.T, directed=False)
    return [which[label == i] for i in range(number)]
