"""Curvatures at vertices, measured over a metric neighbourhood, and the cross they suggest.

Curvature is first a measure: the angle defect at a vertex, the dihedral angle along an edge
(Cohen-Steiner and Morvan 2003). Dividing by area gives values. The neighbourhood is one implicit
Euler step of heat diffusion of the measure, by the Laplacian of the order that fits it (0 for
numbers, 2 for lines): it has a length in mesh units instead of a number of rings, so that another
triangulation of the same surface gives nearly the same curvature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.geometry.delaunay import IntrinsicTriangulation, intrinsic_delaunay
from vhquad.geometry.frames import Frames, build_frames
from vhquad.geometry.laplacian import (
    connection_laplacian,
    cotan_laplacian,
    diffuse,
    lumped_mass,
)
from vhquad.mesh.triangle import TriMesh

__all__ = [
    "Curvature",
    "CurvatureCross",
    "angle_defect",
    "curvature_cross",
    "vertex_curvature",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

RADIUS = 0.02
"""Default neighbourhood, in square roots of the total area (a head's mouth is about 0.1)."""

_FLAT = 1e-4
"""Curvature, in 1 / sqrt(total area), that counts as none."""


@dataclass(frozen=True, eq=False)
class Curvature:
    """Curvatures at the vertices; positive where the surface is convex (a sphere of radius r: 1/r).

    Attributes
    ----------
    gaussian : (n,) float64
        From angle defects; 1 / length^2. Border vertices take the value of those near them.
    mean : (n,) float64
        (k1 + k2) / 2 from dihedral angles; 1 / length.
    line : (n,) complex128
        ``(k1 - k2) / 2 * exp(2i a)``, a the angle of the direction of k1 in the vertex frame.
    """

    gaussian: Floats
    mean: Floats
    line: Complexes

    @property
    def k1(self) -> Floats:
        """Larger principal curvature; (n,)."""
        return np.asarray(self.mean + np.abs(self.line))

    @property
    def k2(self) -> Floats:
        """Smaller principal curvature; (n,)."""
        return np.asarray(self.mean - np.abs(self.line))

    @property
    def direction(self) -> Complexes:
        """Unit direction of k1 in the vertex frame, sign arbitrary, 0 where k1 = k2; (n,)."""
        return _unit(np.sqrt(_unit(self.line)))


@dataclass(frozen=True, eq=False)
class CurvatureCross:
    """The cross along the principal directions, with how much they differ.

    Attributes
    ----------
    vertex_z, face_z : (n,), (m,) complex128
        Fourth power of the unit principal directions in the vertex and face frames; 0 where the
        surface is flat or umbilic.
    vertex_weight, face_weight : (n,), (m,) float64
        ``d / (d + mean d)`` of ``d = |k1 - k2|``: in [0, 1), 0 where there is no direction.
    """

    vertex_z: Complexes
    vertex_weight: Floats
    face_z: Complexes
    face_weight: Floats


def angle_defect(mesh: TriMesh, frames: Frames) -> Floats:
    """Integrated Gaussian curvature: 2 pi minus the angle sum, 0 at border vertices; (n,)."""
    return np.where(mesh.is_boundary_vertex, 0.0, 2.0 * np.pi - frames.angle_sum)


def vertex_curvature(
    mesh: TriMesh,
    frames: Frames | None = None,
    tri: IntrinsicTriangulation | None = None,
    radius: float = RADIUS,
) -> Curvature:
    """Curvatures at the vertices over a neighbourhood of the given radius.

    Parameters
    ----------
    mesh : TriMesh
    frames : Frames, optional
    tri : IntrinsicTriangulation, optional
        Delaunay, of the same mesh and frames; made if not given.
    radius : float
        In square roots of the total area; 0 for the raw values.

    References
    ----------
    Cohen-Steiner and Morvan 2003, "Restricted Delaunay Triangulations and Normal Cycle".
    """
    frames = build_frames(mesh) if frames is None else frames
    tri = intrinsic_delaunay(mesh, frames) if tri is None else tri
    mass = lumped_mass(tri)
    time = radius**2 * float(mass.sum())

    # Each end of an edge gets half of its dihedral measure. The surface bends across the edge:
    # hence the minus, a quarter turn, of the line.
    measure = 0.5 * mesh.dihedral_angles * frames.lengths.reshape(-1)
    n = mesh.n_vertices
    total = np.bincount(mesh.tail, measure, n)
    turned = -0.5 * measure * np.exp(2j * frames.halfedge_angle)
    line = np.bincount(mesh.tail, turned.real, n) + 1j * np.bincount(mesh.tail, turned.imag, n)
    # A vertex sees each edge once, from its outgoing halfedge; border edges bend nowhere.
    inside = np.where(mesh.is_boundary_vertex, 0.0, mass)
    numbers = np.stack([0.5 * total, mass, angle_defect(mesh, frames), inside], axis=1)
    scalar = cotan_laplacian(tri)
    numbers = diffuse(scalar, mass, time, numbers / mass[:, None])
    line = diffuse(connection_laplacian(tri, order=2), mass, time, line / mass)
    gaussian = np.divide(numbers[:, 2], numbers[:, 3], out=np.zeros(n), where=numbers[:, 3] > 1e-12)
    return Curvature(gaussian, numbers[:, 0] / numbers[:, 1], line / numbers[:, 1])


def curvature_cross(
    mesh: TriMesh, frames: Frames | None = None, radius: float = RADIUS
) -> CurvatureCross:
    """The principal cross at vertices and faces: guidance for fields that follow the shape.

    Parameters
    ----------
    mesh : TriMesh
    frames : Frames, optional
    radius : float
        As in :func:`vertex_curvature`.
    """
    frames = build_frames(mesh) if frames is None else frames
    line = vertex_curvature(mesh, frames, radius=radius).line
    on_faces = (frames.vertex_to_face**2 * line[mesh.faces]).mean(axis=1)
    area = mesh.face_areas
    mean = float((np.abs(on_faces) * area).sum() / area.sum())
    floor = _FLAT / np.sqrt(area.sum())

    def split(q: Complexes) -> tuple[Complexes, Floats]:
        size = np.where(np.abs(q) > floor, np.abs(q), 0.0)
        return np.where(size > 0, _unit(q) ** 2, 0.0), size / (size + mean + floor)

    vertex_z, vertex_weight = split(line)
    face_z, face_weight = split(on_faces)
    return CurvatureCross(vertex_z, vertex_weight, face_z, face_weight)


def _unit(z: Complexes) -> Complexes:
    modulus = np.abs(z)
    return np.divide(z, modulus, out=np.zeros_like(z), where=modulus > 0)
