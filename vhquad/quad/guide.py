"""The cross field as the polish sees it: directions that the edges of quads should keep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.align import AlignedField
from vhquad.geometry.frames import face_axes, to_3d
from vhquad.mesh.closest import ClosestPoints
from vhquad.quad.distortion import cross, unit

__all__ = ["FieldGuide"]

Floats = NDArray[np.float64]


class FieldGuide:
    """Crosses of an aligned field at points near its surface.

    Parameters
    ----------
    aligned : AlignedField
    """

    def __init__(self, aligned: AlignedField) -> None:
        self._surface = ClosestPoints(aligned.mesh)
        self._axis = to_3d(np.exp(1j * aligned.angle), face_axes(aligned.mesh))
        self._normal = aligned.mesh.face_normals
        self._trust = aligned.trust

    def trust(self, points: Floats) -> Floats:
        """Trust in the cross at each point, in [0, 1]; (q,)."""
        return np.asarray(self._trust[self._surface.query(points).face])

    def along(self, points: Floats, near: Floats) -> Floats:
        """The arm of the cross at each point that is nearest to a direction; (q, 3), unit."""
        face = self._surface.query(points).face
        first = self._axis[face]
        second = cross(self._normal[face], first)
        x = np.einsum("qi,qi->q", first, near)
        y = np.einsum("qi,qi->q", second, near)
        arm = np.where((np.abs(x) >= np.abs(y))[:, None], first, second)
        return np.asarray(unit(arm) * np.sign(np.where(np.abs(x) >= np.abs(y), x, y))[:, None])
