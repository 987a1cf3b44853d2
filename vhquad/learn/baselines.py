"""Cross fields that need no learning, to compare a model with; all on vertices.

- random directions,
- principal curvature directions,
- the smoothest field that follows the principal directions where they are pronounced (Knoppel et
  al. 2013): minimise ``z^H L z + sum_i M_i w_i |z_i - c_i|^2 / l^2`` with the connection Laplacian
  L of order 4, the principal cross c, its strength w, and the length l below which detail is
  smoothed away.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags_array
from scipy.sparse.linalg import splu

from vhquad.field.cross import CrossField
from vhquad.geometry.curvature import curvature_cross
from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import connection_laplacian, lumped_mass
from vhquad.mesh.triangle import TriMesh

__all__ = ["LENGTHS", "curvature_aligned", "principal", "random_field"]

LENGTHS = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Smoothing lengths that :mod:`vhquad.learn.evaluate` tries, in square roots of the area."""


def random_field(mesh: TriMesh, rng: np.random.Generator) -> CrossField:
    """Independent random directions."""
    return CrossField("vertices", np.exp(2j * np.pi * rng.random(mesh.n_vertices)))


def principal(mesh: TriMesh) -> CrossField:
    """Principal curvature directions; z is 0 at umbilics."""
    return CrossField("vertices", curvature_cross(mesh).vertex_z)


def curvature_aligned(mesh: TriMesh, lengths: tuple[float, ...] = LENGTHS) -> list[CrossField]:
    """The smoothest curvature-aligned field for each smoothing length.

    Parameters
    ----------
    mesh : TriMesh
        Manifold.
    lengths : tuple of float
        In square roots of the area.
    """
    frames = build_frames(mesh)
    tri = intrinsic_delaunay(mesh, frames)
    laplacian, mass = connection_laplacian(tri, 4), lumped_mass(tri)
    cross = curvature_cross(mesh, frames)
    fields = []
    for length in lengths:
        pull = mass * (cross.vertex_weight + 1e-6) / (length**2 * mass.sum())
        matrix = (laplacian + diags_array(pull)).tocsc()
        z = splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(pull * cross.vertex_z)
        fields.append(CrossField("vertices", z))
    return fields
