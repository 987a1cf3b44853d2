"""Vertices of curved creases moved a little off them, so that the edges between straddle these.

An edge with both ends on a curve lies on one side of it. With its ends two thirds of its sag off on
the other side, and its middle a third, it is nearest to the curve on the whole: that is what the L2
projection of the curve onto continuous, piecewise linear functions of its arc length makes. Borders
stay exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quality import least_jacobians
from vhquad.mesh.vectors import nearest_share
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.lift import rim_vertices, wrong_quads

__all__ = ["straddled"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAMPLES = 16  # of the curve over each edge
POOR = 0.1  # scaled Jacobian that no quad may fall below, if it has not already


def straddled(
    vertices: Floats, quads: Ints, surface: ClosestPoints, curves: CurveConstraints
) -> Floats:
    """Positions from which edges are nearest to the creases that they run along.

    Parameters
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
    surface : ClosestPoints
    curves : CurveConstraints
        Those on curves move, but for borders; the ends of open curves stay.

    Returns
    -------
    (n, 3) float64
        A crease whose edges would not be nearer on average, or that would make quads poor or turn
        them against the surface, keeps its vertices.
    """
    on = np.flatnonzero(curves.curve >= 0)
    if len(on) == 0:
        return vertices
    arc = curves.locate(on, vertices[on])
    border = np.unique(curves.curve[rim_vertices(quads)])
    before = least_jacobians(vertices, quads)
    out = vertices.copy()
    for c in np.setdiff1d(np.unique(curves.curve[on]), border):  # few
        own = on[curves.curve[on] == c]
        s = arc[curves.curve[on] == c]
        order = np.argsort(s, kind="stable")
        moved = _projected(curves, own[order], s[order])
        if moved is None:
            continue
        trial = out.copy()
        trial[own[order]] = moved
        around = np.isin(quads, own).any(axis=1)
        beside = quads[around]
        poorer = least_jacobians(trial, beside) < np.minimum(before[around], POOR)
        turned = wrong_quads(trial, beside, surface) & ~wrong_quads(out, beside, surface)
        if not (poorer | turned).any():
            out = trial
    return out


def _projected(curves: CurveConstraints, own: Ints, s: Floats) -> Floats | None:
    """Positions of a curve's vertices at rising arc lengths; None if where they are is better."""
    c = int(curves.curve[own[0]])
    low, high = curves.arc[curves.start[c]], curves.arc[curves.start[c + 1] - 1]
    closed = bool(curves.closed[c])
    knots = np.append(s, s[0] + high - low) if closed else np.concatenate([[low], s, [high]])
    step = np.diff(knots)
    if len(own) < 3 or not (step > 0).all():
        return None
    n = len(step)
    left = np.arange(n)
    right = (left + 1) % n if closed else left + 1
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    place = knots[:-1, None] + share * step[:, None]
    point = curves.position(np.full(place.size, own[0]), place.reshape(-1)).reshape(n, SAMPLES, 3)
    knot = curves.position(np.full(n + 1, own[0]), knots)
    size = n if closed else n + 1
    right_side = np.zeros((size, 3))
    for ends, hat in ((left, 1.0 - share), (right, share)):
        np.add.at(right_side, ends, step[:, None] * np.einsum("nsi,s->ni", point, hat) / SAMPLES)
    rows = np.concatenate([left, right, left, right])
    columns = np.concatenate([left, right, right, left])
    mass = np.concatenate([step / 3, step / 3, step / 6, step / 6])
    matrix = coo_matrix((mass, (rows, columns)), (size, size)).tocsr()
    solved = knot[:size].copy()
    free = np.arange(size) if closed else np.arange(1, size - 1)
    rest = np.setdiff1d(np.arange(size), free)
    right_side -= matrix[:, rest] @ solved[rest]
    solved[free] = SymmetricFactor(matrix[free][:, free]).solve(right_side[free])
    if _off(point, solved[left], solved[right]) >= _off(point, knot[left], knot[right % size]):
        return None
    return solved if closed else solved[1:-1]


def _off(points: Floats, a: Floats, b: Floats) -> float:
    """Mean distance of points (n, s, 3) from the edges of their rows, weighted by these' length."""
    side = b - a
    share = nearest_share(points, a[:, None], side[:, None])
    off = np.linalg.norm(points - a[:, None] - share[..., None] * side[:, None], axis=2)
    return float(np.average(off.mean(axis=1), weights=np.linalg.norm(side, axis=1)))
