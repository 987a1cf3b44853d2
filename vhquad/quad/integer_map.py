"""The integer-grid map of a quantised layout on the triangles: what libQEx and its kin read.

The arc lengths decide every unknown of the seamless space that moves an isoline
(:mod:`vhquad.quad.integer_equations`). With those held, the ordinary vertices are solved for as in
:mod:`vhquad.quad.seamless_map`; if triangles stay folded, the held values are instead moved from
the continuous map, which has no folds, to the integers by Newton steps on an energy that lets no
triangle fold (Smith & Schaefer 2015).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

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
COLLAPSED = 1e-7  # area, a fold cannot be avoided


@dataclass(frozen=True, eq=False)
class IntegerMap:
    """Texture coordinates whose integer isolines are the edges of the quads.

    Attributes
    ----------
    mesh : TriMesh
        The refined mesh of the aligned field.
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
    size = 1.0 if aligned.size is None else aligned.size
    energy = MapEnergy(aligned.mesh, space.wedge, basis, scale / size * np.exp(1j * space.angle))
    best: IntegerMap | None = None
    for unknowns in _attempts(energy, start, fixed, space.even, deadline):
        made = _snapped(aligned, space, fixed, unknowns)
        if best is None or (made.flips, made.wrong_angles) < (best.flips, best.wrong_angles):
            best = made
        if best.is_valid:
            break
    assert best is not None
    return best


def _attempts(
    energy: MapEnergy, start: Floats, fixed: Ints, even: NDArray[np.bool_], deadline: float
) -> Iterator[Floats]:
    """Unknowns with the ``even`` ones fixed: by stiffening, then by the careful way."""
    x = np.where(even, fixed, start)
    free = np.flatnonzero(~even)
    weight = np.ones(energy.mesh.n_faces)
    least = energy.mesh.n_faces
    for _ in range(SOLVES):
        x = energy.least_squares(weight, x, free)
        yield x
        area = determinants(energy.frames(x))
        folds = int((area <= 0).sum())
        if time.monotonic() > deadline:
            return
        if folds > least // 2:
            break
        least = folds
        weight = np.where(area < LEAST_DETERMINANT, np.minimum(STIFFER * weight, CAP), weight)
    yield _moved(energy, start, fixed, even, deadline)


def _moved(
    energy: MapEnergy, start: Floats, fixed: Ints, even: NDArray[np.bool_], deadline: float
) -> Floats:
    """From a map without folds to the fixed values, without a fold on the way.

    Each step moves the fixed unknowns straight at their goal and the others as a Newton step of
    the energy asks, as far as no triangle loses most of its area; then the others are centred.
    """
    x = start.copy()
    free = np.flatnonzero(~even)
    operator = energy.restricted(free)
    transpose = operator.T.tocsr()
    while time.monotonic() < deadline:
        rest = np.where(even, fixed - x, 0.0)
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
                hopeless = length < SHORTEST or determinants(frames).min() < COLLAPSED
                x = x if hopeless else x + length * step
                if hopeless or length == 1.0:
                    return np.where(even, fixed, x)
                continue
            before, along = energy.value(frames), float(slope @ move.ravel())
            while energy.value(frames + length * move) > before + 1e-4 * length * along:
                length *= 0.5
                if length < SHORTEST:
                    break
            x = x + length * step
    return np.where(even, fixed, x)


def _snapped(aligned: AlignedField, space: SeamlessSpace, fixed: Ints, x: Floats) -> IntegerMap:
    """Exact coordinates: fixed unknowns whole, the others odd multiples of 1 / GRID."""
    mesh = aligned.mesh
    odd = 2 * np.floor(x * (GRID / 2)).astype(np.int64) + 1
    flat = space.basis @ np.where(space.even, fixed * GRID, odd)
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
        wrong_angles=_wrong_angles(aligned, uv),
        rotation=space.rotation,
        translation=translation // GRID,
    )
