"""Known parts: those where the field is sure of nearly all quads, so that its detail is meant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh

__all__ = ["known_parts"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SURE = 0.5  # trust in the field at a face
SHARE = 0.8  # of the quads of a part, at faces where the field is sure


def known_parts(mesh: TriMesh, field: CrossField, size: Floats) -> Bools:
    """Which components are known; (n_components,).

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On its faces.
    size : (m,) float64
        Length of quad edges at each face, up to a factor.
    """
    quads = mesh.face_areas / size**2
    sure = np.bincount(mesh.face_component, quads * (field.trust > SURE))
    return np.asarray(sure > SHARE * np.bincount(mesh.face_component, quads))
