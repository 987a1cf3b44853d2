"""Where a prediction is in doubt, the smooth curvature-aligned field takes over.

``z = c z_predicted + (1 - c) k z_curvature``, with the confidence c of the prediction and what the
curvature has to say, k, of all that it can: on a plane or a sphere even a doubtful prediction
decides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.baseline import curvature_field
from vhquad.field.cross import SURE, CrossField
from vhquad.field.transport import to_vertices
from vhquad.mesh.triangle import TriMesh

__all__ = ["blend", "lean_on_curvature"]

EVENED = 0.5  # share of the sizes' variation (of logarithms) that goes where nothing is trusted


def lean_on_curvature(mesh: TriMesh, field: CrossField) -> CrossField:
    """A predicted field, blended with the curvature's where its confidence is below 1.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On the vertices, as :func:`vhquad.learn.predict.predict_field` makes it.

    Returns
    -------
    CrossField
        On the vertices. Its confidence is the modulus of the blend: 1 where the prediction is
        certain, what the curvature has to say where that decides (at most what curvature can be
        sure of), less where the two contradict each other. Crosses that were not predicted (0) stay
        unknown.
    """
    doubtful = field.z != 0
    if field.confidence is not None:
        doubtful &= field.confidence < 1.0
    if field.confidence is None or not doubtful.any():
        return field
    return blend(mesh, field, to_vertices(mesh, curvature_field(mesh)))


def blend(mesh: TriMesh, field: CrossField, curvature: CrossField) -> CrossField:
    """Blend a predicted field and that of the curvature on the vertices by their confidences.

    Sizes of the first are evened out towards the geometric mean over the component where its
    confidence is low. The blend is no surer than the prediction and the curvature are.
    """
    c, k = (np.ones(len(f)) if f.confidence is None else f.confidence for f in (field, curvature))
    z = np.where(field.z != 0, c * field.z + (1.0 - c) * (k / SURE) * curvature.z, 0.0)
    trust = np.minimum(np.abs(z), c + (1.0 - c) * SURE)
    return CrossField("vertices", z, _evened(mesh, field, c), trust)


def _evened(mesh: TriMesh, field: CrossField, c: NDArray[np.float64]) -> NDArray[np.float64] | None:
    if field.size is None:
        return None
    component = np.zeros(mesh.n_vertices, dtype=np.int64)
    component[mesh.faces] = mesh.face_component[:, None]
    known = field.size > 0
    logs = np.log(np.where(known, field.size, 1.0))
    area = mesh.vertex_areas * known
    total = np.bincount(component, area)
    mean = np.bincount(component, area * logs) / np.where(total > 0, total, 1.0)
    kept = 1.0 - EVENED * (1.0 - c)
    return np.where(known, np.exp(kept * logs + (1.0 - kept) * mean[component]), 0.0)
