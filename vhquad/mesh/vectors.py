"""Arithmetic of vectors along the last axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["cross", "unit"]

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
