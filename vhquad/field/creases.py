"""Creases that quads of a size can follow: found by angle, grown and joined, no loose ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.bridge import bridge_gaps
from vhquad.field.features import crease_halfedges, find_creases, sharp_edges
from vhquad.field.grow import are_mostly_creases, grow_creases, with_steps
from vhquad.field.prune import prune_branches
from vhquad.mesh.triangle import TriMesh

__all__ = ["LOOSE", "TOGETHER", "creases_for_quads", "without_known"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOGETHER = 2.5
"""Quad edges over which creases must hang together."""
GAP = 0.75
"""Quad edges; creases that end so near others go on to them."""
LOOSE = 1.5
"""Quad edges; shorter creases that end loose are noise."""
KNOWN = 0.5  # trust in the field on both sides of an edge from which on it needs no crease


def creases_for_quads(
    mesh: TriMesh,
    degrees: float,
    edge_length: float,
    together: float = TOGETHER,
    trust: Floats | None = None,
) -> Ints:
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
    trust : (m,) float64, optional
        In the directions of the field at the faces, see :func:`without_known`. Default: none.

    Returns
    -------
    (k, 2) int64
        Vertex pairs.
    """
    found = find_creases(mesh, degrees, together * edge_length)
    sharp = sharp_edges(mesh, degrees)
    if trust is not None:
        found = without_known(mesh, found, sharp, trust)
    grown = grow_creases(mesh, found, sharp, degrees)
    stepped = with_steps(mesh, grown, sharp, together * edge_length)
    joined = bridge_gaps(mesh, stepped, GAP * edge_length)
    return prune_branches(mesh, joined, LOOSE * edge_length)


def without_known(mesh: TriMesh, pairs: Ints, sharp: Ints, trust: Floats) -> Ints:
    """Creases less those where the field is sure, unless the mesh was designed with creases.

    A network that is sure of a shape has seen what is sharp there, as the lids of an eye, and knows
    how edges run about it; to hold them on the sharpest line as well only bends them.

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
        Crease edges as vertex pairs, found by angle.
    sharp : (j,) int64
        Sharp edges, as :func:`vhquad.field.features.sharp_edges` finds them.
    trust : (m,) float64
        In the field at the faces, in [0, 1].
    """
    if len(pairs) == 0 or are_mostly_creases(mesh, pairs, sharp):
        return pairs
    edge = np.unique(mesh.halfedge_edge[crease_halfedges(mesh, pairs)])
    sure = trust[mesh.edge_halfedges[edge] // 3].mean(axis=1) > KNOWN
    return mesh.edges[edge[~sure]]
