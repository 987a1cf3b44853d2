"""Growth of creases along sharp edges that alone would not count as creases.

A remesher that cuts a crease's corners leaves edges on it that bend more or less than the surface
around them, and :mod:`vhquad.field.sharpness` takes no chain of such edges for a crease. Where they
touch a crease, and the surface bends by as much all around, they belong to it (the hysteresis of
Canny 1986). A round fold, whose bend many edges share, does not. Where most sharp edges are no
creases, as on a wrinkled skin, nothing grows: there the doubtful ones would cost squareness.

The steps of a round fold that a designed part was given with so few facets that each is as sharp as
a crease are edges to keep as well, if they go on for long (:func:`with_steps`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.field.features import dihedral_angles, drop_short_creases
from vhquad.field.sharpness import LEAST_AROUND, side_angles
from vhquad.mesh.triangle import TriMesh

__all__ = ["are_mostly_creases", "grow_creases", "with_steps"]

Ints = NDArray[np.int64]

SHARE = 0.55  # least one of the bend around that an edge takes: two may share it, not three
MOSTLY = 0.7  # least share of creases in the length of all sharp edges


def grow_creases(mesh: TriMesh, pairs: Ints, sharp: Ints, degrees: float) -> Ints:
    """Crease edges with the sharp edges that hang together with them.

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
        Crease edges as vertex pairs.
    sharp : (j,) int64
        Sharp edges, as :func:`vhquad.field.features.sharp_edges` finds them.
    degrees : float
        By which they are sharp; the sides around an edge must differ nearly as much.

    Returns
    -------
    (j, 2) int64
        The same pairs, with others behind them.
    """
    pairs = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    if len(pairs) == 0 or len(sharp) == 0:
        return pairs
    if not are_mostly_creases(mesh, pairs, sharp):
        return pairs
    around = side_angles(mesh, sharp)
    bends = (around > LEAST_AROUND * np.radians(degrees)) & (
        dihedral_angles(mesh)[sharp] > SHARE * around
    )
    n = mesh.n_vertices
    others = _without(mesh, mesh.edges[sharp[bends]], pairs)
    everything = np.concatenate([pairs, others])
    graph = coo_matrix((np.ones(len(everything), dtype=np.int8), everything.T), (n, n))
    piece = connected_components(graph, directed=False)[1]
    return np.concatenate([pairs, others[np.isin(piece[others[:, 0]], piece[pairs])]])


def with_steps(mesh: TriMesh, pairs: Ints, sharp: Ints, shortest: float) -> Ints:
    """Creases of a designed part with the long ones of its other sharp edges.

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
        Crease edges as vertex pairs.
    sharp : (j,) int64
        As in :func:`grow_creases`.
    shortest : float
        Connected pieces of other edges whose lengths sum to less are left out.

    Returns
    -------
    (j, 2) int64
        The same pairs, with others behind them.
    """
    if not are_mostly_creases(mesh, pairs, sharp):
        return pairs
    others = _without(mesh, mesh.edges[sharp], pairs)
    return np.concatenate([pairs, drop_short_creases(mesh, others, shortest)])


def are_mostly_creases(mesh: TriMesh, pairs: Ints, sharp: Ints) -> bool:
    """Whether most of what is sharp on a mesh are creases: it was designed with them.

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
        Crease edges as vertex pairs.
    sharp : (j,) int64
        As in :func:`grow_creases`.
    """
    return _length(mesh, pairs) >= MOSTLY * _length(mesh, mesh.edges[sharp])


def _without(mesh: TriMesh, edges: Ints, pairs: Ints) -> Ints:
    """Edges of a mesh that are not among some pairs."""
    n = np.int64(mesh.n_vertices)
    known = pairs.min(axis=1) * n + pairs.max(axis=1)
    return edges[~np.isin(edges[:, 0] * n + edges[:, 1], known)]


def _length(mesh: TriMesh, pairs: Ints) -> float:
    return float(np.linalg.norm(np.diff(mesh.vertices[pairs], axis=1), axis=2).sum())
