"""Matchings: how the four directions of a face continue in its neighbours, and the indices.

On a halfedge ``h`` of face ``f`` with its twin in face ``g``, let ``phi_f`` and ``phi_g`` be the
angles of the two faces' chosen directions, both measured from ``h``. The direction of ``f`` goes
on as the one of ``g`` that is ``p`` quarter turns before the chosen one::

    phi_g - phi_f = p * pi/2 + jump[h],    rotation[h] = -p mod 4,    z_g = i**rotation[h] * z_f + t

with ``z = u + iv`` a map whose u axis follows the chosen direction. A plain matching takes
``|jump| <= pi/4``; moving a singularity (``vhquad.field.indices``) changes ``p`` instead and lets
``jump`` say so, which is why ``jump``, not ``p``, is what is kept.

On a feature halfedge (boundary or crease) the map's isoline leans off the edge by ``lean[h]``
(0 on creases; what smoothing took out of a rough boundary).

Corners around a vertex, joined across non-feature edges, make a *sector*. Its angle in the map is
``quads * pi/2``, and with S the corner angles' sum ::

    quads * pi/2 = S - sum_in jump + sum_in slant - sum_out slant

over the halfedges that point into and out of the vertex within the sector, where ``slant`` is the
map's direction of a feature halfedge less its own, both in the face's frame. A plain interior
vertex of index I has ``quads = 4 - 4 I``.

References: Knoeppel et al. 2013, "Globally optimal direction fields"; Bommes, Zimmer, Kobbelt
2009, "Mixed-integer quadrangulation", section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.field.dual import face_angles
from vhquad.field.refine import Refinement
from vhquad.mesh.triangle import TriMesh, next_halfedge

__all__ = ["MatchedField", "label_sectors", "match_field"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

QUARTER = np.pi / 2.0


@dataclass(frozen=True, eq=False)
class MatchedField:
    """A cross per face with its matchings; see the module head for every symbol.

    Attributes
    ----------
    mesh : TriMesh
    angle : (m,) float64
        Angle of the chosen direction in the face's frame (axis: halfedge 0), radians.
    feature : (3m,) bool
        Halfedges on a boundary or crease; a crease has both of its halfedges.
    lean : (3m,) float64
        Angle from a feature halfedge to the isoline that stands for it; 0 elsewhere.
    jump : (3m,) float64
        What the matching leaves over across a non-feature halfedge; 0 on features.
    seam : (3m,) bool, optional
        Boundary halfedges beyond which the surface goes on, mirrored.
    """

    mesh: TriMesh
    angle: Floats
    feature: Bools
    lean: Floats
    jump: Floats
    seam: Bools | None = None

    # ---- matchings ------------------------------------------------------------------------

    @cached_property
    def rotation(self) -> Ints:
        """``rotation`` of the module head, in 0..3; 0 on boundaries; (3m,)."""
        return np.mod(-self._periods(self.jump), 4)

    @cached_property
    def axis(self) -> Ints:
        """a in 0..3: the map sends a feature halfedge to direction i**a; -1 elsewhere; (3m,)."""
        return np.where(self.feature, np.mod(self._feature_quarters, 4), -1)

    def _periods(self, jump: Floats) -> Ints:
        """``p`` of every halfedge, 0 on boundaries."""
        change = _relative_change(self.mesh, self.angle)
        return np.where(self.mesh.twin >= 0, np.rint((change - jump) / QUARTER), 0).astype(np.int64)

    @cached_property
    def _direction(self) -> Floats:
        """Direction of each halfedge in the chart of its face; (3m,)."""
        return face_angles(self.mesh) - np.repeat(self.angle, 3)

    @cached_property
    def _feature_quarters(self) -> Ints:
        return np.rint((self._direction + self.lean) / QUARTER).astype(np.int64)

    # ---- sectors --------------------------------------------------------------------------

    @cached_property
    def _sectors(self) -> tuple[int, Ints]:
        return label_sectors(self.mesh, self.feature)

    @property
    def n_sectors(self) -> int:
        """Number of sectors."""
        return self._sectors[0]

    @property
    def corner_sector(self) -> Ints:
        """Sector of each corner; (3m,)."""
        return self._sectors[1]

    @cached_property
    def sector_vertex(self) -> Ints:
        """Vertex of each sector; (s,)."""
        vertex = np.zeros(self.n_sectors, dtype=np.int64)
        vertex[self.corner_sector] = self.mesh.tail
        return vertex

    @cached_property
    def sector_is_feature(self) -> Bools:
        """Whether feature halfedges delimit a sector, else it is a full fan; (s,)."""
        return self.touched(self.feature, ends=True)

    def touched(self, halfedges: Bools, ends: bool = False) -> Bools:
        """Sectors at the tails (and the heads, if ``ends``) of some halfedges; (s,) bool."""
        flag = np.zeros(self.n_sectors, dtype=bool)
        h = np.flatnonzero(halfedges)
        flag[self.corner_sector[h]] = True
        if ends:
            flag[self.corner_sector[next_halfedge(h)]] = True
        return flag

    @cached_property
    def sector_in_seam(self) -> Bools:
        """Sectors between two halfedges of a seam: mirrored, they are full fans; (s,)."""
        if self.seam is None:
            return np.zeros(self.n_sectors, dtype=bool)
        return self.touched(self.seam) & self.touched(
            np.roll(self.seam.reshape(-1, 3), 1, 1).ravel()
        )

    @cached_property
    def sector_turns(self) -> Floats:
        """``quads`` of each sector before rounding: integers up to rounding errors; (s,)."""
        every = np.arange(len(self.feature))
        start, end = self.corner_sector, self.corner_sector[next_halfedge(every)]
        change = _relative_change(self.mesh, self.angle)
        jump = np.where(self.feature, 0.0, change - self._periods(self.jump) * QUARTER)
        slant = np.where(self.feature, self._feature_quarters * QUARTER - self._direction, 0.0)
        count = self.n_sectors
        total = np.bincount(start, self.mesh.corner_angles.reshape(-1) - slant, count)
        total += np.bincount(end, slant - jump, count)
        return np.asarray(total / QUARTER, dtype=np.float64)

    @cached_property
    def sector_quads(self) -> Ints:
        """Quarter turns of the map's angle in each sector; (s,)."""
        return np.rint(self.sector_turns).astype(np.int64)

    @cached_property
    def sector_is_singular(self) -> Bools:
        """Whether a sector is no flat place: quads is not 4, or 2 at a feature; (s,)."""
        return self.sector_quads != np.where(self.sector_is_feature, 2, 4)

    # ---- refinement -----------------------------------------------------------------------

    def refined(self, step: Refinement) -> MatchedField:
        """The same field on a finer mesh; new vertices are flat, features are inherited."""
        return MatchedField(
            mesh=step.mesh,
            angle=self.angle[step.parent] - step.turn,
            feature=step.carry(self.feature, False),
            lean=step.carry(self.lean, 0.0),
            jump=step.carry(self.jump, 0.0),
            seam=None if self.seam is None else step.carry(self.seam, False),
        )


def label_sectors(mesh: TriMesh, feature: Bools) -> tuple[int, Ints]:
    """Number of sectors, and the sector of each corner; (3m,)."""
    h = np.flatnonzero(~feature)
    across = next_halfedge(mesh.twin[h])
    shape = (len(feature), len(feature))
    links = coo_matrix((np.ones(len(h), dtype=np.int8), (h, across)), shape=shape)
    count, label = connected_components(links, directed=False)
    return int(count), label.astype(np.int64)


def match_field(
    mesh: TriMesh, angle: Floats, feature: Bools, lean: Floats, seam: Bools | None = None
) -> MatchedField:
    """Match every face's cross with its neighbours' by the smallest turn.

    Parameters
    ----------
    mesh : TriMesh
    angle : (m,) float64
        Angle of one of the four directions in each face's frame, radians.
    feature : (3m,) bool
        Feature halfedges; must hold every boundary halfedge and both halfedges of a crease.
    lean : (3m,) float64
        See :class:`MatchedField`.
    seam : (3m,) bool, optional
        See :class:`MatchedField`.
    """
    change = _relative_change(mesh, angle)
    left_over = change - QUARTER * np.rint(change / QUARTER)
    # One halfedge of an edge decides, so that ties cannot be decided two ways.
    decides = np.arange(len(feature)) > mesh.twin
    jump = np.where(decides, left_over, -left_over[mesh.twin])
    return MatchedField(mesh, angle, feature, lean, np.where(feature, 0.0, jump), seam)


def _relative_change(mesh: TriMesh, angle: Floats) -> Floats:
    """``phi_g - phi_f`` across every halfedge, 0 on boundaries; (3m,)."""
    from_edge = np.repeat(angle, 3) - face_angles(mesh)
    return np.where(mesh.twin >= 0, from_edge[mesh.twin] - np.pi - from_edge, 0.0)
