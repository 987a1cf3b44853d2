"""A coarse stand-in of a mesh, by quadric decimation, where not every triangle is needed."""

from __future__ import annotations

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.mesh.repair import repair
from vhquad.mesh.triangle import TriMesh

__all__ = ["decimate"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_FEWEST = 64
"""No component is taken below this many faces."""


def decimate(mesh: TriMesh, n_faces: int) -> TriMesh:
    """A mesh of about `n_faces` faces near the same surface.

    Each component gets its share and is decimated by itself (Garland & Heckbert 1997, in the fast
    variant of the fast-simplification package), then repaired: the result is manifold, wound as
    before, and has the components of the input in their order. Topology may be simpler where the
    count leaves no room for it.

    Parameters
    ----------
    mesh : TriMesh
        Sound, as :func:`vhquad.mesh.repair.repair` leaves it.
    n_faces : int
        Faces wanted; the mesh itself is returned if it has no more.

    Returns
    -------
    TriMesh
    """
    if n_faces >= mesh.n_faces:
        return mesh
    vertices, faces, start = [], [], 0
    for part in range(mesh.n_components):  # few, as a rule
        piece, _ = mesh.submesh(mesh.face_component == part)
        share = max(_FEWEST, round(n_faces * piece.n_faces / mesh.n_faces))
        if share < piece.n_faces:
            piece = _decimate_piece(piece, share)
        vertices.append(piece.vertices)
        faces.append(piece.faces + start)
        start += piece.n_vertices
    return TriMesh(np.concatenate(vertices), np.concatenate(faces))


def _decimate_piece(piece: TriMesh, count: int) -> TriMesh:
    """One component with fewer faces; as it was if nothing sound comes of it."""
    low, size = piece.vertices.min(axis=0), piece.diagonal
    # The algorithm compares errors with fixed bounds, so it needs a mesh of unit size.
    v, f = fast_simplification.simplify(
        (piece.vertices - low) / size, piece.faces.astype(np.int32), target_count=count
    )
    f = np.asarray(f, dtype=np.int64).reshape(-1, 3)
    try:
        sound = repair(np.asarray(v, dtype=np.float64) * size + low, f)
    except MeshError:
        return piece
    # Collapses that ignore topology leave crumbs: only the largest component is the surface.
    new = sound.mesh
    area = np.bincount(new.face_component, weights=new.face_areas)
    main, _ = new.submesh(new.face_component == area.argmax())
    old_normal = _area_vectors(sound.mesh.vertices, sound.mesh.faces)
    given = _area_vectors(np.asarray(v, dtype=np.float64), f[sound.face_source])
    if (old_normal * given).sum() < 0:  # a cavity, turned outward for standing alone
        main = TriMesh(main.vertices, main.faces[:, [0, 2, 1]])
    return main


def _area_vectors(v: Floats, f: Ints) -> Floats:
    return np.asarray(np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]))
