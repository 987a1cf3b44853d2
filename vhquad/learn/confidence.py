"""How far a prediction can be trusted, from what the network says of a shape and its mirror image.

The two answers, seen in the same frames, agree within a degree or two on shapes like those that the
network was trained on, and drift apart on others. Agreement costs nothing, since both answers are
there. (Other small changes, as fewer eigenvectors, features and times as of a cropped or extended
shape, features left out, told the same story less clearly of an earlier model.)

The constants were fitted to an earlier state of the shipped model by
``benchmarks/fit_confidence.py``, on validation heads and on two shapes other than heads; see
``models/README.md`` for the figures on others, with the present one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import cotan_laplacian, diffuse, lumped_mass
from vhquad.mesh.triangle import TriMesh

__all__ = ["agreement", "confidence"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LENGTH = 0.05  # the agreement is averaged over about this distance, in square roots of the area
SHAPE = 0.7  # how much the mean over the shape counts, against the vertex's own neighbourhood
NONE, FULL = 0.7, 0.98  # agreement that earns no confidence, and all of it
POWER = 3  # a rise late and steep


def agreement(own: Complexes, other: Complexes) -> Floats:
    """cos of the angle between two fields of N-th powers, (n,); 0 where one of them vanishes."""
    modulus = np.abs(own) * np.abs(other)
    product = (own * other.conj()).real
    return np.divide(product, modulus, out=np.zeros_like(product), where=modulus > 0)


def confidence(mesh: TriMesh, agreed: Floats) -> Floats:
    """Confidence at each vertex of one component.

    Parameters
    ----------
    mesh : TriMesh
        Connected.
    agreed : (n,) float64
        From :func:`agreement`, in [-1, 1].

    Returns
    -------
    (n,) float64
        In [0, 1].
    """
    tri = intrinsic_delaunay(mesh, build_frames(mesh))
    mass = lumped_mass(tri)
    near = diffuse(cotan_laplacian(tri), mass, LENGTH**2 * mass.sum(), agreed)
    level = SHAPE * (mass @ agreed) / mass.sum() + (1.0 - SHAPE) * near
    return np.clip((level - NONE) / (FULL - NONE), 0.0, 1.0) ** POWER
