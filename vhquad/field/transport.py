"""Cross fields from vertices to faces and back.

Crosses are averaged as fourth powers, carried by ``vertex_to_face ** 4`` of
``vhquad.geometry.frames``; sizes and confidences are averaged apart from them, because the mean of
crosses that disagree is short and would make small quads of them. Sizes are averaged as logarithms:
quads twice and half as large make a mean of one.

Reference: Gao et al., "A vector heat network for quad meshing", the section on vertices to faces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import Frames, build_frames
from vhquad.mesh.triangle import TriMesh

__all__ = ["to_faces", "to_vertices"]

Floats = NDArray[np.float64]


def to_faces(mesh: TriMesh, field: CrossField, frames: Frames | None = None) -> CrossField:
    """The mean cross of the three corners of each face.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On vertices; one on faces is returned as it is.
    frames : Frames, optional
        Those of the mesh, if at hand.

    Returns
    -------
    CrossField
        On faces. ``z`` is 0 where the corners cancel each other; the size is 0 where no corner
        has one.

    Raises
    ------
    FieldError
        If the field is not one of this mesh.
    """
    _expect_fit(mesh, field)
    if field.domain == "faces":
        return field
    frames = build_frames(mesh) if frames is None else frames
    corner = mesh.faces
    trust = np.ones(len(field)) if field.confidence is None else field.confidence
    carried = frames.vertex_to_face**4 * field.z[corner]
    z = (_weights(trust[corner]) * carried).sum(axis=1)
    z[np.abs(z) < 1e-12] = 0.0
    size = None
    if field.size is not None:
        size = _mean_size(field.size[corner])
    confidence = None if field.confidence is None else trust[corner].mean(axis=1)
    return CrossField("faces", z, size, confidence)


def to_vertices(mesh: TriMesh, field: CrossField, frames: Frames | None = None) -> CrossField:
    """The mean cross of the faces around each vertex, weighted by the angle of their corners.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On faces; one on vertices is returned as it is.
    frames : Frames, optional
        Those of the mesh, if at hand.

    Returns
    -------
    CrossField
        On vertices; ``z`` is 0 at unused ones and where the faces cancel each other.

    Raises
    ------
    FieldError
        If the field is not one of this mesh.
    """
    _expect_fit(mesh, field)
    if field.domain == "vertices":
        return field
    frames = build_frames(mesh) if frames is None else frames
    n, vertex = mesh.n_vertices, mesh.tail
    angle = frames.corner_angle.reshape(-1)
    face = np.repeat(np.arange(mesh.n_faces), 3)
    trust = np.ones(len(field)) if field.confidence is None else field.confidence
    total = np.bincount(vertex, angle, n)
    total[total == 0.0] = 1.0
    believed = np.bincount(vertex, angle * trust[face], n) / total
    weight = np.where(believed[vertex] > 0, trust[face], 1.0) * angle
    carried = frames.vertex_to_face.reshape(-1).conj() ** 4 * field.z[face] * weight
    z = np.bincount(vertex, carried.real, n) + 1j * np.bincount(vertex, carried.imag, n)
    z[np.abs(z) < 1e-12 * total] = 0.0
    size = None
    if field.size is not None:
        known = angle * (field.size[face] > 0)
        logs = np.log(np.where(known > 0, field.size[face], 1.0))
        mass = np.bincount(vertex, known, n)
        mean = np.bincount(vertex, known * logs, n) / np.where(mass > 0, mass, 1.0)
        size = np.where(mass > 0, np.exp(mean), 0.0)
    return CrossField("vertices", z, size, None if field.confidence is None else believed)


def _expect_fit(mesh: TriMesh, field: CrossField) -> None:
    expected = mesh.n_faces if field.domain == "faces" else mesh.n_vertices
    if len(field) != expected:
        raise FieldError(f"the field has {len(field)} crosses, the mesh {expected} {field.domain}")


def _weights(trust: Floats) -> Floats:
    """Weights that sum to 1 in each row; equal where nothing is trusted."""
    total = trust.sum(axis=1, keepdims=True)
    return np.where(total > 0, trust / np.where(total > 0, total, 1.0), 1.0 / trust.shape[1])


def _mean_size(size: Floats) -> Floats:
    """Geometric mean of the positive sizes in each row, 0 if there is none."""
    known = size > 0
    count = known.sum(axis=1)
    logs = np.log(np.where(known, size, 1.0)).sum(axis=1)
    return np.where(count > 0, np.exp(logs / np.maximum(count, 1)), 0.0)
