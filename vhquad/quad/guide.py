"""The cross field as the polish sees it: directions that the edges of quads should keep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.align import AlignedField
from vhquad.geometry.frames import face_axes, to_3d
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.vectors import cross, unit

__all__ = ["FieldGuide"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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

    def faces(self, points: Floats) -> Ints:
        """The face of the surface nearest to each point; (q,)."""
        return self._surface.faces(points)

    def trust(self, faces: Ints) -> Floats:
        """Trust in the crosses of faces, in [0, 1]; (q,)."""
        return np.asarray(self._trust[faces])

    def along(self, faces: Ints, near: Floats) -> Floats:
        """The arm of the cross of each face that is nearest to a direction; (q, 3), unit."""
        first = self._axis[faces]
        second = cross(self._normal[faces], first)
        x = np.einsum("qi,qi->q", first, near)
        y = np.einsum("qi,qi->q", second, near)
        arm = np.where((np.abs(x) >= np.abs(y))[:, None], first, second)
        return np.asarray(unit(arm) * np.sign(np.where(np.abs(x) >= np.abs(y), x, y))[:, None])
