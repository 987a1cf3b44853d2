"""Decimation by quadric error (Garland & Heckbert 1997) that keeps chosen vertices to the bit."""

from __future__ import annotations

import fast_simplification
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.mesh.triangle import TriMesh

__all__ = ["slim", "thin_out"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ATTEMPTS, AROUND = 5, 40  # rounds of keeping so many more vertices around each unsound place
SLIVER = 1e-3  # of a triangle's area over its longest side squared


def thin_out(piece: TriMesh, kept: Bools, n_faces: int) -> tuple[TriMesh | None, Ints]:
    """Decimate a component by quadric error, some vertices kept to the bit.

    Collapses that do not look at topology make an edge of three faces now and then: the vertices
    around are then kept as well.

    Parameters
    ----------
    piece : TriMesh
        Connected, sound.
    kept : (n,) bool
    n_faces : int
        About how many are wanted.

    Returns
    -------
    TriMesh or None
        None if another topology came out.
    (n,) int64
        The new number of each vertex kept, -1 of others.
    """
    if piece.n_faces <= n_faces:
        return piece, np.arange(piece.n_vertices)
    locked = kept.copy()
    wanted = _topology(piece)
    for _ in range(ATTEMPTS):
        points, faces, where = _collapsed(piece, locked, n_faces)
        bad = _unsound(points, faces, where[where >= 0])
        if not bad.any():
            small = TriMesh(points, faces)
            return (small if _topology(small) == wanted else None), where
        _, near = cKDTree(piece.vertices).query(points[bad], k=min(AROUND, piece.n_vertices))
        locked[near] = True
    return None, where


def _collapsed(piece: TriMesh, locked: Bools, n_faces: int) -> tuple[Floats, Ints, Ints]:
    """Positions, faces, and the new number of each locked vertex, -1 of others, by quadric error.

    To keep a vertex, a face of three times itself is put in. Such a face has no plane: its quadric
    is NaN, and so is the error of every edge at the vertex, none of which then is collapsed. These
    faces come out last, as they went in, which also tells the vertices' new numbers.
    """
    kept = np.flatnonzero(locked)
    low, size = piece.vertices.min(axis=0), piece.diagonal
    # The algorithm compares errors with fixed bounds, so it needs a mesh of unit size.
    points, triangles = fast_simplification.simplify(
        (piece.vertices - low) / size,
        np.concatenate([piece.faces, np.repeat(kept[:, None], 3, axis=1)]).astype(np.int32),
        target_count=n_faces + len(kept),
    )
    faces = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    pins, faces = faces[-len(kept) :], faces[: -len(kept)]
    where = np.full(piece.n_vertices, -1)
    where[kept] = pins[:, 0]
    new = np.array(points, dtype=np.float64) * size + low
    off = np.abs(new[where[kept]] - piece.vertices[kept]).max(initial=0.0)
    if (pins != pins[:, :1]).any() or off > 1e-6 * size:
        raise AssertionError("decimation moved vertices that were to be kept")
    new[where[kept]] = piece.vertices[kept]
    used = np.zeros(len(new), dtype=bool)  # now and then a vertex without faces is left over
    used[faces] = True
    used[where[kept]] = True
    number = np.cumsum(used) - 1
    where[kept] = number[where[kept]]
    return new[used], number[faces], where


def _unsound(points: Floats, faces: Ints, held: Ints) -> Bools:
    """Vertices left without faces, at edges that are not manifold, of several fans, or of slivers
    that cannot be cured.

    Those are slivers between three held vertices: their corners will not move.
    """
    bad = np.ones(len(points), dtype=bool)
    bad[faces] = False
    tail, head = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    _, edge, count = np.unique(
        tail * np.int64(len(points)) + head, return_inverse=True, return_counts=True
    )
    twice = count[edge] > 1  # more than two faces, or two of unlike orientation
    bad[tail[twice]] = bad[head[twice]] = True
    mesh = TriMesh(points, faces)
    stays = np.zeros(len(points), dtype=bool)
    stays[held] = True
    bad[faces[slim(mesh) & stays[faces].all(axis=1)]] = True
    if not bad.any():
        bad[mesh.tail[mesh.fan_rank < 0]] = True
    return bad


def slim(mesh: TriMesh) -> Bools:
    """Triangles so slim that their normal says little; (m,)."""
    return np.asarray(mesh.face_areas < SLIVER * mesh.edge_lengths.max(axis=1) ** 2)


def _topology(mesh: TriMesh) -> tuple[int, int, int]:
    """Components, Euler characteristic, boundary loops."""
    return mesh.n_components, mesh.euler_characteristic, len(mesh.boundary_loops)
