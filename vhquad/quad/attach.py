"""Edges attached to creases that the layout does not follow.

A layout leaves out creases that run into each other at a narrow angle or are short; the polish does
not see these, and edges that run beside such a crease may as well run on it. So points along it
pull at the nearest edges that run its way, within patches of quads. What would be poor quads then
stays as it was.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import least_jacobians
from vhquad.mesh.rings import separate_parts, within_rings
from vhquad.mesh.vectors import nearest_share, unit
from vhquad.quad.aspects import smoothed_aspects
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.descent import descend, laplacian_factor
from vhquad.quad.lift import wrong_quads
from vhquad.quad.sliding import Guidance, Problem, Pulls, make_problem, measure, place
from vhquad.quad.smooth import smoothed_sizes

__all__ = ["attach_to_creases"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Lengths are in mean edges of the quads.
SPACING = 0.1  # between points of a crease
OFF = 0.03  # farther from any edge than this, a point pulls
REACH = 0.9  # at an edge no farther than this
ALONG = 0.8  # least cosine between crease and edge
PULL = 300.0  # weight of a point's distance, against the shapes of quads
RINGS = 2  # of quads around the edges that are pulled, which follow
ROUNDS = 6  # of finding the nearest edges and pulling at them
ITERATIONS = 12
TRIES = 6  # while some quads come out poor
POOR = 0.1  # scaled Jacobian that no quad may fall below, if it has not already
NEIGHBOURS = 16  # edges that are looked at for a point


@dataclass(frozen=True, eq=False)
class _Points:
    """Points along creases, and the unit direction of the crease at each; (p, 3)."""

    at: Floats
    along: Floats

    def __getitem__(self, which: Bools) -> _Points:
        return _Points(self.at[which], self.along[which])


def attach_to_creases(
    vertices: Floats,
    quads: Ints,
    surface: ClosestPoints,
    fixed: Bools,
    curves: CurveConstraints,
    creases: Floats,
) -> Floats:
    """Move vertices over the surface until edges run along creases that none runs along.

    Parameters
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
        Corners of a manifold mesh.
    surface : ClosestPoints
        To stay on.
    fixed : (n,) bool
        Vertices that stay where they are.
    curves : CurveConstraints
        Creases and borders that the layout follows. Vertices on them stay as well.
    creases : (c, 2, 3) float64
        Ends of the crease edges of the surface, those that are followed as well.

    Returns
    -------
    (n, 3) float64
        Positions; no quad is folded, turned against the surface, or poorer than `POOR`, that was
        not before.
    """
    if len(creases) == 0:
        return vertices
    size = smoothed_sizes(vertices, quads, surface.mesh.area)
    length = float(np.sqrt((size**2).mean()))
    edges = QuadMesh(vertices, quads).edges
    points = _sampled(creases, SPACING * length)
    points = points[_nearest(vertices, edges, points.at)[2] > OFF * length]
    points = points[_distance_from(curves, points.at, OFF * length) > OFF * length]
    held = fixed | (curves.curve >= 0)
    edges = edges[~held[edges].all(axis=1)]
    if len(points.at) == 0 or len(edges) == 0:
        return vertices
    nearest, _, gap = _nearest(vertices, edges, points.at, points.along)
    near = gap < REACH * length
    pulled = np.zeros(len(vertices), dtype=bool)
    pulled[edges[nearest[near]]] = True
    x, aspect = vertices.copy(), smoothed_aspects(vertices, quads)
    touched = np.asarray(pulled[quads].any(axis=1))
    for inside in separate_parts(quads, within_rings(quads, touched, RINGS)):
        still = held.copy()
        still[np.delete(quads, inside, axis=0)] = True
        inside = inside[~still[quads[inside]].all(axis=1)]
        used, local = np.unique(quads[inside], return_inverse=True)
        name = np.full(len(x), -1)
        name[used] = np.arange(len(used))
        own = name[edges]
        free = (own >= 0).all(axis=1) & ~still[edges].all(axis=1)
        mine = near & (name[edges[nearest, 0]] >= 0)
        if not (free.any() and mine.any()):
            continue
        part = make_problem(
            local.reshape(-1, 4),
            surface,
            CurveConstraints.none(len(used)),
            still[used],
            size[inside],
            replace(Guidance.none(len(inside)), aspect=aspect[inside]),
        )
        x[used] = _attached(part, x[used], own[free], points[mine], length)
    return x


def _attached(problem: Problem, x: Floats, edges: Ints, points: _Points, length: float) -> Floats:
    """Positions of the vertices of a patch after its points have pulled at its edges.

    First with all vertices free; then those of poor quads stay, whose barrier holds up all others.
    """
    x = _pulled(problem, x, edges, points, length)
    poor = least_jacobians(x, problem.quads) < POOR
    if not poor.any():
        return x
    still = problem.fixed.copy()
    still[problem.quads[poor]] = True
    return _pulled(replace(problem, fixed=still), x, edges, points, length)


def _pulled(problem: Problem, x: Floats, edges: Ints, points: _Points, length: float) -> Floats:
    """Positions after the pulls; vertices around quads that come out poor stay in the end."""
    everywhere = np.ones(len(x), dtype=bool)
    given = place(replace(problem, fixed=everywhere), x, None)
    least = np.minimum(least_jacobians(x, problem.quads), POOR)
    wrong = wrong_quads(x, problem.quads, problem.surface)
    still = problem.fixed
    for _ in range(TRIES):
        free = edges[~still[edges].all(axis=1)]
        if len(free) == 0:
            break
        part = replace(problem, fixed=still)
        factor = laplacian_factor(part)
        state = place(part, x, None)
        for _ in range(ROUNDS):
            nearest, share, gap = _nearest(state.vertices, free, points.at, points.along)
            near = gap < REACH * length
            pulls = Pulls(free[nearest[near]], share[near], points.at[near], PULL / length**2)
            pulling = replace(part, pulls=pulls)
            same = (state.vertices, state.arc, state.normals, state.face)
            state = descend(pulling, measure(pulling, *same), factor, ITERATIONS)
        worse = least_jacobians(state.vertices, problem.quads) < least
        worse |= state.folded & ~given.folded
        worse |= wrong_quads(state.vertices, problem.quads, problem.surface) & ~wrong
        if not worse.any():
            return state.vertices
        still = still.copy()
        still[problem.quads[within_rings(problem.quads, worse)]] = True
    return x


def _distance_from(curves: CurveConstraints, points: Floats, step: float) -> Floats:
    """How far points are from curves, but for half a step; infinite if there are none; (p,)."""
    if len(curves.points) == 0 or len(points) == 0:
        return np.full(len(points), np.inf)
    segments = np.stack([curves.points[:-1], curves.points[1:]], axis=1)
    segments = np.delete(segments, curves.start[1:-1] - 1, axis=0)  # from a curve to the next
    return np.asarray(cKDTree(_sampled(segments, step).at).query(points)[0])


def _sampled(segments: Floats, step: float) -> _Points:
    """Points about a step apart along segments (c, 2, 3), one on each at least."""
    start, span = segments[:, 0], segments[:, 1] - segments[:, 0]
    length = np.linalg.norm(span, axis=1)
    count = np.where(length > 0, np.maximum(np.rint(length / step), 1), 0).astype(np.int64)
    of = np.repeat(np.arange(len(count)), count)
    place = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5
    return _Points(start[of] + (place / count[of])[:, None] * span[of], unit(span)[of])


def _nearest(
    x: Floats, edges: Ints, points: Floats, along: Floats | None = None
) -> tuple[Ints, Floats, Floats]:
    """For each point the nearest edge, where on it, from 0 to 1, and how far; each (p,).

    With directions, of edges that run along them; the distance is infinite where there is none.
    """
    a, side = x[edges[:, 0]], x[edges[:, 1]] - x[edges[:, 0]]
    count = min(NEIGHBOURS, len(edges))
    near = np.asarray(cKDTree(a + 0.5 * side).query(points, k=count)[1]).reshape(-1, count)
    share = nearest_share(points[:, None], a[near], side[near])
    gap = np.linalg.norm(a[near] + share[..., None] * side[near] - points[:, None], axis=2)
    if along is not None:
        cosine = np.abs((unit(side)[near] * along[:, None]).sum(axis=2))
        gap = np.where(cosine > ALONG, gap, np.inf)
    best = gap.argmin(axis=1)
    row = np.arange(len(points))
    return near[row, best], share[row, best], gap[row, best]
