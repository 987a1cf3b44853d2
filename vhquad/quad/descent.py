"""Minimisation of quad distortion over tangential moves: spread first, then a barrier descent.

Both steps use one factor of the quad mesh's graph Laplacian. `spread` fits a square to each quad
and solves for the edges of all squares at once (local/global, Bouaziz et al. 2012): crowded or
folded strips open over the whole neighbourhood within a few steps. `descend` minimises the
barrier energy of :mod:`vhquad.quad.distortion` by L-BFGS with the Laplacian as first guess of the
Hessian (Liu, Bouaziz & Kavan 2017).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, diags_array

from vhquad.geometry.sparse import SymmetricFactor
from vhquad.quad.corners import ahead, behind, corners, cross_rows, dot, gathered, shapes, unit_rows
from vhquad.quad.distortion import SHARP, barrier_width
from vhquad.quad.sliding import (
    GUIDANCE,
    Problem,
    State,
    cost,
    place,
    reference_normals,
    tangential,
)

__all__ = ["better", "descend", "laplacian_factor", "spread"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MEMORY = 6
STALE, STALE_STEPS = 1e-4, 5  # where so many steps, free of folds, gain less, relative, it ends
SQUARE_RANGE = (0.5, 2.0)  # of the wanted size, for the squares of `spread`


@dataclass(frozen=True, eq=False)
class _Change:
    """A step of the descent and how the gradient changed with it, both (n, 3)."""

    step: Floats
    change: Floats
    product: float  # of the two


def better(a: State, b: State) -> bool:
    """Whether a has fewer folded quads than b, or as many and less energy."""
    return (int(a.folded.sum()), a.energy) < (int(b.folded.sum()), b.energy)


def spread(problem: Problem, state: State, factor: SymmetricFactor, iterations: int) -> State:
    """Move vertices so that quads come near their own best-fitting squares; the last state."""
    quads = problem.quads
    low, high = SQUARE_RANGE[0] * problem.size, SQUARE_RANGE[1] * problem.size
    shape, area = shapes(problem.guidance.aspect, len(quads)), problem.size**2
    guidance = GUIDANCE * problem.guidance.weight * problem.guidance.along.T
    for _ in range(iterations):
        n = reference_normals(problem, state.normals).T
        p = corners(state.vertices, quads)
        edge = (ahead(p) - p) / shape
        # Edges of a square: d, n x d, -d, -(n x d); the least squares fit of d, in the plane.
        d = edge[:, 0] - edge[:, 2] + cross_rows(edge[:, 1] - edge[:, 3], n)
        d -= dot(d, n) * n
        side = np.clip(0.25 * np.sqrt(dot(d, d)), low, high)
        d = side * unit_rows(unit_rows(d) + guidance)
        turned = cross_rows(n, d)
        wanted = np.stack([d, turned, -d, -turned], axis=1)
        pull = (wanted - edge) / (area * shape)
        force = gathered(behind(pull) - pull, quads, len(problem.fixed))
        force = tangential(problem, state, force)
        move = tangential(problem, state, _solve(problem, factor, force))
        length = _longest(problem, move)
        state = place(problem, state.vertices + min(1.0, 1.0 / max(length, 1e-300)) * move, state)
        if length < 1e-3:
            break
    return state


def _longest(problem: Problem, move: Floats) -> float:
    """The longest move in units of the wanted edge length near its vertex."""
    return float((np.linalg.norm(move, axis=1) / problem.reach)[~problem.fixed].max())


def laplacian_factor(problem: Problem) -> SymmetricFactor:
    """Factor of the graph Laplacian (weights 1/size², a 1 % mass) over the vertices that move."""
    n = len(problem.fixed)
    free = np.flatnonzero(~problem.fixed)
    tail = problem.quads.T.reshape(-1)
    head = np.roll(problem.quads, -1, axis=1).T.reshape(-1)
    length = problem.size[:, None] * shapes(problem.guidance.aspect, len(problem.quads)).T
    weight = (1.0 / length**2).T.reshape(-1)
    half = coo_matrix((weight, (tail, head)), shape=(n, n)).tocsr()
    adjacency = half + half.T
    degree = np.asarray(adjacency.sum(axis=1)).reshape(-1)
    laplacian = (diags_array(1.01 * degree) - adjacency).tocsr()[free][:, free]
    return SymmetricFactor(laplacian)


def _solve(problem: Problem, factor: SymmetricFactor, a: Floats) -> Floats:
    """Inverse Laplacian of vectors at the vertices, 0 where fixed."""
    out = np.zeros_like(a)
    free = ~problem.fixed
    out[free] = factor.solve(a[free])
    return out


def descend(
    problem: Problem, state: State, factor: SymmetricFactor, iterations: int, patience: int = 0
) -> State:
    """Minimise the barrier energy.

    Parameters
    ----------
    problem, state
        What to solve, and where to start.
    factor : SymmetricFactor
        Of :func:`laplacian_factor`.
    iterations : int
        Steps at most; fewer where the energy has settled. After them it goes on while quads are
        folded, as long as ``patience`` steps have not passed without one less.
    patience : int

    Returns
    -------
    State
        The best state met (see `better`), the given one included.
    """
    best, best_at, number = state, 0, 0
    history: list[_Change] = []
    energies: list[float] = []  # of the last steps, all without a fold
    gradient, moved, last_epsilon = np.zeros((0, 3)), np.zeros((0, 3)), 0.0
    while number < iterations or (best.folded.any() and number < best_at + patience):
        number += 1
        normals = state.quad_normals
        epsilon = barrier_width(state.least)
        energy, slopes = state.energy, state.gradient
        if epsilon != SHARP or not len(slopes):
            now = cost(problem, state.vertices, normals, state.across, epsilon)
            energy, slopes = now.energy, now.gradient
        last, gradient = gradient, tangential(problem, state, slopes)
        if not 1 / 1.5 < epsilon / max(last_epsilon, 1e-300) < 1.5:
            history = []  # of another energy
        elif len(last):
            step, change = tangential(problem, state, moved), gradient - last
            product = float((step * change).sum())
            if product > 1e-8 * np.linalg.norm(step) * np.linalg.norm(change):
                history = [*history, _Change(step, change, product)][-MEMORY:]
        last_epsilon = epsilon
        move = -tangential(problem, state, _two_loop(problem, gradient, history, factor))
        slope = float((move * gradient).sum())
        if slope >= 0:
            history = []
            move = -gradient * problem.reach[:, None] ** 2
            slope = float((move * gradient).sum())
            if slope >= 0:
                break
        length = _longest(problem, move)
        scale = min(1.0, 1.0 / length)
        for _ in range(12):
            ahead = state.vertices + scale * move
            trial = cost(problem, ahead, normals, state.across, epsilon, False).energy
            if trial <= energy + 1e-4 * scale * slope:
                break
            scale *= 0.5
        following = place(problem, state.vertices + scale * move, state)
        moved, state = following.vertices - state.vertices, following
        if better(state, best):
            if state.folded.sum() < best.folded.sum():
                best_at = number
            best = state
        energies = [] if state.folded.any() else [*energies, state.energy][-STALE_STEPS - 1 :]
        settled = (
            len(energies) > STALE_STEPS and energies[0] - min(energies[1:]) < STALE * state.energy
        )
        if settled or scale * length < 1e-7:
            break
    return best


def _two_loop(
    problem: Problem,
    gradient: Floats,
    history: list[_Change],
    factor: SymmetricFactor,
) -> Floats:
    """L-BFGS inverse Hessian times the gradient, the factored Laplacian in the middle."""
    q = gradient.copy()
    shares = []
    for known in reversed(history):
        share = (known.step * q).sum() / known.product
        shares.append(share)
        q -= share * known.change
    z = _solve(problem, factor, q)
    if history:
        last = history[-1]
        z *= last.product / (last.change * _solve(problem, factor, last.change)).sum()
    for known, share in zip(history, reversed(shares), strict=True):
        z += (share - (known.change * z).sum() / known.product) * known.step
    return z
