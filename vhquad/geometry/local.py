"""Local features: curvature, how it changes, and the lines along which it is largest.

Curvature is a measure, as in ``curvature.py``, here smoothed over neighbourhoods of six metric
radii, from a fine mesh's edge to a good part of the shape, by two implicit Euler steps of heat
diffusion each (one step smooths too little for a gradient to be taken). What lies farther away than
the radius hardly counts, so that a shape looks the same after a part of it was cut off, up to the
unit: radii are shares of the square root of the area.

Tangent vectors: the gradients of the Gaussian and of the mean curvature, the same gradients
reflected at the principal lines, and the same multiplied by the curvatures themselves, which tell
ridges from valleys. Lines: the deviatoric shape operator. Values are in units of their
radius, so that they have no unit, divided by a typical value and compressed: the longer, the more,
but no longer than the logarithm of what they were. Unlike the heat kernel and the Gaussian
curvature, mean curvature and lines know how the surface lies in space: these features follow rigid
motion and change of scale, not bending.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from vhquad.geometry.curvature import angle_defect
from vhquad.geometry.delaunay import IntrinsicTriangulation
from vhquad.geometry.frames import Frames
from vhquad.geometry.laplacian import (
    connection_laplacian,
    cotan_laplacian,
    gradient_operator,
    lumped_mass,
)
from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.triangle import TriMesh

__all__ = ["RADII", "LocalCurvature", "local_curvature", "local_lines", "local_vectors"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

RADII = np.array([0.02, 0.032, 0.05, 0.08, 0.125, 0.2])
"""Radii of the neighbourhoods in square roots of the area (a head's mouth is about 0.1)."""

GAUSSIAN = np.array([0.02, 0.04, 0.075, 0.135, 0.23, 0.37])
MEAN = np.array([0.09, 0.13, 0.19, 0.28, 0.37, 0.50])
GAUSSIAN_SLOPE = np.array([0.014, 0.033, 0.064, 0.12, 0.22, 0.36])
MEAN_SLOPE = np.array([0.029, 0.043, 0.062, 0.091, 0.14, 0.20])
LINE = 0.075
"""Typical moduli, of heads and other shapes, whole and cropped, in units of the radii."""

STEPS = 2


@dataclass(frozen=True, eq=False)
class LocalCurvature:
    """Curvature at each vertex over several neighbourhoods, in units of their radii.

    Attributes
    ----------
    gaussian : (n, r) float64
        Gaussian curvature times radius^2.
    mean : (n, r) float64
        Mean curvature times the radius, positive where convex.
    gaussian_slope : (n, r) complex128
        Gradient of the Gaussian curvature times radius^3.
    mean_slope : (n, r) complex128
        Gradient of the mean curvature times radius^2.
    line : (n, r) complex128
        ``(k1 - k2) / 2 exp(2i a)`` times the radius, a the angle of the direction of k1.
    """

    gaussian: Floats
    mean: Floats
    gaussian_slope: Complexes
    mean_slope: Complexes
    line: Complexes


def local_curvature(
    mesh: TriMesh, frames: Frames, tri: IntrinsicTriangulation, radii: Floats
) -> LocalCurvature:
    """Smoothed curvatures.

    Parameters
    ----------
    mesh : TriMesh
    frames : Frames
    tri : IntrinsicTriangulation
        Delaunay, of the same mesh and frames.
    radii : (r,) float64
        In units of the mesh.

    References
    ----------
    Cohen-Steiner and Morvan 2003, "Restricted Delaunay Triangulations and Normal Cycle".
    """
    mass, n = lumped_mass(tri), mesh.n_vertices
    # Each end of an edge gets half of its dihedral measure; the surface bends across the edge.
    bend = 0.5 * mesh.dihedral_angles * frames.lengths.reshape(-1)
    turned = -0.5 * bend * np.exp(2j * frames.halfedge_angle)
    line = np.bincount(mesh.tail, turned.real, n) + 1j * np.bincount(mesh.tail, turned.imag, n)
    # The defect of a border vertex is no curvature: its area is left out of the mean.
    inside = np.where(mesh.is_boundary_vertex, 0.0, mass)
    bends = 0.5 * np.bincount(mesh.tail, bend, n)
    numbers = np.stack([bends, angle_defect(mesh, frames), inside], axis=1) / mass[:, None]
    scalar, lines = cotan_laplacian(tri), connection_laplacian(tri, order=2)
    gradient = gradient_operator(tri)
    found: tuple[list[NDArray], ...] = ([], [], [], [], [])
    step: SymmetricFactor | None = None
    turn: SymmetricFactor | None = None
    for radius in radii:
        step = _step(scalar, mass, radius**2, step)
        turn = _step(lines, mass, radius**2, turn)
        near = _smoothed(step, mass, numbers)
        gaussian = np.divide(near[:, 1], near[:, 2], out=np.zeros(n), where=near[:, 2] > 1e-12)
        found[0].append(radius**2 * gaussian)
        found[1].append(radius * near[:, 0])
        found[2].append(radius**3 * (gradient @ gaussian))
        found[3].append(radius**2 * (gradient @ near[:, 0]))
        found[4].append(radius * _smoothed(turn, mass, line / mass))
    return LocalCurvature(*(np.stack(part, axis=1) for part in found))


def local_vectors(curvature: LocalCurvature) -> Complexes:
    """Tangent vectors of the network's input; (n, 6 r) complex128.

    The two gradients, both reflected at the lines (times the lines' strength), and both times the
    curvature that they are of (mean curvature: times what it is above the typical).
    """
    q = curvature.line / LINE
    slopes = curvature.gaussian_slope / GAUSSIAN_SLOPE, curvature.mean_slope / MEAN_SLOPE
    plain = [_compressed(slope) for slope in slopes]
    reflected = [_compressed(q * s.conj() / np.sqrt(1.0 + np.abs(s) ** 2)) for s in slopes]
    level = np.arcsinh(curvature.gaussian / GAUSSIAN), np.arcsinh(curvature.mean / MEAN) - 1.0
    return np.hstack([*plain, *reflected, *(v * t for v, t in zip(plain, level, strict=True))])


def local_lines(curvature: LocalCurvature) -> Complexes:
    """Second-order input of the network; (n, r) complex128."""
    return _compressed(curvature.line / LINE)


def _compressed(x: Complexes) -> Complexes:
    """The same direction, the inverse hyperbolic sine of the length."""
    length = np.abs(x)
    return x * np.divide(np.arcsinh(length), length, out=np.ones_like(length), where=length > 1e-9)


def _step(
    laplacian: csr_matrix, mass: Floats, time: float, like: SymmetricFactor | None
) -> SymmetricFactor:
    """Factor of one of ``STEPS`` implicit Euler steps of heat diffusion for a time."""
    return SymmetricFactor(diags_array(mass) + time / STEPS * laplacian, like)


def _smoothed(step: SymmetricFactor, mass: Floats, u: NDArray) -> NDArray:
    """Values (n,) or (n, c) after all steps."""
    weight = mass.reshape((-1,) + (1,) * (u.ndim - 1))
    for _ in range(STEPS):
        u = step.solve(weight * u)
    return u
