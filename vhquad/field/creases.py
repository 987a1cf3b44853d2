"""Creases that quads of a size can follow: found by angle, grown and joined, no loose ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.bridge import bridge_gaps
from vhquad.field.features import find_creases, sharp_edges
from vhquad.field.grow import grow_creases, with_steps
from vhquad.field.prune import prune_branches
from vhquad.mesh.triangle import TriMesh

__all__ = ["LOOSE", "TOGETHER", "creases_for_quads"]

TOGETHER = 2.5
"""Quad edges over which creases must hang together."""
GAP = 0.75
"""Quad edges; creases that end so near others go on to them."""
LOOSE = 1.5
"""Quad edges; shorter creases that end loose are noise."""


def creases_for_quads(
    mesh: TriMesh, degrees: float, edge_length: float, together: float = TOGETHER
) -> NDArray[np.int64]:
    """Edges that quads shall follow.

    Parameters
    ----------
    mesh : TriMesh
    degrees : float
        Least angle between the normals of the two faces.
    edge_length : float
        Of the quads to come, in units of the mesh.
    together : float
        Least total length of a connected piece, in quad edges.

    Returns
    -------
    (k, 2) int64
        Vertex pairs.
    """
    found = find_creases(mesh, degrees, together * edge_length)
    sharp = sharp_edges(mesh, degrees)
    grown = grow_creases(mesh, found, sharp, degrees)
    stepped = with_steps(mesh, grown, sharp, together * edge_length)
    joined = bridge_gaps(mesh, stepped, GAP * edge_length)
    return prune_branches(mesh, joined, LOOSE * edge_length)
