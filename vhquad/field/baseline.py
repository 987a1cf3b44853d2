"""The field of a mesh without any learning: smooth, along the principal curvature directions.

Where the surface bends one way more than the other, quads should follow; elsewhere the smoothest
continuation decides (Knoeppel et al. 2013, section 5, with guidance weighted by its strength).
"""

from __future__ import annotations

import numpy as np

from vhquad.field.cross import SURE, CrossField
from vhquad.field.smooth import relaxed
from vhquad.geometry.curvature import curvature_cross
from vhquad.mesh.triangle import TriMesh

__all__ = ["curvature_field"]

LENGTH = 0.05
FAINT = 1e-4  # where nothing is known, a trace of trust in the smoothest continuation


def curvature_field(mesh: TriMesh, length: float = LENGTH) -> CrossField:
    """The smoothest cross field that follows the principal directions where they are clear.

    Parameters
    ----------
    mesh : TriMesh
        Manifold.
    length : float
        Details smaller than this are smoothed away; in square roots of the total area.

    Returns
    -------
    CrossField
        On faces, without sizes. The confidence is how much the curvature has to say at a face, and
        never quite sure: its detail is noise as often as not.
    """
    cross = curvature_cross(mesh)
    weight = cross.face_weight * mesh.face_areas / (length**2 * mesh.area)
    z = relaxed(mesh, cross.face_z, weight)
    known = np.bincount(mesh.face_component, weight)[mesh.face_component] > 0
    said = SURE * np.where(known, np.abs(z), 0.0)
    return CrossField("faces", z, None, np.clip(said, FAINT, SURE))
