"""The last folds of a quad mesh, taken out by vertices that may leave the surface a little.

Where a tube is thinner than its quads, or a wrinkle narrower, quads with all four corners on the
surface may have to fold. A patch around them is laid out anew in space: squares are fitted to its
quads and solved for all at once (local/global, Bouaziz et al. 2012), which needs no surface normals
and opens any crumple; then the barrier energy of :mod:`vhquad.quad.distortion` makes every corner
convex. Both are drawn to the nearest point of the surface that faces as the quads do.

Reference: S. Bouaziz et al., Shape-Up: Shaping Discrete Geometry with Projections, 2012.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, diags_array

from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.facing import FacingPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import flipped_quads, scaled_jacobians, without_area
from vhquad.mesh.rings import separate_parts, within_rings
from vhquad.mesh.vectors import unit
from vhquad.quad.distortion import SHARP, barrier_width, distortion, quad_normals

__all__ = ["lifted", "rim_vertices", "wrong_quads"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

TRIES = (
    (3.0, 1),
    (3.0, 2),
    (3.0, 3),
    (1.0, 2),
    (1.0, 3),
    (0.3, 2),
    (0.3, 3),
    (0.1, 3),
    (0.03, 4),
)  # pull of the surface, as a share of that of the squares, and rings around wrong quads
SQUARE_STEPS = 40
FREE_STEPS, ANCHOR_EVERY = 8, 4  # steps before the first look for the surface, and between looks
BARRIER_ROUNDS, BARRIER_STEPS = 8, 40
SIZE_WEIGHT = 0.3
SQUARE_RANGE = (0.2, 2.0)  # of the wanted size, for the squares
LEAST_SIZE = 0.5  # of the median in a patch


def wrong_quads(vertices: Floats, quads: Ints, surface: ClosestPoints) -> Bools:
    """Quads that a check would call folded, without area, or turned against the surface; (k,)."""
    mesh = QuadMesh(vertices, quads)
    wrong = (scaled_jacobians(mesh) <= 0).any(axis=1) | without_area(mesh)
    wrong[flipped_quads(mesh, surface)] = True
    return wrong


def lifted(
    vertices: Floats, quads: Ints, surface: ClosestPoints, held: Bools
) -> tuple[Floats, Bools]:
    """Vertices with fewer wrong quads, or as they were; those of patches leave the surface.

    Parameters
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
    surface : ClosestPoints
    held : (n,) bool
        Vertices that keep their places (on creases and boundaries). The inner ones of quads that
        stay wrong are let go in the end, those on the boundary of the quads never.

    Returns
    -------
    vertices : (n, 3) float64
    wrong : (k,) bool
        The quads that stay wrong.
    """
    x, wrong = _without_wrong(vertices, quads, surface, held)
    if not (wrong.any() and held.any()):
        return x, wrong
    let_go = np.zeros(len(x), dtype=bool)
    let_go[quads[wrong]] = True
    let_go[rim_vertices(quads)] = False
    return _without_wrong(x, quads, surface, held & ~let_go)


def rim_vertices(quads: Ints) -> Ints:
    """Vertices on edges of one quad."""
    edge = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(edge, axis=0, return_counts=True)
    return np.unique(edges[count == 1])


def _without_wrong(
    x: Floats, quads: Ints, surface: ClosestPoints, held: Bools
) -> tuple[Floats, Bools]:
    """Patches around wrong quads laid out anew, drawn less to the surface and wider each time.

    And which quads are wrong still.
    """
    wrong = wrong_quads(x, quads, surface)
    for pull, rings in TRIES:
        if not wrong.any():
            break
        for inside in separate_parts(quads, within_rings(quads, wrong, rings)):  # few
            x = _relaid(x, quads, inside, surface, held, pull)
        wrong = wrong_quads(x, quads, surface)
    return x, wrong


@dataclass(frozen=True, eq=False)
class _Patch:
    """Some quads by themselves, their free vertices and how strongly the surface draws these."""

    quads: Ints  # (k, 4) local vertices
    free: Ints  # local vertices that move
    size: Floats  # (k,) wanted edge length
    pull: Floats  # (f,)
    near: FacingPoints

    def anchors(self, x: Floats) -> Floats:
        """Where the surface is for each free vertex; (f, 3)."""
        own = np.repeat(quad_normals(x, self.quads), 4, axis=0)
        index = self.quads.reshape(-1)
        total = [np.bincount(index, own[:, i], len(x)) for i in range(3)]
        return self.near.query(x[self.free], unit(np.stack(total, axis=1))[self.free])


def _relaid(
    x: Floats, quads: Ints, inside: Ints, surface: ClosestPoints, held: Bools, pull: float
) -> Floats:
    """Positions with one patch laid out anew, if that leaves fewer wrong quads."""
    moving = np.zeros(len(x), dtype=bool)
    moving[quads[inside]] = True
    moving[np.delete(quads, inside, axis=0)] = False
    moving &= ~held
    used, local = np.unique(quads[inside], return_inverse=True)
    part, start = local.reshape(-1, 4), x[used]
    free = np.flatnonzero(moving[used])
    if not free.size:
        return x
    p = start[part]
    edge = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2).mean(axis=1)
    size = np.asarray(np.maximum(edge, LEAST_SIZE * np.median(edge)), dtype=np.float64)
    weight = np.bincount(part.reshape(-1), np.repeat(1.0 / size**2, 4), len(used))
    near = FacingPoints(surface.mesh, start)
    patch = _Patch(part, free, size, np.asarray(pull * weight[free], dtype=np.float64), near)
    best, least = start, int(wrong_quads(start, part, surface).sum())
    squared = _squared(patch, start)
    for made in (squared, _convex(patch, squared)):
        wrong = int(wrong_quads(made, part, surface).sum())
        if wrong < least:
            best, least = made, wrong
    out = x.copy()
    out[used] = best
    return out


def _squared(patch: _Patch, x: Floats) -> Floats:
    """Every quad near its own best-fitting square in space."""
    quads, free = patch.quads, patch.free
    k = len(quads)
    row = np.repeat(np.arange(4 * k), 4)
    column = np.repeat(quads, 4, axis=0).reshape(-1)
    entry = (np.eye(4) - 0.25)[None] / patch.size[:, None, None]  # corners less their middle
    offsets = coo_matrix((entry.reshape(-1), (row, column)), (4 * k, len(x))).tocsr()
    moving = offsets[:, free]
    factor = SymmetricFactor((moving.T @ moving + diags_array(patch.pull)).tocsr())
    rest = x.copy()
    rest[free] = 0.0
    base = offsets @ rest
    low, high = (share * patch.size / np.sqrt(2.0) for share in SQUARE_RANGE)
    anchor, x = x[free], x.copy()
    for step in range(SQUARE_STEPS):
        if step >= FREE_STEPS and step % ANCHOR_EVERY == 0:
            anchor = patch.anchors(x)
        p = x[quads]
        # Half the diagonals of a square are orthogonal and as long as each other.
        half = 0.5 * np.stack([p[:, 0] - p[:, 2], p[:, 1] - p[:, 3]], axis=2)
        left, length, right = np.linalg.svd(half, full_matrices=False)
        side = np.clip(length.mean(axis=1), low, high) / patch.size
        a, b = np.moveaxis((left @ right) * side[:, None, None], 2, 0)
        wanted = np.stack([a, b, -a, -b], axis=1).reshape(-1, 3)
        x[free] = factor.solve(moving.T @ (wanted - base) + patch.pull[:, None] * anchor)
    return x


def _convex(patch: _Patch, x: Floats) -> Floats:
    """Corners pushed to be convex about their quads' own normals."""
    from scipy.optimize import fmin_l_bfgs_b  # 0.1 s to import, and seldom needed

    x = x.copy()
    for _ in range(BARRIER_ROUNDS):
        normals = quad_normals(x, patch.quads)
        least = distortion(x, patch.quads, normals, patch.size, SHARP, SIZE_WEIGHT, False).area
        epsilon = barrier_width(float(least.min()))
        given = (patch, x.copy(), patch.anchors(x), normals, epsilon)
        start = x[patch.free].ravel()
        found = fmin_l_bfgs_b(_barrier_cost, start, args=given, maxiter=BARRIER_STEPS)[0]
        x[patch.free] = np.asarray(found).reshape(-1, 3)
    return x


def _barrier_cost(
    place: Floats, patch: _Patch, x: Floats, anchor: Floats, normals: Floats, epsilon: float
) -> tuple[float, Floats]:
    """Barrier energy and pull of the surface, with gradient, of places of the free vertices."""
    x[patch.free] = place.reshape(-1, 3)
    at = distortion(x, patch.quads, normals, patch.size, epsilon, SIZE_WEIGHT)
    off = x[patch.free] - anchor
    pull = patch.pull[:, None] * off
    return at.energy + 0.5 * float((pull * off).sum()), (at.gradient[patch.free] + pull).ravel()
