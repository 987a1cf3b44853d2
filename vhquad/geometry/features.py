"""Input features of the network: tangent vectors at vertices that depend on the shape alone.

"hks"       gradients of the heat kernel signature at 15 times (Sun et al. 2009)
"gaussian"  gradient of the Gaussian curvature
"mean"      gradient of the mean curvature
"pcd"       the two principal curvature directions
"local"     gradients of smoothed curvatures and principal lines, see ``local.py``

(The first four: paper, ablation studies.) Every channel of those is divided by its mean length over
the area; "local" keeps what its lengths say. Copies turned by a quarter turn may follow, all
together, behind the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from vhquad.errors import ConfigError
from vhquad.geometry.curvature import Curvature, vertex_curvature
from vhquad.geometry.delaunay import IntrinsicTriangulation
from vhquad.geometry.frames import Frames
from vhquad.geometry.laplacian import cotan_laplacian, gradient_operator, lumped_mass
from vhquad.geometry.local import RADII, local_curvature, local_lines, local_vectors
from vhquad.geometry.spectral import Spectrum, smallest_eigenpairs
from vhquad.mesh.triangle import TriMesh

__all__ = [
    "FEATURES",
    "HKS_TIMES",
    "Features",
    "ShapeContext",
    "compute_features",
    "heat_kernel_signature",
    "hks_gradients",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

HKS_TIMES = np.geomspace(0.07, 10.0, 15)
"""Times of the signature in units of area / 4 pi; below 0.07 they show where 128 pairs end."""

_FLOOR = 1e-6
"""Gradients below this share of a typical value / sqrt(area) are rounding, and stay small."""


@dataclass(frozen=True, eq=False)
class ShapeContext:
    """What features are computed from: one connected mesh and its intrinsic triangulation.

    Attributes
    ----------
    mesh : TriMesh
    frames : Frames
    tri : IntrinsicTriangulation
        Delaunay, in the same frames.
    k : int
        Eigenpairs of the scalar Laplacian that the heat kernel uses.
    """

    mesh: TriMesh
    frames: Frames
    tri: IntrinsicTriangulation
    k: int = 128


@dataclass(frozen=True, eq=False)
class Features:
    """What a network is given to see of a mesh, in the vertex frames, without units.

    Attributes
    ----------
    vectors : (n, c) complex128
        Tangent vectors: they turn with the frame.
    lines : (n, l) complex128
        Lines, as e^(2ia): they turn twice as fast. Only "local" has any.
    """

    vectors: Complexes
    lines: Complexes


def compute_features(name: str, shape: ShapeContext, turned: bool = True) -> Features:
    """Features by name.

    Parameters
    ----------
    name : {"hks", "gaussian", "mean", "pcd", "local"}
    shape : ShapeContext
    turned : bool
        Append i times each vector. Never done for "pcd", whose channels are at right angles.

    Returns
    -------
    Features
        All but "local" of mean length 1 (less where the shape has none, as a flat sheet has no
        curvature).

    Raises
    ------
    ConfigError
        If the name is unknown.
    """
    if name not in FEATURES:
        raise ConfigError(f"unknown features {name!r}; choose from {', '.join(FEATURES)}")
    features = FEATURES[name](shape)
    if not turned or name == "pcd":
        return features
    return Features(np.hstack([features.vectors, 1j * features.vectors]), features.lines)


def heat_kernel_signature(spectrum: Spectrum, times: Floats) -> Floats:
    """``sum_i exp(-lambda_i t) phi_i(x)^2`` at each vertex and time; (n, t), 1 / area.

    Squares, summed over whole eigenspaces: signs and bases of the eigenvectors do not matter.
    """
    decay = np.exp(-np.outer(spectrum.eigenvalues, times))
    return np.asarray(np.abs(spectrum.eigenvectors) ** 2 @ decay)


def hks_gradients(spectrum: Spectrum, shape: ShapeContext) -> Complexes:
    """Gradients of the signature at ``HKS_TIMES``, mean length 1; (n, 15).

    The constant eigenfunctions have no gradient and are left out: what remains of a late signature
    may be 1e-9 of them and would drown in their rounding.

    Parameters
    ----------
    spectrum : Spectrum
        Of the scalar Laplacian.
    shape : ShapeContext
    """
    mass = lumped_mass(shape.tri)
    label = np.zeros(len(mass), dtype=np.int64)
    label[shape.mesh.faces.reshape(-1)] = np.repeat(shape.mesh.face_component, 3)
    parts = int(label.max()) + 1
    values, vectors = spectrum.eigenvalues[parts:], spectrum.eigenvectors[:, parts:]
    signature = np.zeros((len(mass), len(HKS_TIMES)))
    for component in range(parts):  # few
        rows = label == component
        times = HKS_TIMES * mass[rows].sum() / (4.0 * np.pi)
        signature[rows] = heat_kernel_signature(Spectrum(values, vectors[rows]), times)
    return _gradients(signature, signature.mean(axis=0), shape)


def _hks(shape: ShapeContext) -> Features:
    mass = lumped_mass(shape.tri)
    spectrum = smallest_eigenpairs(cotan_laplacian(shape.tri), mass, shape.k)
    return _vectors(hks_gradients(spectrum, shape))


def _gaussian(shape: ShapeContext) -> Features:
    typical = 1.0 / shape.tri.face_areas.sum()
    return _vectors(_gradients(_curvature(shape).gaussian[:, None], typical, shape))


def _mean(shape: ShapeContext) -> Features:
    typical = 1.0 / np.sqrt(shape.tri.face_areas.sum())
    return _vectors(_gradients(_curvature(shape).mean[:, None], typical, shape))


def _pcd(shape: ShapeContext) -> Features:
    """Principal directions; a line has no sign, the slope of the mean curvature gives it one."""
    curvature = _curvature(shape)
    slope = gradient_operator(shape.tri) @ curvature.mean
    first = curvature.direction
    second = 1j * first
    channels = [np.where((d * slope.conj()).real < 0, -d, d) for d in (first, second)]
    return _vectors(_normalised(np.stack(channels, axis=1), lumped_mass(shape.tri), 0.0))


def _local(shape: ShapeContext) -> Features:
    radii = RADII * np.sqrt(shape.tri.face_areas.sum())
    curvature = local_curvature(shape.mesh, shape.frames, shape.tri, radii)
    return Features(local_vectors(curvature), local_lines(curvature))


def _vectors(channels: Complexes) -> Features:
    return Features(channels, np.zeros((len(channels), 0), dtype=np.complex128))


def _curvature(shape: ShapeContext) -> Curvature:
    return vertex_curvature(shape.mesh, shape.frames, shape.tri)


def _gradients(values: Floats, typical: float | Floats, shape: ShapeContext) -> Complexes:
    mass = lumped_mass(shape.tri)
    operator: csr_matrix = gradient_operator(shape.tri)
    return _normalised(operator @ values, mass, _FLOOR * typical / np.sqrt(mass.sum()))


def _normalised(channels: Complexes, mass: Floats, floor: float | Floats) -> Complexes:
    """Divide each channel by its mean length over the area, or by the floor if that is less."""
    length = mass @ np.abs(channels) / mass.sum()
    length = np.maximum(length, floor)
    return np.divide(channels, length, out=np.zeros_like(channels), where=length > 0)


FEATURES: dict[str, Callable[[ShapeContext], Features]] = {
    "hks": _hks,
    "gaussian": _gaussian,
    "mean": _mean,
    "pcd": _pcd,
    "local": _local,
}
"""Names of the features, and what computes them."""
