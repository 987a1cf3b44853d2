"""Creases that quads of a size can follow: found by angle, grown and joined, no loose ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.bridge import bridge_gaps
from vhquad.field.cross import CrossField
from vhquad.field.dual import face_angles
from vhquad.field.features import crease_halfedges, find_creases, sharp_edges
from vhquad.field.grow import are_mostly_creases, grow_creases, with_steps
from vhquad.field.prune import prune_branches
from vhquad.field.refine import lengths_of_edges
from vhquad.field.sharpness import chain_labels
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
KNOWN_CHAIN = 0.5  # mean trust in the field beside a chain from which on the field decides
CROSSED = np.radians(5)  # mean angle between a chain and the nearest arms of the field


def creases_for_quads(
    mesh: TriMesh,
    degrees: float,
    edge_length: float,
    together: float = TOGETHER,
    field: CrossField | None = None,
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
    field : CrossField, optional
        On the faces; it may know better, see :func:`without_known`.

    Returns
    -------
    (k, 2) int64
        Vertex pairs.
    """
    found = find_creases(mesh, degrees, together * edge_length)
    sharp = sharp_edges(mesh, degrees)
    if field is not None:
        found = without_known(mesh, found, sharp, field)
    grown = grow_creases(mesh, found, sharp, degrees)
    stepped = with_steps(mesh, grown, sharp, together * edge_length)
    joined = bridge_gaps(mesh, stepped, GAP * edge_length)
    return prune_branches(mesh, joined, LOOSE * edge_length)


def without_known(mesh: TriMesh, pairs: Ints, sharp: Ints, field: CrossField) -> Ints:
    """Creases less those that a sure field crosses, unless the mesh was designed with creases.

    A network that is sure of a shape has seen what is sharp there, as the lids of an eye, and knows
    how edges run about it: to hold some on the sharpest line as well only bends them.

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
        Crease edges as vertex pairs, found by angle.
    sharp : (j,) int64
        Sharp edges, as :func:`vhquad.field.features.sharp_edges` finds them.
    field : CrossField
        On the faces.
    """
    if len(pairs) == 0 or are_mostly_creases(mesh, pairs, sharp):
        return pairs
    edge = np.unique(mesh.halfedge_edge[crease_halfedges(mesh, pairs)])
    beside = mesh.edge_halfedges[edge]
    off = 4.0 * (face_angles(mesh)[beside] - field.angle[beside // 3])
    off = np.abs(np.angle(np.exp(1j * off))).mean(axis=1) / 4.0
    trust = field.trust[beside // 3].mean(axis=1)
    chain = chain_labels(mesh, mesh.edges[edge])
    length = lengths_of_edges(mesh)[edge]
    total = np.bincount(chain, length)
    crossed = np.bincount(chain, length * off) > CROSSED * total
    known = np.bincount(chain, length * trust) > KNOWN_CHAIN * total
    return mesh.edges[edge[~(crossed & known)[chain]]]
