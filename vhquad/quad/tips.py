"""Points of a surface off its creases, as of a cone or a thorn, that a quad vertex should keep.

The energy of the polish knows quads, not the surface between them: from a point it slides off, and
the more so the smaller the quads there. Such a point is told by its turn, the sum of the angle
defects close by (that of a cone of half-angle a is ``2 pi (1 - sin a)``). In noise those of both
signs are about as large.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.curves import CurveConstraints

__all__ = ["find_tips", "put_on_tips"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_TURN = np.radians(120.0)  # close by: of a cone of a half-angle of 42 degrees
SHARE = 0.75  # of all defects close by, whatever their sign, that the turn must be
OWN_TURN = np.radians(30.0)  # of the vertex itself
NEAR = 1.25  # edge lengths: close by
CLEAR = 0.5  # edge lengths between a tip and a crease


def put_on_tips(
    quads: QuadMesh, mesh: TriMesh, fixed: Bools, curves: CurveConstraints
) -> tuple[QuadMesh, Bools]:
    """Put the vertices next to a surface's tips on them, and fix them there.

    Parameters
    ----------
    quads : QuadMesh
    mesh : TriMesh
        The surface.
    fixed : (n,) bool
        Vertices that stay where they are.
    curves : CurveConstraints
        Vertices on these stay on them.

    Returns
    -------
    quads : QuadMesh
    fixed : (n,) bool
    """
    length = float(np.sqrt(mesh.area / quads.n_quads))
    tips = find_tips(mesh, length, curves.points)
    free = np.flatnonzero(~fixed & (curves.curve < 0))
    if len(tips) == 0 or len(free) == 0:
        return quads, fixed
    found = cKDTree(quads.vertices[free]).query(mesh.vertices[tips])
    away, mover = np.asarray(found[0]), free[np.asarray(found[1])]
    once = np.unique(mover, return_index=True)[1]
    once = once[away[once] < length]
    vertices, held = quads.vertices.copy(), fixed.copy()
    vertices[mover[once]] = mesh.vertices[tips[once]]
    held[mover[once]] = True
    return QuadMesh(vertices, quads.quads), held


def find_tips(mesh: TriMesh, length: float, creases: Floats) -> Ints:
    """Vertices at points of a surface, apart from each other and from creases.

    Parameters
    ----------
    mesh : TriMesh
    length : float
        Edge length of the quads, in units of the mesh.
    creases : (p, 3) float64
        Points along creases and boundaries.

    Returns
    -------
    (t,) int64
    """
    angles = np.bincount(mesh.faces.ravel(), mesh.corner_angles.ravel(), mesh.n_vertices)
    turn = np.where(mesh.is_boundary_vertex, 0.0, 2 * np.pi - angles)
    some = np.flatnonzero(turn > OWN_TURN)
    radius = NEAR * length
    if len(creases) and len(some):
        some = some[cKDTree(creases).query(mesh.vertices[some])[0] > CLEAR * length]
    if len(some) == 0:
        return some
    around = cKDTree(mesh.vertices).query_ball_point(mesh.vertices[some], radius)
    total = np.array([turn[near].sum() for near in around])  # few
    pointed = total > np.maximum(
        LEAST_TURN, SHARE * np.array([np.abs(turn[near]).sum() for near in around])
    )
    tips: list[int] = []
    taken: set[int] = set()
    for i in np.argsort(-turn[some], kind="stable").tolist():
        if pointed[i] and int(some[i]) not in taken:
            tips.append(int(some[i]))
            taken.update(around[i])
    return np.array(tips, dtype=np.int64)
