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
    p = vertices[quads]
    return unit(cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]))


def corner_jacobians(vertices: Floats, quads: Ints, normals: Floats) -> Floats:
    """Scaled Jacobian at each corner against given quad normals; (k, 4), 0 at empty edges."""
    p = vertices[quads]
    forward = next_corner(p) - p
    backward = last_corner(p) - p
    area = np.einsum("kci,ki->kc", cross(forward, backward), normals)
    length = np.sqrt(np.einsum("kci,kci->kc", forward, forward))
    scale = length * last_corner(length)
    return np.divide(area, scale, out=np.zeros_like(area), where=scale > 0)


def barrier(d: Floats, epsilon: float) -> tuple[Floats, Floats]:
    """√(D² + ε²) and χ(D), elementwise."""
    root = np.sqrt(d * d + epsilon * epsilon)
    # For D < 0 the second form has no cancellation.
    return root, np.where(d > 0, 0.5 * (d + root), 0.5 * epsilon**2 / (root + np.abs(d)))


def barrier_width(least: float) -> float:
    """ε for a least D: wide while corners are folded, then almost sharp."""
    return 1e-3 if least > 0.02 else min(0.3, max(1e-3, 0.16 * float(np.sqrt(max(-least, 0.0)))))


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
    p = vertices[quads]
    e1 = (next_corner(p) - p) / shape
    e2 = -last_corner(e1)
    n = normals[:, None, :]
    per_area = (1.0 / size**2)[:, None]
    d = np.einsum("kci,ki->kc", cross(e1, e2), normals) * per_area
    squared = np.einsum("kci,kci->kc", e1, e1)
    stretch = 0.5 * (squared + last_corner(squared)) * per_area
    root, chi = barrier(d, epsilon)
    cost = (stretch + 0.5 * size_weight * (d * d + 1.0)) / chi
    if not with_gradient:
        return Distortion(float(cost.sum()), np.zeros((0, 3)), d)
    by_stretch = (per_area / chi)[..., None]
    by_area = (size_weight * d / chi - cost / root)[..., None] * per_area[..., None]
    g1 = by_stretch * e1 + by_area * cross(e2, n)
    g2 = by_stretch * e2 + by_area * cross(n, e1)
    g1 /= shape
    g2 /= last_corner(shape)
    g = last_corner(g1) + next_corner(g2) - g1 - g2
    return Distortion(float(cost.sum()), _gathered(g, quads, len(vertices)), d)


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
    across = np.stack([second, first, second, first], axis=1)
    p = vertices[quads]
    length = size[:, None] * shapes(aspect, len(quads))[..., 0]
    share = np.einsum("kci,kci->kc", next_corner(p) - p, across) / length
    energy = 0.5 * float((share**2).sum())
    if not with_gradient:
        return energy, np.zeros((0, 3))
    g = (share / length)[..., None] * across
    return energy, _gathered(last_corner(g) - g, quads, len(vertices))


def shapes(aspect: Floats | None, n_quads: int) -> Floats:
    """Wanted lengths of the four edges of each quad, of the root of its area; (k, 4, 1)."""
    root = np.ones(n_quads) if aspect is None else np.sqrt(aspect)
    return np.stack([root, 1.0 / root, root, 1.0 / root], axis=1)[..., None]


def _gathered(corners: Floats, quads: Ints, n: int) -> Floats:
    """Sum of vectors at the corners of quads over each vertex; (n, 3)."""
    index = quads.reshape(-1)
    total = [np.bincount(index, corners[..., i].reshape(-1), n) for i in range(3)]
    return np.stack(total, axis=1)
