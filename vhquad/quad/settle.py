"""The last step of the polish: vertices on curves go where edges fit the curves, others follow.

The energy of the polish squares quads up and does not see how far their edges are from a crease or
border. :mod:`vhquad.quad.chords` does; where what it asks for folds quads or makes poor ones, the
vertices around them stay where they were.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.rings import within_rings
from vhquad.quad.chords import fit_chords
from vhquad.quad.descent import descend, laplacian_factor
from vhquad.quad.distortion import corner_jacobians
from vhquad.quad.sliding import Problem, State, measure, smooth_normals

__all__ = ["settle_on_curves"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ROUNDS = 5  # while some quads come out worse
ITERATIONS = 15  # of the vertices that follow
RINGS = 2  # of quads around a bad one, whose vertices stay; around a moved vertex, that follow
MOVED = 0.02  # of the wanted edge length: a move that others follow


def settle_on_curves(problem: Problem, state: State, least: float) -> State:
    """Move the vertices that slide on curves to where their edges are nearest to these.

    Parameters
    ----------
    problem : Problem
    state : State
        Polished.
    least : float
        Scaled Jacobian that no quad may fall below, if it has not already.

    Returns
    -------
    State
        The given one if nothing can move.
    """
    line = problem.on_curve
    before = _jacobians(problem, state)
    held = problem.fixed.copy()
    for _ in range(ROUNDS):
        if held[line].all():
            break
        arc = state.arc.copy()
        arc[line] = fit_chords(problem.curves, line, arc[line], ~held[line])
        found = _followed(problem, state, arc, held)
        worse = _jacobians(problem, found) < np.minimum(before, least)
        worse |= found.folded & ~state.folded
        if not worse.any():
            return found
        held[problem.quads[within_rings(problem.quads, worse, RINGS)]] = True
    return state


def _followed(problem: Problem, state: State, arc: Floats, held: Bools) -> State:
    """The state with vertices on curves at arc lengths; others that are not held descend."""
    line = problem.on_curve
    x = state.vertices.copy()
    x[line] = problem.curves.position(line, arc[line])
    there = problem.surface.query(x[line])
    # The others keep what they know of the sheet of the surface that they are on.
    face, normals = state.face.copy(), state.normals.copy()
    face[line], normals[line] = there.face, smooth_normals(problem, there)
    moved = np.linalg.norm(x - state.vertices, axis=1) > MOVED * problem.reach
    near = np.zeros(len(x), dtype=bool)
    near[problem.quads[within_rings(problem.quads, moved[problem.quads].any(axis=1), RINGS)]] = True
    still = held | ~near
    still[line] = True
    part = replace(problem, fixed=still, on_curve=line[:0])
    found = measure(part, x, arc, normals, face)
    if not still.all():
        found = descend(part, found, laplacian_factor(part), ITERATIONS)
    return measure(problem, found.vertices, arc, found.normals, found.face)


def _jacobians(problem: Problem, state: State) -> Floats:
    """Least scaled Jacobian of each quad; (k,)."""
    corners = corner_jacobians(state.vertices, problem.quads, state.quad_normals)
    return np.asarray(corners.min(axis=1))
