"""The planes of a mesh: regions of several triangles that lie in one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.mesh.triangle import TriMesh

__all__ = ["plane_labels"]

LEVEL = 1e-3  # radians between two faces of a plane


def plane_labels(mesh: TriMesh) -> NDArray[np.int64]:
    """Label of the plane of each face, -1 where its neighbours lie in others; (m,)."""
    h = np.flatnonzero(mesh.twin > np.arange(3 * mesh.n_faces))
    level = h[np.abs(mesh.dihedral_angles[h]) < LEVEL]
    ends = (level // 3, mesh.twin[level] // 3)
    links = coo_matrix((np.ones(len(level), dtype=np.int8), ends), (mesh.n_faces, mesh.n_faces))
    label = connected_components(links, directed=False)[1].astype(np.int64)
    return np.where(np.bincount(label)[label] > 1, label, -1)
