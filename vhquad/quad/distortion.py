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

from vhquad.mesh.vectors import cross, unit
from vhquad.quad.corners import (
    Sides,
    ahead,
    behind,
    cross_rows,
    dot,
    gathered,
    shapes,
    sides_of,
    unit_rows,
)

__all__ = [
    "SHARP",
    "Distortion",
    "barrier",
    "barrier_width",
    "corner_jacobians",
    "directions",
    "distortion",
    "inverted_quads",
    "misalignment",
    "quad_normals",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SHARP = 1e-3  # the least barrier width


def quad_normals(vertices: Floats, quads: Ints, sides: Sides | None = None) -> Floats:
    """Unit average normal of each quad (of its vector area); (k, 3), zero where that is zero.

    Here and below ``sides`` are those of the quads, where they are known already.
    """
    p = (sides or sides_of(vertices, quads)).corner
    normal = cross_rows(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    return np.ascontiguousarray(unit_rows(normal).T)


def corner_jacobians(vertices: Floats, quads: Ints, normals: Floats) -> Floats:
    """Scaled Jacobian at each corner against given quad normals; (k, 4), 0 at empty edges."""
    forward = sides_of(vertices, quads).side
    area = dot(cross_rows(forward, -behind(forward)), normals.T[:, None])
    length = np.sqrt(dot(forward, forward))
    scale = length * behind(length)
    return np.divide(area, scale, out=np.zeros_like(area), where=scale > 0).T


def inverted_quads(sides: Sides, normals: Floats) -> NDArray[np.bool_]:
    """Quads with a scaled Jacobian of 0 or less against given normals, at less cost; (k,)."""
    area = dot(cross_rows(sides.side, -behind(sides.side)), normals.T[:, None])
    return np.asarray((area <= 0).any(axis=0))


def barrier(d: Floats, epsilon: float) -> tuple[Floats, Floats]:
    """√(D² + ε²) and χ(D), elementwise."""
    root = np.sqrt(d * d + epsilon * epsilon)
    if (d > 0).all():
        return root, 0.5 * (d + root)
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
    sides: Sides | None = None,
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
    e1 = (sides or sides_of(vertices, quads)).side / shape
    e2 = behind(e1)
    np.negative(e2, out=e2)
    n = np.ascontiguousarray(normals.T)[:, None]
    per_area = 1.0 / size**2
    d = dot(cross_rows(e1, e2), n)
    d *= per_area
    squared = dot(e1, e1)
    stretch = 0.5 * (squared + behind(squared)) * per_area
    root, chi = barrier(d, epsilon)
    cost = (stretch + 0.5 * size_weight * (d * d + 1.0)) / chi
    if not with_gradient:
        return Distortion(float(cost.sum()), np.zeros((0, 3)), d.T)
    by_stretch = per_area / chi
    by_area = (size_weight * d / chi - cost / root) * per_area
    g1, g2 = cross_rows(e2, n), cross_rows(n, e1)  # in place from here on: these arrays are long
    g1 *= by_area
    g2 *= by_area
    e1 *= by_stretch
    e2 *= by_stretch
    g1 += e1
    g2 += e2
    g1 /= shape
    g2 /= behind(shape)
    g = behind(g1)
    g += ahead(g2)
    g -= g1
    g -= g2
    return Distortion(float(cost.sum()), gathered(g, quads, len(vertices)), d.T)


def directions(normals: Floats, along: Floats, weight: Floats | None = None) -> Floats:
    """What :func:`misalignment` asks of edges: the direction that each should not have; (3, 4, k).

    Parameters
    ----------
    normals : (k, 3) float64
        Unit reference normal of each quad.
    along : (k, 3) float64
        Unit direction for edges 0 and 2 of each quad, either way; edges 1 and 3 should run at a
        right angle to it. Zero where any direction will do.
    weight : (k,) float64, optional
        Of each direction; the vectors are as long as its root. Default: 1.
    """
    first = unit(along - np.einsum("ki,ki->k", along, normals)[:, None] * normals)
    if weight is not None:
        first *= np.sqrt(weight)[:, None]
    second = cross(normals, first)
    return np.stack([second.T, first.T, second.T, first.T], axis=1)


def misalignment(
    vertices: Floats,
    quads: Ints,
    across: Floats,
    size: Floats,
    with_gradient: bool = True,
    aspect: Floats | None = None,
    sides: Sides | None = None,
) -> tuple[float, Floats]:
    """How far edges run off given directions: half the squared share of each edge across, by s².

    Parameters
    ----------
    vertices, quads, size, with_gradient, aspect, sides
        As in :func:`distortion`.
    across : (3, 4, k) float64
        Of :func:`directions`.

    Returns
    -------
    energy : float
    gradient : (n, 3) float64
    """
    length = size * shapes(aspect, len(quads))
    share = dot((sides or sides_of(vertices, quads)).side, across) / length
    energy = 0.5 * float((share**2).sum())
    if not with_gradient:
        return energy, np.zeros((0, 3))
    share /= length
    g = share * across
    pull = behind(g)
    pull -= g
    return energy, gathered(pull, quads, len(vertices))
