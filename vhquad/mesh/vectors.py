"""Arithmetic of vectors along the last axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["cross", "nearest_share", "unit"]

Floats = NDArray[np.float64]


def unit(a: Floats) -> Floats:
    """Vectors scaled to length 1; zero ones stay zero."""
    length = np.sqrt(np.einsum("...i,...i->...", a, a))[..., None]
    return np.asarray(a / np.maximum(length, 1e-300))


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products, several times faster than ``np.cross``."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[..., j], b[..., k], out=out[..., i])
        out[..., i] -= a[..., k] * b[..., j]
    return out


def nearest_share(points: Floats, start: Floats, side: Floats) -> Floats:
    """Where on segments the points nearest to others are, from 0 at the start to 1.

    Segments go from ``start`` along ``side``; those of no length give 0.
    """
    squared = np.maximum(np.einsum("...i,...i->...", side, side), 1e-300)
    return np.asarray(
        np.clip(np.einsum("...i,...i->...", points - start, side) / squared, 0.0, 1.0)
    )
