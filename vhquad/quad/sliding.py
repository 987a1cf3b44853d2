"""Where the vertices of a quad mesh are on a surface, and how they may move on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.closest import ClosestPoints, Hits
from vhquad.mesh.vectors import unit
from vhquad.quad.corners import Sides, shapes, sides_of
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.distortion import (
    SHARP,
    Distortion,
    corner_jacobians,
    directions,
    distortion,
    inverted_quads,
    misalignment,
    quad_normals,
)

__all__ = [
    "GUIDANCE",
    "Guidance",
    "Problem",
    "Pulls",
    "State",
    "cost",
    "folded_quads",
    "make_problem",
    "measure",
    "place",
    "reference_normals",
    "smooth_normals",
    "tangential",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SIZE_WEIGHT = 0.3
GUIDANCE = 10.0  # weight of edges off the field's directions
SAME_SIDE = 0.2  # least cosine between normals before and after a step
ALIKE, NEARLY = 0.3, 0.7  # least cosine of a quad's normal with the surface's, smooth and of a face


@dataclass(frozen=True, eq=False)
class Pulls:
    """Points that pull at edges: weight / 2 times the squared distance of each from a place."""

    edges: Ints  # (p, 2) ends of the edge that each point pulls at
    share: Floats  # (p,) where on it, from 0 to 1
    points: Floats  # (p, 3)
    weight: float

    def cost(self, x: Floats) -> tuple[float, Floats]:
        """Energy of vertices at x, and its gradient; (n, 3)."""
        ends = np.stack([1.0 - self.share, self.share], axis=1)
        off = (ends[..., None] * x[self.edges]).sum(axis=1) - self.points
        index = self.edges.reshape(-1)
        pull = (ends[..., None] * off[:, None]).reshape(-1, 3)
        total = [np.bincount(index, column, len(x)) for column in pull.T]
        gradient = np.asarray(self.weight * np.stack(total, axis=1), dtype=np.float64)
        return 0.5 * self.weight * float((off**2).sum()), gradient


@dataclass(frozen=True, eq=False)
class Guidance:
    """How the edges of quads are to run, and how long they are to be for their width."""

    along: Floats  # (k, 3) unit direction for edges 0 and 2 of each quad; 0 for any
    weight: Floats  # (k,) of that direction, in GUIDANCE
    aspect: Floats  # (k,) wanted length of edges 0 and 2 over that of edges 1 and 3

    @staticmethod
    def none(n_quads: int) -> Guidance:
        """Squares in any direction."""
        return Guidance(np.zeros((n_quads, 3)), np.ones(n_quads), np.ones(n_quads))

    def of(self, inside: Ints) -> Guidance:
        """That of some quads."""
        return Guidance(self.along[inside], self.weight[inside], self.aspect[inside])


@dataclass(frozen=True, eq=False)
class Problem:
    """What stays the same while vertices move."""

    quads: Ints
    surface: ClosestPoints
    curves: CurveConstraints
    fixed: Bools
    size: Floats  # (k,) wanted edge length of each quad, the root of its area
    on_curve: Ints  # vertices that slide on a curve
    reach: Floats  # (n,) least wanted edge length around each vertex: the longest step
    trust: Floats  # (n,) weight of a vertex's surface normal in its quads' reference normals
    guidance: Guidance
    pulls: Pulls | None = None


@dataclass(frozen=True, eq=False)
class State:
    """Where the vertices are, and what follows from it."""

    vertices: Floats
    arc: Floats  # (n,) arc length of ``on_curve`` vertices on their curves, 0 elsewhere
    normals: Floats  # (n, 3) surface normals, smooth
    face: Ints  # (n,) face of the surface under each vertex
    tangents: Floats  # of the curves at ``on_curve`` vertices
    quad_normals: Floats  # (k, 3) reference normals of the energy
    across: Floats | None  # (3, 4, k) directions that edges should not have; None if any will do
    folded: Bools  # (k,)
    energy: float  # at the least barrier width, to rank states
    gradient: Floats  # (n, 3) of that energy; (0, 3) while quads are folded
    least: float  # signed area of the worst corner, of the wanted square


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


def make_problem(
    quads: Ints,
    surface: ClosestPoints,
    curves: CurveConstraints,
    fixed: Bools,
    size: Floats,
    guidance: Guidance | None = None,
) -> Problem:
    """Derive what stays the same from the parts of the problem."""
    if guidance is None:
        guidance = Guidance.none(len(quads))
    reach = np.full(len(fixed), np.inf)
    length = size[:, None] * shapes(guidance.aspect, len(quads)).T
    np.minimum.at(reach, quads.reshape(-1), length.reshape(-1))
    sliding = (curves.curve >= 0) & ~fixed
    # A crease has two normals: prefer those of a quad's plain vertices.
    trust = np.where((curves.curve >= 0) | fixed, 0.01, 1.0)
    on_curve = np.flatnonzero(sliding)
    return Problem(quads, surface, curves, fixed, size, on_curve, reach, trust, guidance)


def place(problem: Problem, wanted: Floats, before: State | None) -> State:
    """Bring wanted positions back to the surface and the curves.

    A vertex whose closest point faces another way than where it was may have gone through the
    surface; it walks there instead.
    """
    line = problem.on_curve
    if before is None:
        hits = problem.surface.query(wanted)
        x, face, normals = hits.point, hits.face, smooth_normals(problem, hits)
        arc = np.zeros(len(x))
        arc[line] = problem.curves.locate(line, wanted[line])
        x[problem.fixed] = wanted[problem.fixed]
    else:
        free = np.flatnonzero(~problem.fixed)
        hits = problem.surface.query_from(wanted[free], before.face[free])
        x, face, normals = before.vertices.copy(), before.face.copy(), before.normals.copy()
        x[free], face[free], normals[free] = hits.point, hits.face, smooth_normals(problem, hits)
        along = np.einsum("vi,vi->v", wanted[line] - before.vertices[line], before.tangents)
        arc = before.arc.copy()
        arc[line] = problem.curves.wrap(line, arc[line] + along)
        through = np.einsum("vi,vi->v", normals, before.normals) < SAME_SIDE
        through[line] = through[problem.fixed] = False
        walkers = np.flatnonzero(through)
        if len(walkers):
            walked = problem.surface.query_near(wanted[walkers], before.face[walkers])
            x[walkers], face[walkers] = walked.point, walked.face
            normals[walkers] = smooth_normals(problem, walked)
    x[line] = problem.curves.position(line, arc[line])
    return measure(problem, x, arc, normals, face)


def smooth_normals(problem: Problem, hits: Hits) -> Floats:
    """Unit vertex normals of the surface, interpolated; (n, 3)."""
    mesh = problem.surface.mesh
    corners = mesh.vertex_normals[mesh.faces[hits.face]]  # of these faces alone: there may be many
    return unit(np.einsum("qk,qki->qi", hits.barycentric, corners))


def measure(problem: Problem, x: Floats, arc: Floats, normals: Floats, face: Ints) -> State:
    """The state of given positions, arc lengths, normals and faces at the vertices.

    Beside a sharp edge the smooth normal lies across; there a quad is right if it faces as the
    surface does at one of its corners.
    """
    quads = problem.quads
    sides = sides_of(x, quads)
    around, own = reference_normals(problem, normals), quad_normals(x, quads, sides)
    facing = np.einsum("ki,ki->k", own, around)
    doubted = np.flatnonzero(facing <= ALIKE)
    facets = problem.surface.mesh.face_normals[face[quads[doubted]]]
    nearest = np.ones(len(quads))
    nearest[doubted] = np.einsum("kci,ki->kc", facets, own[doubted]).max(axis=1)
    folded = inverted_quads(sides, own) | ((facing <= 0) & (nearest <= 0))
    trusted = ~folded & (nearest > NEARLY)
    reference = np.where(trusted[:, None], own, around)
    guidance = problem.guidance
    across = None
    if guidance.along.any():
        across = directions(reference, guidance.along, guidance.weight)
    at = cost(problem, x, reference, across, SHARP, not folded.any(), sides)
    line = problem.on_curve
    return State(
        vertices=x,
        arc=arc,
        normals=normals,
        face=face,
        tangents=problem.curves.tangent(line, arc[line], 0.25 * problem.reach[line]),
        quad_normals=reference,
        across=across,
        folded=folded,
        energy=at.energy,
        gradient=at.gradient,
        least=float(at.area.min()),
    )


def cost(
    problem: Problem,
    x: Floats,
    normals: Floats,
    across: Floats | None,
    epsilon: float,
    with_gradient: bool = True,
    sides: Sides | None = None,
) -> Distortion:
    """Distortion of the quads about some normals, what their edges run off the field, and pulls."""
    quads, size, aspect = problem.quads, problem.size, problem.guidance.aspect
    sides = sides or sides_of(x, quads)
    out = distortion(x, quads, normals, size, epsilon, SIZE_WEIGHT, with_gradient, aspect, sides)
    if across is not None:
        off, pull = misalignment(x, quads, across, size, with_gradient, aspect, sides)
        out = _more(out, GUIDANCE * off, GUIDANCE * pull)
    if problem.pulls is not None:
        out = _more(out, *problem.pulls.cost(x))
    return out


def _more(to: Distortion, energy: float, gradient: Floats) -> Distortion:
    """An energy with another added, and the gradients where they are wanted."""
    total = to.gradient + gradient if len(to.gradient) else to.gradient
    return replace(to, energy=to.energy + energy, gradient=total)


def reference_normals(problem: Problem, normals: Floats) -> Floats:
    """Unit surface normal of each quad, the mean over its corners; (k, 3)."""
    quads = problem.quads
    return unit(np.einsum("kc,kci->ki", problem.trust[quads], normals[quads]))


def tangential(problem: Problem, state: State, a: Floats) -> Floats:
    """The part of vectors at the vertices along which these can move."""
    out = a - np.einsum("vi,vi->v", a, state.normals)[:, None] * state.normals
    line = problem.on_curve
    t = state.tangents
    out[line] = np.einsum("vi,vi->v", a[line], t)[:, None] * t
    out[problem.fixed] = 0.0
    return out
