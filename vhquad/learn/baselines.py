"""Cross fields that need no learning, to compare a model with; all on vertices."""

from __future__ import annotations

import numpy as np

from vhquad.field.baseline import curvature_field
from vhquad.field.cross import CrossField
from vhquad.field.transport import to_vertices
from vhquad.geometry.curvature import curvature_cross
from vhquad.mesh.triangle import TriMesh

__all__ = ["curvature", "principal", "random_field"]


def random_field(mesh: TriMesh, rng: np.random.Generator) -> CrossField:
    """Independent random directions."""
    return CrossField("vertices", np.exp(2j * np.pi * rng.random(mesh.n_vertices)))


def principal(mesh: TriMesh) -> CrossField:
    """Principal curvature directions; z is 0 at umbilics."""
    return CrossField("vertices", curvature_cross(mesh).vertex_z)


def curvature(mesh: TriMesh) -> CrossField:
    """The smoothest field along the principal directions: that of ``--method curvature``."""
    return to_vertices(mesh, curvature_field(mesh))
