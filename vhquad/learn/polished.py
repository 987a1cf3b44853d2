"""Fields as a remesh smooths and aligns them before it makes a map, and how far these are off."""

from __future__ import annotations

import numpy as np

from vhquad.errors import FieldError
from vhquad.field.align import AlignedField, AlignSettings, align_field
from vhquad.field.cross import CrossField
from vhquad.field.transport import to_faces
from vhquad.geometry.frames import face_axes, to_3d
from vhquad.learn.scores import FieldErrors
from vhquad.mesh.triangle import TriMesh

__all__ = ["compare_polished", "polished"]


def polished(mesh: TriMesh, field: CrossField, edge_length: float) -> AlignedField | None:
    """A field as a remesh smooths and aligns it before it makes a map.

    As in :mod:`vhquad.quad.pipeline`, without creases: singularities would move onto these.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On vertices or faces.
    edge_length : float
        Of the quads to come.

    Returns
    -------
    AlignedField or None
        None if the mesh is too coarse for any legal field.
    """
    try:
        return align_field(
            mesh, to_faces(mesh, field), settings=AlignSettings(edge_length=edge_length)
        )
    except FieldError:
        return None


def compare_polished(aligned: AlignedField, mesh: TriMesh, truth: CrossField) -> FieldErrors | None:
    """Errors of a field that a remesh has smoothed, on its faces.

    Parameters
    ----------
    aligned : AlignedField
        Its faces are those of the mesh, or parts of them.
    mesh : TriMesh
    truth : CrossField
        On the vertices; faces of which a corner is unknown do not count.

    Returns
    -------
    FieldErrors or None
        None if there is no other face.
    """
    wanted = to_faces(mesh, truth)
    coherence = np.ones(mesh.n_faces) if wanted.confidence is None else wanted.confidence
    known = (truth.z != 0)[mesh.faces].all(axis=1) & (wanted.z != 0)
    of = aligned.parent_face
    weight = aligned.mesh.face_areas * (coherence * known)[of]
    if not weight.sum() > 0:
        return None
    arms = to_3d(np.exp(0.25j * np.angle(wanted.z)), face_axes(mesh))
    own = to_3d(np.exp(1j * aligned.angle), face_axes(aligned.mesh))
    cosine = np.einsum("fi,fi->f", arms[of], own).clip(-1.0, 1.0)
    return FieldErrors(weight / weight.sum(), np.cos(4.0 * np.arccos(cosine)), None)
