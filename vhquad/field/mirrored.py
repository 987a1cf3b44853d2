"""Cross fields and mirror planes: a field made symmetric, and carried to the half of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import Axes, face_axes, from_3d, to_3d
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.mirror import Half
from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.triangle import TriMesh

__all__ = ["to_half", "with_mirror_image"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_NEAR = 0.01
"""Share of the diagonal at which a mirror image is too far from the surface to say much."""
_AGREE = 0.1
"""Least length of a mean of two crosses that agree enough."""


def with_mirror_image(mesh: TriMesh, field: CrossField, plane: MirrorPlane) -> CrossField:
    """The mean of a field and its mirror image, as far as the surface is symmetric.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On faces.
    plane : MirrorPlane

    Returns
    -------
    CrossField
        On faces. Crosses that contradict their images stay as they are.

    Raises
    ------
    FieldError
        If the field is not on the faces of the mesh.
    """
    _expect_faces(mesh, field)
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    hits = ClosestPoints(mesh).query(plane.reflect(middle))
    other, axes = hits.face, face_axes(mesh)
    normal = plane.reflect_vectors(mesh.face_normals[other])
    alike = np.einsum("fi,fi->f", normal, mesh.face_normals).clip(min=0.0)
    weight = alike * np.exp(-((hits.distance / (_NEAR * mesh.diagonal)) ** 2))
    direction = plane.reflect_vectors(to_3d(_direction(field), axes))
    image = np.where(field.z[other] != 0, _fourth_power(direction[other], axes), 0.0)
    mean = field.z + weight * image
    z = np.where(np.abs(mean) > _AGREE, mean, field.z)
    size = field.size
    if size is not None:
        known = (size > 0) & (size[other] > 0)
        ratio = np.divide(size[other], size, out=np.ones_like(size), where=known)
        size = size * ratio ** (weight / (1.0 + weight))
    return CrossField("faces", z, size, field.confidence)


def to_half(mesh: TriMesh, field: CrossField, half: Half) -> CrossField:
    """The field on the faces of a half: the crosses of the faces that they are part of.

    Parameters
    ----------
    mesh : TriMesh
        The whole.
    field : CrossField
        On its faces.
    half : Half

    Raises
    ------
    FieldError
        If the field is not on the faces of the mesh.
    """
    _expect_faces(mesh, field)
    source = half.face_source
    direction = to_3d(_direction(field), face_axes(mesh))[source]
    image = half.plane.reflect_vectors(direction)
    direction = np.where(half.is_image[:, None], image, direction)
    z = _fourth_power(direction, face_axes(half.mesh))
    return CrossField(
        "faces",
        np.where(field.z[source] != 0, z, 0.0),
        None if field.size is None else field.size[source],
        None if field.confidence is None else field.confidence[source],
    )


def _expect_faces(mesh: TriMesh, field: CrossField) -> None:
    if field.domain != "faces" or len(field) != mesh.n_faces:
        raise FieldError(
            f"expected a cross for each of {mesh.n_faces} faces, not {len(field)} on {field.domain}"
        )


def _direction(field: CrossField) -> Complexes:
    """One of the four directions of each cross."""
    return np.asarray(np.exp(1j * field.angle))


def _fourth_power(direction: Floats, axes: Axes) -> Complexes:
    """Crosses of directions in space, projected to the faces' planes."""
    u = from_3d(direction, axes)
    length = np.abs(u)
    return np.divide(u, length, out=np.zeros_like(u), where=length > 1e-12) ** 4
