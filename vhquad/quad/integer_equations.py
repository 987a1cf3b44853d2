"""What integer arc lengths say about a seamless map: exact values for the unknowns they decide.

Every track starts at a special vertex A and ends on a path that starts at a special vertex B. The
place where they meet, developed in the map over the triangles from A and again from B, is one
point: ``z_A + n_A i^a = z_B + n_B i^b`` in the chart of the last triangle, with n the quads along
each way. Charts change across a cut edge by ``z -> i^r z + t``, and t is the difference of two
wedges, so each side is a linear form of the wedges; ordinary vertices drop out. Together with the
lengths of the feature curves and one special vertex at a lattice point these equations decide
every unknown of the space that moves an isoline (Bommes et al. 2013, "Integer-grid maps").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu

from vhquad.errors import ParametrizationError
from vhquad.field.align import AlignedField
from vhquad.mesh.triangle import next_halfedge
from vhquad.quad.motorcycle import Tracing, Track
from vhquad.quad.seamless import SeamlessSpace
from vhquad.quad.seamless_map import SeamlessMap
from vhquad.quad.tmesh import TMesh

__all__ = ["MapEquations", "map_equations", "solve_integers"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_COSINE = np.array([1, 0, -1, 0])
_SINE = np.array([0, 1, 0, -1])


@dataclass(frozen=True, eq=False)
class MapEquations:
    """``forms @ x = denominator * (lengths @ n + anchors @ z)`` for the unknowns x of a space.

    Attributes
    ----------
    forms : (e, d) csr_matrix of int64
        Each equation over the unknowns; zero for all that are not ``even``.
    lengths : (e, a) csr_matrix of int64
        Over the arc lengths n, in quads (or in any other unit: the equations hold in all).
    anchors : (2 c,) int64
        Scalars (2 wedge, 2 wedge + 1) of one special vertex per component; the last 2 c equations
        state their values, z.
    """

    forms: csr_matrix
    lengths: csr_matrix
    anchors: Ints


class _Rows:
    """Equations under construction, two at a time: the real and the imaginary part."""

    def __init__(self) -> None:
        self.count = 0
        self.scalars: list[tuple[Ints, Ints, Ints]] = []
        self.arcs: list[tuple[Ints, Ints, Ints]] = []

    def points(self, wedge: Ints, quarter: Ints, sign: Ints) -> None:
        """Add ``sum(sign * i^quarter * z_wedge)`` to the left side."""
        c, s = sign * _COSINE[quarter % 4], sign * _SINE[quarter % 4]
        u, v = 2 * wedge, 2 * wedge + 1
        real, imaginary = np.full(len(wedge), self.count), np.full(len(wedge), self.count + 1)
        self.scalars += [(real, u, c), (real, v, -s), (imaginary, u, s), (imaginary, v, c)]

    def steps(self, arcs: Ints, quarter: int, sign: int) -> None:
        """Add ``sign * i^quarter * sum of the arc lengths`` to the right side."""
        for row, factor in ((0, _COSINE[quarter % 4]), (1, _SINE[quarter % 4])):
            if factor:
                value = np.full(len(arcs), sign * factor)
                self.arcs.append((np.full(len(arcs), self.count + row), arcs, value))

    def close(self) -> None:
        """Go on to the next two equations."""
        self.count += 2

    def matrices(self, n_scalars: int, n_arcs: int) -> tuple[csr_matrix, csr_matrix]:
        """Left and right sides, over scalars and arc lengths."""
        return _matrix(self.scalars, (self.count, n_scalars)), _matrix(
            self.arcs, (self.count, n_arcs)
        )


def _matrix(parts: list[tuple[Ints, Ints, Ints]], shape: tuple[int, int]) -> csr_matrix:
    if not parts:
        parts = [(np.zeros(0, dtype=np.int64),) * 3]
    row, col, value = (np.concatenate([p[i] for p in parts]) for i in range(3))
    matrix = coo_matrix((value.astype(np.int64), (row, col)), shape=shape).tocsr()
    matrix.eliminate_zeros()
    return matrix


class _Surface:
    """The map, the space and the T-mesh side by side."""

    def __init__(
        self,
        aligned: AlignedField,
        seamless: SeamlessMap,
        space: SeamlessSpace,
        tracing: Tracing,
        tmesh: TMesh,
    ) -> None:
        self.mesh = aligned.mesh
        self.tracks = tracing.tracks
        self.uv = seamless.uv.reshape(-1, 2)
        self.wedge = space.wedge.reshape(-1)
        self.rotation = space.rotation
        track = np.array([arc.track for arc in tmesh.arcs])
        feature = np.array([arc.feature for arc in tmesh.arcs])
        self.end = np.array([arc.end for arc in tmesh.arcs])
        self.track_arcs = [np.flatnonzero(track == t) for t in range(len(tracing.tracks))]
        self.curve_arcs = [np.flatnonzero(feature == c) for c in range(len(tmesh.curves))]
        self.curve_halfedges = tmesh.curve_halfedges
        self.curve_of: dict[int, tuple[int, int]] = {}
        for number, chain in enumerate(tmesh.curve_halfedges):
            for place, h in enumerate(chain.tolist()):
                self.curve_of[h] = number, place

    def direction(self, h: Ints) -> Ints:
        """Quarter turn of feature halfedges in the charts of their faces."""
        step = self.uv[next_halfedge(h)] - self.uv[h]
        along_v = step[:, 0] == 0
        moving = np.where(along_v, step[:, 1], step[:, 0])
        return np.asarray(np.where(moving > 0, 0, 2) + along_v)

    def up_to(self, arcs: Ints, node: int) -> Ints:
        """The first arcs of a track or curve, to the one that ends at a node."""
        return arcs[: int(np.flatnonzero(self.end[arcs] == node)[0]) + 1]

    def develop(self, track: Track, last: int) -> tuple[Ints, Ints, Ints]:
        """Origin of a track in the chart of its step ``last``: wedges, quarter turns, signs."""
        enter = np.array([s.enter for s in track.steps[1 : last + 1]], dtype=np.int64)
        h = self.mesh.twin[enter]
        r = self.rotation[h]
        after = r.sum() - np.cumsum(r)
        near, far = self.wedge[h], self.wedge[next_halfedge(enter)]
        cut = (r != 0) | (near != far) | (self.wedge[next_halfedge(h)] != self.wedge[enter])
        first = 3 * track.steps[0].face
        start = first + int(np.flatnonzero(self.mesh.tail[first : first + 3] == track.vertex)[0])
        # i^after (z_far - i^r z_near) for every crossing, and the origin turned by all of them.
        wedge = np.concatenate([self.wedge[start : start + 1], far[cut], near[cut]])
        quarter = np.concatenate([r.sum(keepdims=True), after[cut], (after + r)[cut]])
        sign = np.repeat([1, 1, -1], [1, int(cut.sum()), int(cut.sum())])
        return wedge, quarter, sign


def map_equations(
    aligned: AlignedField,
    seamless: SeamlessMap,
    space: SeamlessSpace,
    tracing: Tracing,
    tmesh: TMesh,
) -> MapEquations:
    """Equations between the unknowns of a seamless space and the arc lengths of its T-mesh."""
    surface = _Surface(aligned, seamless, space, tracing, tmesh)
    rows = _Rows()
    for number, track in enumerate(tracing.tracks):
        hit = track.hit
        assert hit is not None
        if hit.kind == "track":
            _onto_track(surface, rows, number)
        elif hit.kind == "feature":
            _onto_feature(surface, rows, number)
        elif hit.other > number:
            _head_on(surface, rows, number)
    for number, chain in enumerate(surface.curve_halfedges):
        _along(surface, rows, chain, 1)
        rows.steps(surface.curve_arcs[number], 0, 1)
        rows.close()
    anchors = _anchors(aligned, space, tracing)
    for scalar in anchors[::2]:
        rows.points(np.array([scalar // 2]), np.array([0]), np.array([1]))
        rows.close()
    scalars, lengths = rows.matrices(space.basis.shape[0], len(tmesh.arcs))
    forms = (scalars @ space.basis).tocsr()
    forms.eliminate_zeros()
    if not space.even[forms.indices].all():
        raise AssertionError("the place of an ordinary vertex decides where isolines meet")
    return MapEquations(forms, lengths, anchors)


def _onto_track(surface: _Surface, rows: _Rows, number: int) -> None:
    track = surface.tracks[number]
    hit = track.hit
    assert hit is not None
    other = surface.tracks[hit.other]
    rows.points(*surface.develop(track, len(track.steps) - 1))
    wedge, quarter, sign = surface.develop(other, hit.step)
    rows.points(wedge, quarter, -sign)
    arcs = surface.track_arcs[number]
    rows.steps(arcs, hit.direction, -1)
    before = surface.up_to(surface.track_arcs[hit.other], int(surface.end[arcs[-1]]))
    rows.steps(before, other.steps[hit.step].direction, 1)
    rows.close()


def _onto_feature(surface: _Surface, rows: _Rows, number: int) -> None:
    track = surface.tracks[number]
    hit = track.hit
    assert hit is not None
    h = hit.other
    from_left = h in surface.curve_of
    curve, place = surface.curve_of[h if from_left else int(surface.mesh.twin[h])]
    start = np.array([h if from_left else int(next_halfedge(np.array(h)))])
    along = int(surface.direction(np.array([h]))[0]) + (0 if from_left else 2)
    # origin + arcs of the track = start of the edge + (arcs of the curve - edges before) i^along
    rows.points(*surface.develop(track, len(track.steps) - 1))
    rows.points(surface.wedge[start], np.array([0]), np.array([-1]))
    _along(surface, rows, surface.curve_halfedges[curve][:place], 1, along)
    arcs = surface.track_arcs[number]
    rows.steps(arcs, hit.direction, -1)
    rows.steps(surface.up_to(surface.curve_arcs[curve], int(surface.end[arcs[-1]])), along, 1)
    rows.close()


def _head_on(surface: _Surface, rows: _Rows, number: int) -> None:
    track = surface.tracks[number]
    hit = track.hit
    assert hit is not None
    other = surface.tracks[hit.other]
    last = track.steps[-1]
    side = 3 * last.face + np.arange(3)
    twin = surface.mesh.twin[side]
    level = surface.uv[:, 1 - last.direction % 2]
    low, high = (f(level[side], level[next_halfedge(side)]) for f in (np.minimum, np.maximum))
    over = (twin >= 0) & (twin // 3 == other.steps[-1].face)
    h = side[over & (low < last.level) & (last.level < high)][:1]
    wedge, quarter, sign = surface.develop(track, len(track.steps) - 1)
    rows.points(wedge, quarter + surface.rotation[h], sign)
    # ... over the edge between them, as in `develop`.
    rows.points(surface.wedge[next_halfedge(surface.mesh.twin[h])], np.array([0]), np.array([1]))
    rows.points(surface.wedge[h], surface.rotation[h], np.array([-1]))
    wedge, quarter, sign = surface.develop(other, len(other.steps) - 1)
    rows.points(wedge, quarter, -sign)
    for arcs in (surface.track_arcs[number], surface.track_arcs[hit.other]):
        rows.steps(arcs, hit.direction, -1)
    rows.close()


def _along(surface: _Surface, rows: _Rows, chain: Ints, factor: int, quarter: int = 0) -> None:
    """Add ``factor * i^quarter`` times the length of feature halfedges to the left side."""
    turn = quarter - surface.direction(chain)
    sign = np.full(len(chain), factor)
    rows.points(surface.wedge[next_halfedge(chain)], turn, sign)
    rows.points(surface.wedge[chain], turn, -sign)


def _anchors(aligned: AlignedField, space: SeamlessSpace, tracing: Tracing) -> Ints:
    """Scalars of one corner at a special vertex of each component."""
    mesh = aligned.mesh
    corners = np.flatnonzero(tracing.special[mesh.tail])
    component = mesh.face_component[corners // 3]
    wedge = space.wedge.reshape(-1)[corners[np.unique(component, return_index=True)[1]]]
    return np.asarray(np.stack([2 * wedge, 2 * wedge + 1], axis=1).ravel())


def solve_integers(
    equations: MapEquations, space: SeamlessSpace, lengths: Ints, anchors: Ints
) -> Ints:
    """Values of all unknowns for integer arc lengths; those that are not ``even`` are 0. (d,).

    Parameters
    ----------
    lengths : (a,) int64
        Quads along each arc.
    anchors : (2 c,) int64
        Values of the anchor scalars.

    Raises
    ------
    ParametrizationError
        If no integers solve the equations: the lengths contradict each other.
    """
    right = equations.lengths @ np.asarray(lengths, dtype=np.int64)
    right[-len(anchors) :] += anchors
    right *= space.denominator
    columns = np.flatnonzero(space.even)
    forms = equations.forms[:, columns]
    real = forms.astype(np.float64)
    normal = splu((real.T @ real).tocsc(), permc_spec="COLAMD")
    value = np.zeros(len(columns), dtype=np.int64)
    for _ in range(3):  # once, and twice more for what rounding may have cost
        rest = right - forms @ value
        if not rest.any():
            break
        value += np.rint(normal.solve(real.T @ rest.astype(np.float64))).astype(np.int64)
    if (forms @ value != right).any():
        raise ParametrizationError("the arc lengths do not belong to an integer-grid map")
    out = np.zeros(len(space.even), dtype=np.int64)
    out[columns] = value
    return out
