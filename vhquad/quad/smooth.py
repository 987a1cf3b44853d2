"""Polish of a quad mesh on its surface: unfold, square up, even out; curves and corners are kept.

Vertices descend a barrier energy that unfolds (:mod:`vhquad.quad.descent`); after each step they
return to the surface or slide on their curve (:mod:`vhquad.quad.sliding`). Quads still poor get
patch problems of their own; where some stay folded, vertices spread first in another attempt,
around them or, if that is most of the mesh, everywhere. At last those on curves go where edges keep
nearest to the curves (:mod:`vhquad.quad.settle`). The best state met is returned: never more folded
quads than came in.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import MeshError
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.rings import separate_parts, within_rings
from vhquad.mesh.vectors import cross
from vhquad.quad.aspects import smoothed_aspects
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.descent import better, descend, laplacian_factor, spread
from vhquad.quad.distortion import corner_jacobians
from vhquad.quad.guide import FieldGuide
from vhquad.quad.settle import settle_on_curves
from vhquad.quad.sliding import Guidance, Problem, State, make_problem, measure, place

__all__ = ["smooth_quads", "smoothed_sizes"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SPREAD_ITERATIONS = 10
POOR = 0.1  # a quad with a scaled Jacobian below this gets a patch problem of its own
FOLDED_ROUNDS = ((4, 0), (4, 5), (4, 0))  # rings around, and steps of spreading
FAR_RINGS = 12  # around quads still folded then
LOCAL = 0.5  # of the quads at most, for another attempt around these alone
POOR_ROUNDS = 2
POOR_RINGS = 4
PATCH_ITERATIONS = 40
PATIENCE = 60
SURELY = 2.0  # weight of directions of which the field is sure, of that of others
SETTLED = 0.3  # scaled Jacobian that nearness to a curve must leave a quad


def smooth_quads(
    vertices: ArrayLike,
    quads: ArrayLike,
    surface: ClosestPoints,
    fixed: ArrayLike | None = None,
    curves: CurveConstraints | None = None,
    iterations: int = 40,
    target_edge: ArrayLike | None = None,
    guide: FieldGuide | None = None,
) -> Floats:
    """Move the vertices of a quad mesh over its surface until quads are unfolded and square.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Positions, on the surface (they are put there first), possibly crowded or folded.
    quads : (k, 4) array_like of int
        Corners, counter-clockwise seen from outside; a manifold mesh.
    surface : ClosestPoints
        The surface to stay on.
    fixed : (n,) array_like of bool, optional
        Vertices that never move (corners, ends of curves).
    curves : CurveConstraints, optional
        Vertices that slide along polylines; they leave them by rounding only.
    iterations : int
        Steps on the whole mesh; patches around poor quads get more.
    target_edge : (n,) array_like, optional
        Wanted edge length near each vertex. Default: the given distribution, smoothed. Only
        ratios count, since the sizes are scaled to fill the surface.
    guide : FieldGuide, optional
        Field whose directions the edges should keep, twice as strictly where it is sure. There
        quads stay about as much longer than wide as they are: squares of the same rows would turn
        their edges off it.

    Returns
    -------
    (n, 3) float64
        New positions. Never more folded quads than before.

    Raises
    ------
    MeshError
        If shapes or indices do not fit.
    """
    x = np.array(vertices, dtype=np.float64)
    q = np.array(quads, dtype=np.int64)
    if x.ndim != 2 or x.shape[1] != 3 or q.ndim != 2 or q.shape[1] != 4:
        raise MeshError(f"vertices and quads must be (n, 3) and (k, 4), not {x.shape}, {q.shape}")
    if len(q) == 0:
        return x
    if q.min() < 0 or q.max() >= len(x):
        raise MeshError(f"quads name vertices outside 0..{len(x) - 1}")
    hold = np.zeros(len(x), dtype=bool) if fixed is None else np.array(fixed, dtype=bool)
    bound = CurveConstraints.none(len(x)) if curves is None else curves
    if hold.shape != (len(x),) or bound.curve.shape != (len(x),):
        raise MeshError("fixed and curves must have one entry a vertex")
    if target_edge is None:
        size = smoothed_sizes(x, q, surface.mesh.area)
    else:
        size = np.array(target_edge, dtype=np.float64)[q].mean(axis=1)
        size *= np.sqrt(surface.mesh.area / (size**2).sum())
    hold[np.setdiff1d(np.arange(len(x)), q)] = True
    guidance, under = Guidance.none(len(q)), np.zeros(0, dtype=np.int64)
    if guide is not None:
        under = guide.faces(x[q].mean(axis=1))
        trust = guide.trust(under)
        weight, aspect = 1.0 + (SURELY - 1.0) * trust, smoothed_aspects(x, q) ** trust
        guidance = replace(guidance, weight=weight, aspect=aspect)
    problem = make_problem(q, surface, bound, hold, size, guidance)
    start = place(problem, x, None)
    if guide is not None:
        problem, start = _guided(problem, start, guide, under)
    if hold.all() or iterations <= 0:
        return start.vertices
    factor = laplacian_factor(problem)
    state = descend(problem, start, factor, iterations // 2)
    if guide is not None:
        centres = state.vertices[q].mean(axis=1)
        problem, state = _guided(problem, state, guide, guide.faces(centres))
    state = _mended(problem, descend(problem, state, factor, iterations // 2), POOR)
    if state.folded.any():
        # Spreading opens what is crowded; not at first, since it drags quads out of thin parts.
        around = within_rings(q, state.folded, FAR_RINGS)
        if around.mean() < LOCAL:
            for patch in separate_parts(q, around):  # few
                state = _solve_patch(problem, state, patch, SPREAD_ITERATIONS, guided=True)
        else:
            other = spread(problem, start, factor, SPREAD_ITERATIONS)
            other = _mended(problem, descend(problem, other, factor, iterations, PATIENCE), POOR)
            state = other if better(other, state) else state
    state = start if better(start, state) else state
    return settle_on_curves(problem, state, SETTLED).vertices


def smoothed_sizes(vertices: Floats, quads: Ints, area: float, rounds: int = 8) -> Floats:
    """Wanted edge length of each quad: root of its area, averaged over ``rounds`` rings; (k,).

    The sizes keep the given distribution, less its detail, and add up to ``area`` as squares.
    """
    p = vertices[quads]
    diagonal = cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    value = 0.5 * np.sqrt(np.einsum("ki,ki->k", diagonal, diagonal))
    corners = quads.reshape(-1)
    count = np.maximum(np.bincount(corners, minlength=len(vertices)), 1)
    for _ in range(rounds):
        at_vertex = np.bincount(corners, np.repeat(value, 4), len(vertices)) / count
        value = at_vertex[quads].mean(axis=1)
    return np.asarray(np.sqrt(value * (area / value.sum())))


def _guided(
    problem: Problem, state: State, guide: FieldGuide, under: Ints
) -> tuple[Problem, State]:
    """The problem with the directions of the field at its faces under the quads, and its state."""
    p = state.vertices[problem.quads]
    along = guide.along(under, p[:, 1] - p[:, 0] + p[:, 2] - p[:, 3])
    problem = replace(problem, guidance=replace(problem.guidance, along=along))
    return problem, measure(problem, state.vertices, state.arc, state.normals, state.face)


def _mended(problem: Problem, state: State, least: float) -> State:
    """Solve patches around folded quads; without any, around those with Jacobians below least."""
    for rings, spreading in FOLDED_ROUNDS:
        if not state.folded.any():
            break
        around = within_rings(problem.quads, state.folded, rings)
        for patch in separate_parts(problem.quads, around):  # few
            state = _solve_patch(problem, state, patch, spreading, guided=False)
    if not state.folded.any():
        for _ in range(POOR_ROUNDS):
            jacobians = corner_jacobians(state.vertices, problem.quads, state.quad_normals)
            poor = jacobians.min(axis=1) < least
            if not poor.any():
                break
            patch = np.flatnonzero(within_rings(problem.quads, poor, POOR_RINGS))
            state = _solve_patch(problem, state, patch, 0, guided=True)
    return state


def _solve_patch(
    problem: Problem, state: State, inside: Ints, spreading: int, guided: bool
) -> State:
    """Minimise again over some quads only, their outer vertices held."""
    held = np.ones(len(problem.fixed), dtype=bool)
    held[problem.quads[inside]] = False
    held[np.delete(problem.quads, inside, axis=0)] = True
    used, local = np.unique(problem.quads[inside], return_inverse=True)
    part = make_problem(
        local.reshape(-1, 4),
        problem.surface,
        problem.curves.bind(problem.curves.curve[used]),
        (held | problem.fixed)[used],
        problem.size[inside],
        problem.guidance.of(inside) if guided else None,
    )
    if part.fixed.all():
        return state
    names = ("vertices", "arc", "normals", "face")
    start = measure(part, *(getattr(state, name)[used] for name in names))
    factor = laplacian_factor(part)
    solved = spread(part, start, factor, spreading)
    solved = descend(part, solved, factor, PATCH_ITERATIONS, PATIENCE)
    if better(start, solved):
        return state
    merged = [np.array(getattr(state, name)) for name in names]
    for whole, name in zip(merged, names, strict=True):
        whole[used] = getattr(solved, name)
    return measure(problem, *merged)
