"""The integer-grid map of a quantised layout on the triangles: what libQEx and its kin read.

The arc lengths decide every unknown of the seamless space that moves an isoline
(:mod:`vhquad.quad.integer_equations`). With those held, the ordinary vertices are solved for as in
:mod:`vhquad.quad.seamless_map`; if triangles stay folded, the held values are instead moved from
the continuous map, which has no folds, to the integers by Newton steps on an energy that lets no
triangle fold (Smith & Schaefer 2015). Where the mesh has no room for the map, edges are split.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vhquad.field.align import AlignedField
from vhquad.mesh.triangle import TriMesh, next_halfedge
from vhquad.quad.grid import GRID
from vhquad.quad.integer_equations import map_equations, solve_integers
from vhquad.quad.layout import Layout
from vhquad.quad.map_energy import MapEnergy, determinants, largest_step, solve_positive
from vhquad.quad.motorcycle import Tracing
from vhquad.quad.seamless import SeamlessSpace, seamless_space
from vhquad.quad.seamless_map import SeamlessMap, _wrong_angles, rotate, twice_area
from vhquad.quad.split_space import split_space
from vhquad.quad.tmesh import TMesh

__all__ = ["IntegerMap", "integer_map"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SOLVES = 8  # stiffened linear solves at most, as long as each halves the folds
LEAST_DETERMINANT = 0.1  # relative area; triangles below are stiffened
STIFFER = 3.0  # by this factor
CAP = 1e6
REACH = 0.8  # of the way to the first fold that a careful step goes
CENTRING = 1  # Newton steps of the free unknowns after each step towards the integers
SHORTEST = 1e-4  # of a careful step; below, or where a triangle has lost almost all of its
COLLAPSED = 1e-6  # area, the mesh has no room for the map
CROWDED = 1e-4  # relative area of the triangles that are split then
MOST_SPLITS = 6


@dataclass(frozen=True, eq=False)
class IntegerMap:
    """Texture coordinates whose integer isolines are the edges of the quads.

    Attributes
    ----------
    mesh : TriMesh
        The mesh of the aligned field, now and then with a few edges split.
    uv : (m, 3, 2) float64
        Coordinates of corner k of face f in the chart of f, in quad edges. Special vertices are
        integers, every feature edge lies on an integer isoline, and no other vertex does.
    flips : int
        Triangles that are not positively oriented.
    wrong_angles : int
        Sectors around which the map does not turn by the field's number of quarter turns.
    rotation : (3m,) int64
        r of ``z_g = i^r z_f + t``, for the halfedge of f whose twin lies in g.
    translation : (3m, 2) int64
        t of the same; zero on boundaries.
    """

    mesh: TriMesh
    uv: Floats
    flips: int
    wrong_angles: int
    rotation: Ints
    translation: Ints

    @property
    def is_valid(self) -> bool:
        """No folded triangle and the right angle around every vertex."""
        return self.flips == 0 and self.wrong_angles == 0

    @property
    def area(self) -> float:
        """Area of the image; without folds the number of quads."""
        a, b = self.uv[:, 1] - self.uv[:, 0], self.uv[:, 2] - self.uv[:, 0]
        return float(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


def integer_map(
    aligned: AlignedField,
    seamless: SeamlessMap,
    tracing: Tracing,
    tmesh: TMesh,
    layout: Layout,
    *,
    seconds: float = 60.0,
) -> IntegerMap:
    """Integer-grid map whose isolines make the quads of a layout.

    Parameters
    ----------
    aligned : AlignedField
    seamless : SeamlessMap
        A valid map of that field.
    tracing, tmesh, layout
        Its isolines, their T-mesh, and the integer lengths chosen for its arcs.
    seconds : float
        Time after which what is there is returned, folds counted.

    Raises
    ------
    ParametrizationError
        If the lengths of the layout contradict each other.
    """
    deadline = time.monotonic() + seconds
    space = seamless_space(aligned)
    scale = float(np.sqrt(len(layout.quads) / seamless.area))
    flat = np.zeros((space.n_wedges, 2))
    flat[space.wedge.reshape(-1)] = seamless.uv.reshape(-1, 2) * (seamless.unit * scale)
    equations = map_equations(aligned, seamless, space, tracing, tmesh)
    anchors = np.rint(flat.reshape(-1)[equations.anchors]).astype(np.int64)
    fixed = solve_integers(equations, space, layout.lengths, anchors)
    basis = (space.basis / space.denominator).tocsr()
    transpose = basis.T.tocsr()
    start = solve_positive(transpose @ basis, np.asarray(transpose @ flat.reshape(-1)))
    best: IntegerMap | None = None
    for made in _attempts(_Task(aligned, space, scale, start, fixed), deadline):
        if best is None or (made.flips, made.wrong_angles) < (best.flips, best.wrong_angles):
            best = made
        if best.is_valid:
            break
    assert best is not None
    return best


@dataclass(frozen=True, eq=False)
class _Task:
    """A map without folds, ``start``, and where its ``even`` unknowns shall go, ``fixed``."""

    aligned: AlignedField
    space: SeamlessSpace
    scale: float
    start: Floats
    fixed: Ints

    @cached_property
    def energy(self) -> MapEnergy:
        """Distortion against the sizes and directions of the field."""
        size = 1.0 if self.aligned.size is None else self.aligned.size
        return MapEnergy(
            self.aligned.mesh,
            self.space.wedge,
            (self.space.basis / self.space.denominator).tocsr(),
            self.scale / size * np.exp(1j * self.space.angle),
        )

    @cached_property
    def free(self) -> Ints:
        """Unknowns that are not fixed."""
        return np.flatnonzero(~self.space.even)

    def at_goal(self, x: Floats) -> Floats:
        """Unknowns with the fixed ones where they shall go."""
        return np.where(self.space.even, self.fixed, x)

    def split(self, faces: Ints) -> _Task:
        """The same with more vertices in some faces."""
        made = split_space(self.aligned, self.space, faces)
        added = np.asarray(made.middle @ self.start)
        return _Task(
            made.aligned,
            made.space,
            self.scale,
            np.append(self.start, added),
            np.append(self.fixed, np.zeros(len(added), dtype=np.int64)),
        )


def _attempts(task: _Task, deadline: float) -> Iterator[IntegerMap]:
    """Maps by stiffening, then by the careful way, with more vertices where it is stuck."""
    x = task.at_goal(task.start)
    weight = np.ones(task.aligned.mesh.n_faces)
    least = task.aligned.mesh.n_faces
    for _ in range(SOLVES):
        x = task.energy.least_squares(weight, x, task.free)
        yield _snapped(task, x)
        if time.monotonic() > deadline:
            return
        area = determinants(task.energy.frames(x))
        folds = int((area <= 0).sum())
        if folds > least // 2:
            break
        least = folds
        weight = np.where(area < LEAST_DETERMINANT, np.minimum(STIFFER * weight, CAP), weight)
    for _ in range(MOST_SPLITS + 1):
        x = _moved(task, deadline)
        yield _snapped(task, x)
        if time.monotonic() > deadline:
            return
        stuck = np.flatnonzero(determinants(task.energy.frames(x)) < CROWDED)
        task = task.split(stuck)


def _moved(task: _Task, deadline: float) -> Floats:
    """From a map without folds to the fixed values, or near them, without a fold on the way.

    Each step moves the fixed unknowns straight at their goal and the others as a Newton step of
    the energy asks, as far as no triangle loses most of its area; then the others are centred.
    """
    x, energy, free = task.start, task.energy, task.free
    operator = energy.restricted(free)
    transpose = operator.T.tocsr()
    while time.monotonic() < deadline:
        rest = task.at_goal(x) - x
        rest[free] = 0.0
        for centring in range(CENTRING + 1):
            frames = energy.frames(x)
            slope, hessian = energy.derivatives(frames)
            goal = (energy.jacobian @ rest) if centring == 0 else np.zeros_like(slope)
            step = rest.copy() if centring == 0 else np.zeros_like(x)
            step[free] = -solve_positive(
                transpose @ (hessian @ operator), transpose @ (slope + hessian @ goal)
            )
            move = energy.frames(step)
            length = min(1.0, REACH * largest_step(frames, move))
            if centring == 0:
                if length < SHORTEST or determinants(frames).min() < COLLAPSED:
                    return x
                x = x + length * step
                if length == 1.0:
                    return task.at_goal(x)
                continue
            before, along = energy.value(frames), float(slope @ move.ravel())
            while energy.value(frames + length * move) > before + 1e-4 * length * along:
                length *= 0.5
                if length < SHORTEST:
                    break
            x = x + length * step
    return x


def _snapped(task: _Task, x: Floats) -> IntegerMap:
    """Exact coordinates: fixed unknowns whole, the others odd multiples of 1 / GRID."""
    space, mesh = task.space, task.aligned.mesh
    odd = 2 * np.floor(x * (GRID / 2)).astype(np.int64) + 1
    flat = space.basis @ np.where(space.even, task.fixed * GRID, odd)
    if (flat % space.denominator).any():
        raise AssertionError("a vertex of the integer-grid map is off the lattice")
    uv = (flat // space.denominator).reshape(-1, 2)[space.wedge]
    corner = uv.reshape(-1, 2)
    h = np.flatnonzero(mesh.twin >= 0)
    translation = np.zeros((3 * mesh.n_faces, 2), dtype=np.int64)
    translation[h] = corner[next_halfedge(mesh.twin[h])] - rotate(corner[h], space.rotation[h])
    if (translation % GRID).any():
        raise AssertionError("charts of the integer-grid map differ by a fraction of a quad")
    return IntegerMap(
        mesh=mesh,
        uv=uv / GRID,
        flips=int((twice_area(uv) <= 0).sum()),
        wrong_angles=_wrong_angles(task.aligned, uv),
        rotation=space.rotation,
        translation=translation // GRID,
    )
