"""Limbs that a polish slides off, given back: some vertices held where the layout has them.

The energy of the polish knows the quads, not how much of the surface they cover. Where a limb is
thinner than the wanted size, its quads would rather be wider than the limb is, and slide off. The
layout of the map covers every limb, so its vertices nearest to the places laid bare are held, and
the polish is done again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh

__all__ = ["Covering", "polished_onto_limbs"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

BARE = 1.25  # mean edge lengths between a place of the surface and quads that have left it bare
FARTHER = 1.5  # than the layout, at least: what that does not reach, no polish can
APART = 2.0  # mean edge lengths between places looked after in one round
ROUNDS = 5  # one is enough as a rule; each takes another polish, so a hopeless limb must end it


@dataclass(frozen=True, eq=False)
class Covering:
    """What quads of given corners cover of a surface, by the vertices of the surface.

    Attributes
    ----------
    layout : QuadMesh
        Quads that cover all that can be covered.
    surface : ClosestPoints
    """

    layout: QuadMesh
    surface: ClosestPoints

    @property
    def length(self) -> float:
        """Mean edge length of the quads."""
        return float(np.sqrt(self.surface.mesh.area / self.layout.n_quads))

    def bare(self, vertices: Floats) -> Ints:
        """Vertices of the surface that the quads have left, farthest first."""
        points = self.surface.mesh.vertices
        far = self._quads(vertices).distance(points)
        bare = np.flatnonzero(far > BARE * self.length)
        if len(bare):  # seldom: only then does it matter how far off the layout was
            least = self._quads(self.layout.vertices).distance(points[bare])
            bare = bare[far[bare] > FARTHER * least]
        return bare[np.argsort(-far[bare], kind="stable")]

    def _quads(self, vertices: Floats) -> ClosestPoints:
        """Quads with the corners of the layout and other positions."""
        return ClosestPoints(TriMesh(vertices, self.layout.triangles()))

    def keepers(self, bare: Ints) -> Ints:
        """Vertices of the layout nearest to some bare places that are apart from each other."""
        chosen: list[Floats] = []
        points = self.surface.mesh.vertices[bare]
        while len(points):  # few: one or two a limb
            chosen.append(points[0])
            points = points[np.linalg.norm(points - points[0], axis=1) > APART * self.length]
        at = self.layout.vertices
        return np.array([np.linalg.norm(at - p, axis=1).argmin() for p in chosen], dtype=np.int64)


def polished_onto_limbs(
    covering: Covering, fixed: Bools, polish: Callable[[Bools], Floats]
) -> Floats:
    """Polish, holding ever more vertices of the layout until no limb is left bare.

    Parameters
    ----------
    covering : Covering
    fixed : (n,) bool
        Vertices that never move.
    polish : callable
        Positions (n, 3) from vertices to hold (n,).

    Returns
    -------
    (n, 3) float64
    """
    held, moved = fixed, polish(fixed)
    for _ in range(ROUNDS):
        bare = covering.bare(moved)
        more = held.copy()
        more[covering.keepers(bare)] = True
        if (more == held).all():
            break
        held = more
        moved = polish(held)
    return moved
