"""Intrinsic metric of triangles: lengths in, angles, areas and cotangents out; mollification.

``lengths[f, k]`` is the length of halfedge k, from corner k to corner k + 1 of face f. Everything
here is a function of lengths alone, so it serves embedded meshes and intrinsic triangulations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError

__all__ = ["areas", "corner_angles", "cotangents", "doubled_areas", "mollified_lengths"]

Floats = NDArray[np.float64]


def mollified_lengths(lengths: Floats, relative_margin: float = 1e-6) -> Floats:
    """Lengthen all edges by one constant, so that no triangle is degenerate.

    Nothing changes where every triangle already keeps the margin.

    Parameters
    ----------
    lengths : (m, 3) float64
        Edge lengths of each face, in mesh units.
    relative_margin : float
        How far the sum of two edges must exceed the third, in units of the mean edge length.

    Returns
    -------
    (m, 3) float64

    Raises
    ------
    MeshError
        If all edges have length zero.

    References
    ----------
    Sharp and Crane 2020, "A Laplacian for Nonmanifold Triangle Meshes", section 4.5.
    """
    mean = float(lengths.mean())
    if not mean > 0.0:
        raise MeshError("all edges have length zero: the mesh is a single point")
    slack = lengths.sum(axis=1) - 2.0 * lengths.max(axis=1)
    return lengths + max(0.0, relative_margin * mean - float(slack.min()))


def doubled_areas(lengths: Floats) -> Floats:
    """Twice the area of each triangle by Kahan's stable form of Heron's formula; (m,)."""
    ordered = np.sort(lengths, axis=1)
    c, b, a = ordered.T
    product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))
    return np.asarray(0.5 * np.sqrt(np.maximum(product, 0.0)))


def areas(lengths: Floats) -> Floats:
    """Area of each triangle; (m,)."""
    return 0.5 * doubled_areas(lengths)


def _doubled_dots(lengths: Floats) -> Floats:
    """Twice the dot product of the two edge vectors that leave each corner; (m, 3)."""
    squared = lengths**2
    return squared + np.roll(squared, 1, axis=1) - np.roll(squared, -1, axis=1)


def corner_angles(lengths: Floats) -> Floats:
    """Interior angle at corner k (between halfedges k and k - 1), radians; (m, 3)."""
    return np.asarray(np.arctan2(2.0 * doubled_areas(lengths)[:, None], _doubled_dots(lengths)))


def cotangents(lengths: Floats) -> Floats:
    """Cotangent of the angle at corner k; (m, 3). The triangles must not be degenerate."""
    return _doubled_dots(lengths) / (2.0 * doubled_areas(lengths)[:, None])
