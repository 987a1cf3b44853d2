"""The splits that a map needs: no face with two feature edges, no edge between two special ends.

Without them an edge would have to carry a map for which it has no room: an isoline along both of
its ends' features, or the offset between two singular grid points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.matching import MatchedField
from vhquad.field.refine import Refinement, no_refinement, split_edges, split_faces
from vhquad.mesh.triangle import TriMesh, next_halfedge

__all__ = ["separate_features", "separate_singularities"]

Bools = NDArray[np.bool_]


def separate_features(mesh: TriMesh, feature: Bools) -> Refinement:
    """Split until every face has at most one feature edge, and other edges one feature end.

    Parameters
    ----------
    mesh : TriMesh
    feature : (3m,) bool
        Boundary halfedges, and both halfedges of creases; these are not split.
    """
    total = split_faces(mesh, np.asarray(feature.reshape(-1, 3).all(axis=1)))
    while True:
        mesh = total.mesh
        on = total.carry(feature, False)
        special = np.zeros(mesh.n_vertices, dtype=bool)
        special[mesh.tail[on]] = special[mesh.head[on]] = True
        marked = np.asarray(special[mesh.edges].all(axis=1))
        marked[mesh.halfedge_edge[on]] = False
        if not marked.any():
            return total
        total = total.then(split_edges(mesh, marked))


def separate_singularities(matched: MatchedField) -> tuple[MatchedField, Refinement]:
    """Split until no edge but features joins two singular sectors; the field is inherited.

    Returns
    -------
    matched : MatchedField
        On the refined mesh.
    refinement : Refinement
        From the mesh given.
    """
    total = no_refinement(matched.mesh)
    while True:
        mesh, singular = matched.mesh, matched.sector_is_singular
        h = np.flatnonzero(~matched.feature)
        tail, head = matched.corner_sector[h], matched.corner_sector[next_halfedge(h)]
        marked = np.zeros(mesh.n_edges, dtype=bool)
        marked[mesh.halfedge_edge[h[singular[tail] & singular[head]]]] = True
        if not marked.any():
            return matched, total
        step = split_edges(mesh, marked)
        matched, total = matched.refined(step), total.then(step)
