"""A stand-in whose planes have triangles enough for a map.

CAD programs export a plane in as few triangles as its border allows, long and thin. A map is linear
on each, and quads many times smaller than these cannot turn where they should. So edges of planes
are split until they are about as long as quads, and flipped until triangles are shapely; the
surface stays as it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.features import crease_halfedges
from vhquad.field.refine import lengths_of_edges, split_edges
from vhquad.mesh.flips import flip_edges
from vhquad.mesh.planes import plane_labels
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.counts import stand_in_quads
from vhquad.quad.stand_in import StandIn

__all__ = ["refine_planes"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LONGEST = 2.0  # edge, in quad edges: shorter ones make quads hardly better
WORTH_FROM = 0.05  # of the area in triangles with longer ones: two are in a plane by chance as well
LEAST_AREA = 0.01  # of the longest edge squared: strips of a finely divided cylinder stay long
GRADES = 8  # of lengths in an octave
ROUNDS = 100


def refine_planes(mesh: TriMesh, n_quads: int, creases: Ints | None = None) -> StandIn | None:
    """A copy of a mesh that is to become about so many quads, with no long edge in a plane.

    Parameters
    ----------
    mesh : TriMesh
        Sound, any components and borders.
    n_quads : int
    creases : (k, 2) int64, optional
        Edges that quads must follow.

    Returns
    -------
    StandIn or None
        None where there are few such edges.
    """
    longest = LONGEST * float(np.sqrt(mesh.area / stand_in_quads(n_quads)))
    copy, plane, lines = mesh, plane_labels(mesh), creases
    coarse = _long(mesh, plane, longest)[mesh.halfedge_edge].reshape(-1, 3).any(axis=1)
    if mesh.face_areas[coarse].sum() < WORTH_FROM * mesh.area:
        return None
    rng = np.random.default_rng(0)
    for _ in range(ROUNDS):
        copy = flip_edges(copy, _kept(copy, plane, lines))
        long = _long(copy, plane, longest)
        if not long.any():
            break
        # Of edges about as long any may go first: by length alone those of a fan would queue up.
        grade = np.floor(GRADES * np.log2(lengths_of_edges(copy)))
        step = split_edges(copy, long, grade + rng.random(copy.n_edges))
        if lines is not None:
            flag = step.carry(crease_halfedges(copy, lines), False)
            lines = step.mesh.edges[np.unique(step.mesh.halfedge_edge[flag])]
        copy, plane = step.mesh, plane[step.parent]
    return StandIn(copy, lines, mesh)


def _long(mesh: TriMesh, plane: Ints, longest: float) -> Bools:
    """Edges of large faces of planes that are longer than so; (ne,)."""
    found = np.zeros(mesh.n_edges, dtype=bool)
    large = (plane >= 0) & (mesh.face_areas > LEAST_AREA * longest**2)
    found[mesh.halfedge_edge[np.repeat(large, 3)]] = True
    return np.asarray(found & (lengths_of_edges(mesh) > longest))


def _kept(mesh: TriMesh, plane: Ints, lines: Ints | None) -> Ints:
    """Edges that are not within a plane, and given ones; (k, 2)."""
    side = np.where(mesh.edge_halfedges >= 0, plane[mesh.edge_halfedges // 3], -1)
    within = (side[:, 0] == side[:, 1]) & (side[:, 0] >= 0)
    kept = mesh.edges[~within]
    return kept if lines is None else np.concatenate([kept, lines])
