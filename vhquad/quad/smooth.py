"""Polish of a quad mesh on its surface: unfold, square up, even out; curves and corners are kept.

The energy of :mod:`vhquad.quad.distortion` is minimised over tangential moves by L-BFGS whose
first guess of the inverse Hessian is that of the quad mesh's graph Laplacian (Liu et al. 2017,
"Quasi-Newton methods for real-time simulation"), so that a crowded strip spreads over the whole
neighbourhood in a few steps. After each step vertices return to the surface (closest point; a hit
whose normal turns away from the vertex's is refused, so thin parts keep their sides) or slide on
their curve. Quads still bad at the end get patch problems of their own. The best state met is
returned: never more folded quads than came in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix, diags_array
from scipy.sparse.linalg import SuperLU, splu

from vhquad.errors import MeshError
from vhquad.mesh.closest import ClosestPoints
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.distortion import corner_jacobians, cross, distortion, quad_normals, unit

__all__ = ["folded_quads", "smooth_quads", "smoothed_sizes"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SIZE_WEIGHT = 0.3
MEMORY = 6
POOR = 0.1  # a quad with a scaled Jacobian below this gets a patch problem of its own
PATCH_RINGS = 4
PATCH_ITERATIONS = 40
PATCH_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class _Problem:
    """What stays the same while vertices move."""

    quads: Ints
    surface: ClosestPoints
    curves: CurveConstraints
    fixed: Bools
    size: Floats  # (k,) wanted edge length of each quad
    on_curve: Ints  # vertices that slide on a curve
    reach: Floats  # (n,) least wanted edge length around each vertex: the longest step
    trust: Floats  # (n,) weight of a vertex's surface normal in its quads' reference normals


@dataclass(frozen=True, eq=False)
class _State:
    """Where the vertices are, and what follows from it."""

    vertices: Floats
    arc: Floats  # (n,) arc length of ``on_curve`` vertices on their curves, 0 elsewhere
    normals: Floats  # (n, 3) surface normals
    quad_normals: Floats  # (k, 3) reference normals of the energy
    folded: Bools  # (k,)
    energy: float  # at the least epsilon, to rank states


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


def folded_quads(vertices: Floats, quads: Ints, surface_normals: Floats) -> Bools:
    """Quads with a corner turned over against their own normal, or turned against the surface.

    Parameters
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
    surface_normals : (k, 3) float64
        Normal of the surface near each quad, any length.
    """
    own = quad_normals(vertices, quads)
    turned = np.einsum("ki,ki->k", own, surface_normals) <= 0
    return np.asarray((corner_jacobians(vertices, quads, own) <= 0).any(axis=1) | turned)


def smooth_quads(
    vertices: ArrayLike,
    quads: ArrayLike,
    surface: ClosestPoints,
    fixed: ArrayLike | None = None,
    curves: CurveConstraints | None = None,
    iterations: int = 30,
    target_edge: ArrayLike | None = None,
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
    problem = _problem(q, surface, bound, hold, size)
    state = _minimise(problem, _place(problem, x, None), iterations)
    for _ in range(PATCH_ROUNDS):
        poor = _poor_quads(problem, state)
        if not poor.any():
            break
        state = _repair_patches(problem, state, poor)
    return state.vertices


def _problem(
    quads: Ints, surface: ClosestPoints, curves: CurveConstraints, fixed: Bools, size: Floats
) -> _Problem:
    reach = np.full(len(fixed), np.inf)
    np.minimum.at(reach, quads.reshape(-1), np.repeat(size, 4))
    sliding = (curves.curve >= 0) & ~fixed
    # A crease has two normals: prefer those of a quad's plain vertices.
    trust = np.where(curves.curve >= 0, 0.01, 1.0)
    return _Problem(quads, surface, curves, fixed, size, np.flatnonzero(sliding), reach, trust)


def _place(problem: _Problem, wanted: Floats, before: _State | None) -> _State:
    """Bring wanted positions back to the surface and the curves."""
    mesh, line = problem.surface.mesh, problem.on_curve
    hits = problem.surface.query(wanted)
    normals = mesh.vertex_normals[mesh.faces[hits.face]]
    normals = unit(np.einsum("qk,qki->qi", hits.barycentric, normals))
    x = np.array(hits.point)
    if before is None:
        arc = np.zeros(len(x))
        arc[line] = problem.curves.locate(line, wanted[line])
        x[problem.fixed] = wanted[problem.fixed]
    else:
        tangent = problem.curves.tangent(line, before.arc[line], 0.25 * problem.reach[line])
        along = np.einsum("vi,vi->v", wanted[line] - before.vertices[line], tangent)
        arc = before.arc.copy()
        arc[line] = problem.curves.wrap(line, arc[line] + along)
        wrong_side = np.einsum("vi,vi->v", normals, before.normals) < 0.2
        wrong_side[line] = False
        keep = problem.fixed | wrong_side
        x[keep], normals[keep] = before.vertices[keep], before.normals[keep]
    x[line] = problem.curves.position(line, arc[line])
    return _measure(problem, x, arc, normals)


def _measure(problem: _Problem, x: Floats, arc: Floats, normals: Floats) -> _State:
    quads = problem.quads
    around = unit(np.einsum("kc,kci->ki", problem.trust[quads], normals[quads]))
    folded = folded_quads(x, quads, around)
    own = quad_normals(x, quads)
    trusted = ~folded & (np.einsum("ki,ki->k", own, around) > 0.3)
    reference = np.where(trusted[:, None], own, around)
    energy = distortion(x, quads, reference, problem.size, 1e-3, SIZE_WEIGHT, False).energy
    return _State(x, arc, normals, reference, folded, energy)


def _tangential(problem: _Problem, state: _State, a: Floats) -> Floats:
    """The part of vectors at the vertices along which these can move."""
    out = a - np.einsum("vi,vi->v", a, state.normals)[:, None] * state.normals
    line = problem.on_curve
    t = problem.curves.tangent(line, state.arc[line], 0.25 * problem.reach[line])
    out[line] = np.einsum("vi,vi->v", a[line], t)[:, None] * t
    out[problem.fixed] = 0.0
    return out


def _factor(problem: _Problem, free: Ints) -> SuperLU:
    """Factor of the graph Laplacian (weights 1/size², a 1 % mass) over the free vertices."""
    n = len(problem.fixed)
    tail = problem.quads.T.reshape(-1)
    head = np.roll(problem.quads, -1, axis=1).T.reshape(-1)
    weight = np.tile(1.0 / problem.size**2, 4)
    half = coo_matrix((weight, (tail, head)), shape=(n, n)).tocsr()
    adjacency = half + half.T
    degree = np.asarray(adjacency.sum(axis=1)).reshape(-1)
    laplacian = (diags_array(1.01 * degree) - adjacency).tocsr()[free][:, free].tocsc()
    return splu(
        laplacian,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def _epsilon(area: Floats) -> float:
    """Width of the barrier: wide while corners are folded, then almost sharp."""
    least = float(area.min())
    return 1e-3 if least > 0.02 else min(0.3, max(1e-3, 0.16 * np.sqrt(max(-least, 0.0))))


def _minimise(problem: _Problem, state: _State, iterations: int) -> _State:
    free = np.flatnonzero(~problem.fixed)
    if free.size == 0 or iterations <= 0:
        return state
    factor = _factor(problem, free)
    best = state
    steps: list[Floats] = []
    changes: list[Floats] = []
    last_gradient: Floats | None = None
    moved = np.zeros_like(state.vertices)
    for _ in range(iterations):
        args = (problem.quads, state.quad_normals, problem.size)
        epsilon = _epsilon(distortion(state.vertices, *args, 1.0, SIZE_WEIGHT, False).area)
        now = distortion(state.vertices, *args, epsilon, SIZE_WEIGHT)
        gradient = _tangential(problem, state, now.gradient)
        if last_gradient is not None:
            step, change = _tangential(problem, state, moved), gradient - last_gradient
            if (step * change).sum() > 1e-8 * np.linalg.norm(step) * np.linalg.norm(change):
                steps, changes = [*steps, step][-MEMORY:], [*changes, change][-MEMORY:]
        move = -_tangential(problem, state, _two_loop(gradient, steps, changes, factor, free))
        slope = float((move * gradient).sum())
        if slope >= 0:
            steps, changes = [], []
            move = -gradient * problem.reach[:, None] ** 2
            slope = float((move * gradient).sum())
            if slope >= 0:
                break
        length = float((np.linalg.norm(move[free], axis=1) / problem.reach[free]).max())
        scale = min(1.0, 1.0 / length)
        for _ in range(12):
            trial = distortion(
                state.vertices + scale * move, *args, epsilon, SIZE_WEIGHT, False
            ).energy
            if trial <= now.energy + 1e-4 * scale * slope:
                break
            scale *= 0.5
        following = _place(problem, state.vertices + scale * move, state)
        moved, last_gradient, state = following.vertices - state.vertices, gradient, following
        if (state.folded.sum(), state.energy) < (best.folded.sum(), best.energy):
            best = state
        if scale * length < 1e-7:
            break
    return best


def _two_loop(
    gradient: Floats, steps: list[Floats], changes: list[Floats], factor: SuperLU, free: Ints
) -> Floats:
    """L-BFGS inverse Hessian times the gradient, the factored Laplacian in the middle."""
    q = gradient.copy()
    shares = []
    for s, y in zip(reversed(steps), reversed(changes), strict=True):
        share = (s * q).sum() / (s * y).sum()
        shares.append(share)
        q -= share * y
    z = np.zeros_like(q)
    z[free] = factor.solve(q[free])
    if steps:
        y = changes[-1][free]
        z *= (steps[-1] * changes[-1]).sum() / (y * factor.solve(y)).sum()
    for s, y, share in zip(steps, changes, reversed(shares), strict=True):
        z += (share - (y * z).sum() / (s * y).sum()) * s
    return z


def _poor_quads(problem: _Problem, state: _State) -> Bools:
    jacobians = corner_jacobians(state.vertices, problem.quads, state.quad_normals)
    return np.asarray(state.folded | (jacobians.min(axis=1) < POOR))


def _repair_patches(problem: _Problem, state: _State, poor: Bools) -> _State:
    """Minimise again over the rings around poor quads only, the rest held."""
    inside = poor
    for _ in range(PATCH_RINGS):
        touched = np.zeros(len(problem.fixed), dtype=bool)
        touched[problem.quads[inside]] = True
        inside = np.asarray(touched[problem.quads].any(axis=1))
    held = np.ones(len(problem.fixed), dtype=bool)
    held[problem.quads[inside]] = False
    held[problem.quads[~inside]] = True
    used, local = np.unique(problem.quads[inside], return_inverse=True)
    part = _problem(
        local.reshape(-1, 4),
        problem.surface,
        problem.curves.restrict(used),
        (held | problem.fixed)[used],
        problem.size[inside],
    )
    solved = _minimise(part, _place(part, state.vertices[used], None), PATCH_ITERATIONS)
    merged = [np.array(old) for old in (state.vertices, state.arc, state.normals)]
    for whole, new in zip(merged, (solved.vertices, solved.arc, solved.normals), strict=True):
        whole[used] = new
    return _measure(problem, *merged)
