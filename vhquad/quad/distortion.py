"""The barrier energy that squares up quads and unfolds folded ones (Garanzha et al. 2021).

Corner k of a quad spans a parallelogram with edges e1 (to the next corner) and e2 (to the
previous one). With s the wanted edge length, n the quad's unit normal, F = (|e1|² + |e2|²)/2s² and
D = n·(e1 × e2)/s², the corner costs

    (F + λ (D² + 1)/2) / χ(D),        χ(D) = (D + √(D² + ε²))/2,

least at a square of side s; the λ share holds the size, the rest the angles. χ is a smooth positive
part (χ' = χ/√(D² + ε²)): folded corners (D ≤ 0) stay finite, and dear, until ε goes to 0.

Reference: V. Garanzha et al., Foldover-free maps in 50 lines of code, 2021, section 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "SHARP",
    "Distortion",
    "barrier",
    "barrier_width",
    "corner_jacobians",
    "cross",
    "distortion",
    "last_corner",
    "misalignment",
    "next_corner",
    "quad_normals",
    "shapes",
    "unit",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SHARP = 1e-3  # the least barrier width


def unit(a: Floats) -> Floats:
    """Vectors scaled to length 1; zero ones stay zero."""
    length = np.sqrt(np.einsum("...i,...i->...", a, a))[..., None]
    return np.asarray(a / np.maximum(length, 1e-300))


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products along the last axis, several times faster than ``np.cross``."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[..., j], b[..., k], out=out[..., i])
        out[..., i] -= a[..., k] * b[..., j]
    return out


def next_corner(a: Floats) -> Floats:
    """What the next corner of each quad has, (k, 4, ...): ``a[:, [1, 2, 3, 0]]``, but faster."""
    out = np.empty_like(a)
    out[:, :3], out[:, 3] = a[:, 1:], a[:, 0]
    return out


def last_corner(a: Floats) -> Floats:
    """What the corner before has: ``a[:, [3, 0, 1, 2]]``."""
    out = np.empty_like(a)
    out[:, 1:], out[:, 0] = a[:, :3], a[:, 3]
    return out


def quad_normals(vertices: Floats, quads: Ints) -> Floats:
    """Unit average normal of each quad (of its vector area); (k, 3), zero where that is zero."""
    p = _corners(vertices, quads)
    normal = _cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    return np.ascontiguousarray((normal / np.maximum(np.sqrt(_dot(normal, normal)), 1e-300)).T)


def corner_jacobians(vertices: Floats, quads: Ints, normals: Floats) -> Floats:
    """Scaled Jacobian at each corner against given quad normals; (k, 4), 0 at empty edges."""
    p = _corners(vertices, quads)
    forward = _ahead(p) - p
    area = _dot(_cross(forward, -_behind(forward)), normals.T[:, None])
    length = np.sqrt(_dot(forward, forward))
    scale = length * _behind(length)
    return np.divide(area, scale, out=np.zeros_like(area), where=scale > 0).T


def barrier(d: Floats, epsilon: float) -> tuple[Floats, Floats]:
    """√(D² + ε²) and χ(D), elementwise."""
    root = np.sqrt(d * d + epsilon * epsilon)
    # For D < 0 the second form has no cancellation.
    return root, np.where(d > 0, 0.5 * (d + root), 0.5 * epsilon**2 / (root + np.abs(d)))


def barrier_width(least: float) -> float:
    """ε for a least D: wide while corners are folded, then almost sharp."""
    return SHARP if least > 0.02 else min(0.3, max(SHARP, 0.16 * float(np.sqrt(max(-least, 0.0)))))


@dataclass(frozen=True, eq=False)
class Distortion:
    """Energy (sum over corners), its gradient (n, 3) and the signed corner areas D (k, 4)."""

    energy: float
    gradient: Floats
    area: Floats


def distortion(
    vertices: Floats,
    quads: Ints,
    normals: Floats,
    size: Floats,
    epsilon: float,
    size_weight: float,
    with_gradient: bool = True,
    aspect: Floats | None = None,
) -> Distortion:
    """Evaluate the energy of the module's head.

    Parameters
    ----------
    vertices : (n, 3) float64
        Positions.
    quads : (k, 4) int64
        Corners, counter-clockwise about the normal.
    normals : (k, 3) float64
        Unit reference normal of each quad, held fixed in the gradient.
    size : (k,) float64
        Wanted edge length s of each quad.
    epsilon, size_weight : float
        ε > 0 and λ >= 0.
    with_gradient : bool
        Without it the gradient is left empty, at half the time.
    aspect : (k,) float64, optional
        Wanted length of edges 0 and 2 over that of edges 1 and 3. Default: 1, squares.
    """
    shape = shapes(aspect, len(quads))
    p = _corners(vertices, quads)
    e1 = (_ahead(p) - p) / shape
    e2 = -_behind(e1)
    n = np.ascontiguousarray(normals.T)[:, None]
    per_area = 1.0 / size**2
    d = _dot(_cross(e1, e2), n) * per_area
    squared = _dot(e1, e1)
    stretch = 0.5 * (squared + _behind(squared)) * per_area
    root, chi = barrier(d, epsilon)
    cost = (stretch + 0.5 * size_weight * (d * d + 1.0)) / chi
    if not with_gradient:
        return Distortion(float(cost.sum()), np.zeros((0, 3)), d.T)
    by_stretch = per_area / chi
    by_area = (size_weight * d / chi - cost / root) * per_area
    g1 = by_stretch * e1 + by_area * _cross(e2, n)
    g2 = by_stretch * e2 + by_area * _cross(n, e1)
    g1 /= shape
    g2 /= _behind(shape)
    g = _behind(g1) + _ahead(g2) - g1 - g2
    return Distortion(float(cost.sum()), _gathered(g, quads, len(vertices)), d.T)


def misalignment(
    vertices: Floats,
    quads: Ints,
    normals: Floats,
    size: Floats,
    along: Floats,
    with_gradient: bool = True,
    aspect: Floats | None = None,
) -> tuple[float, Floats]:
    """How far edges run off given directions: half the squared share of each edge across, by s².

    Parameters
    ----------
    vertices, quads, normals, size, with_gradient, aspect
        As in :func:`distortion`.
    along : (k, 3) float64
        Unit direction for edges 0 and 2 of each quad, either way; edges 1 and 3 should run at a
        right angle to it. Zero where any direction will do.

    Returns
    -------
    energy : float
    gradient : (n, 3) float64
    """
    first = unit(along - np.einsum("ki,ki->k", along, normals)[:, None] * normals)
    second = cross(normals, first)
    across = np.stack([second.T, first.T, second.T, first.T], axis=1)
    p = _corners(vertices, quads)
    length = size * shapes(aspect, len(quads))
    share = _dot(_ahead(p) - p, across) / length
    energy = 0.5 * float((share**2).sum())
    if not with_gradient:
        return energy, np.zeros((0, 3))
    g = share / length * across
    return energy, _gathered(_behind(g) - g, quads, len(vertices))


# Below, coordinates come first and quads last: arithmetic runs over long rows, twice as fast.


def _corners(vertices: Floats, quads: Ints) -> Floats:
    """Coordinates of the corners of quads; (3, 4, k)."""
    return np.ascontiguousarray(vertices.T)[:, quads.T]


def _dot(a: Floats, b: Floats) -> Floats:
    """Dot products along the first axis."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross products along the first axis."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=out[i])
        out[i] -= a[k] * b[j]
    return out


def _ahead(a: Floats) -> Floats:
    """What the next corner of each quad has; (..., 4, k)."""
    out = np.empty_like(a)
    out[..., :3, :], out[..., 3, :] = a[..., 1:, :], a[..., 0, :]
    return out


def _behind(a: Floats) -> Floats:
    """What the corner before has; (..., 4, k)."""
    out = np.empty_like(a)
    out[..., 1:, :], out[..., 0, :] = a[..., :3, :], a[..., 3, :]
    return out


def shapes(aspect: Floats | None, n_quads: int) -> Floats:
    """Wanted lengths of the four edges of each quad, of the root of its area; (4, k)."""
    root = np.ones(n_quads) if aspect is None else np.sqrt(aspect)
    return np.stack([root, 1.0 / root, root, 1.0 / root])


def _gathered(corners: Floats, quads: Ints, n: int) -> Floats:
    """Sum of vectors (3, 4, k) at the corners of quads over each vertex; (n, 3)."""
    index = quads.T.reshape(-1)
    return np.stack([np.bincount(index, c.reshape(-1), n) for c in corners], axis=1)
