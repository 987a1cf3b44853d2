"""Faces within some rings of others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["within_rings"]


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
