"""Pruning of crease networks: short loose branches are where detection frays, not design."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.sharpness import chain_labels
from vhquad.mesh.triangle import TriMesh

__all__ = ["prune_branches"]

Ints = NDArray[np.int64]


def prune_branches(
    mesh: TriMesh, pairs: Ints, shortest: float, at: NDArray[np.bool_] | None = None
) -> Ints:
    """Crease edges without the chains that end loose and are short.

    A chain runs between vertices where other than two crease edges meet; it ends loose at a vertex
    that no other crease edge touches. Dropping one may join or loosen others, which are judged
    again.

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
        Crease edges as vertex pairs.
    shortest : float
        Loose chains below this length go.
    at : (n,) bool, optional
        Only chains that end loose at these vertices go, and what that loosens. Default: all.

    Returns
    -------
    (j, 2) int64
    """
    near = np.ones(mesh.n_vertices, dtype=bool) if at is None else at.copy()
    while len(pairs):
        degree = np.bincount(pairs.ravel(), minlength=mesh.n_vertices)
        label = chain_labels(mesh, pairs)
        span = mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]]
        length = np.bincount(label, np.linalg.norm(span, axis=1))
        loose = np.zeros(len(length), dtype=bool)
        loose[label[((degree[pairs] == 1) & near[pairs]).any(axis=1)]] = True
        drop = (loose & (length < shortest))[label]
        if not drop.any():
            break
        near[pairs[drop]] = True
        pairs = pairs[~drop]
    return pairs
