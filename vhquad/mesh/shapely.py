"""Triangles of a decimated mesh made shapely, on the surface it came from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.flips import flip_edges
from vhquad.mesh.rings import within_rings
from vhquad.mesh.thinning import slim
from vhquad.mesh.triangle import TriMesh

__all__ = ["shapely"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ROUNDS, UNDOING_ROUNDS = 2, 5
LEAST_COSINE = 0.3  # between a face's normals before and after its corners have moved


def shapely(mesh: TriMesh, free: Bools, keep: Ints, surface: ClosestPoints) -> TriMesh:
    """Flip edges and move free vertices among their neighbours, in turn.

    Decimation leaves slivers, and now and then a vertex on top of another.

    Parameters
    ----------
    mesh : TriMesh
    free : (n,) bool
        Vertices that may move.
    keep : (k, 2) int64
        Edges that stay.
    surface : ClosestPoints
        On which the vertices end.

    Returns
    -------
    TriMesh
        The same vertices and topology.
    """
    for _ in range(ROUNDS):
        mesh = flip_edges(mesh, keep)
        tail, head = np.concatenate([mesh.edges, mesh.edges[:, ::-1]]).T
        valence = np.bincount(tail, minlength=mesh.n_vertices)[:, None]
        total = [np.bincount(tail, mesh.vertices[head, k], mesh.n_vertices) for k in range(3)]
        middle = np.stack(total, axis=1) / valence
        moved = np.array(mesh.vertices)
        moved[free] = surface.query(middle[free]).point
        before = np.array(mesh.face_normals)
        doubtful = np.flatnonzero(within_rings(mesh.faces, slim(mesh)))
        beneath = surface.faces(mesh.vertices[mesh.faces[doubtful]].mean(axis=1))
        before[doubtful] = surface.mesh.face_normals[beneath]
        for _ in range(UNDOING_ROUNDS):
            now = TriMesh(moved, mesh.faces).face_normals
            turned = np.einsum("fi,fi->f", now, before) < LEAST_COSINE
            if not turned.any():
                break
            back = np.unique(mesh.faces[turned])
            moved[back] = mesh.vertices[back]
        mesh = TriMesh(moved, mesh.faces)
    return flip_edges(mesh, keep)
