"""Random machine parts in as few triangles as CAD programs export."""

from __future__ import annotations

import numpy as np
import pymeshlab
from numpy.typing import NDArray

__all__ = ["random_part"]

Soup = tuple[NDArray[np.float64], NDArray[np.int64]]


def random_part(rng: np.random.Generator) -> Soup:
    """A box with two to four boxes, rods, cones or balls added to it or taken away."""
    meshes = pymeshlab.MeshSet(verbose=False)
    _add(meshes, 0, rng)
    whole = 0
    for _ in range(int(rng.integers(2, 5))):
        tool = _add(meshes, int(rng.integers(4)), rng)
        if rng.random() < 0.5:
            meshes.generate_boolean_union(first_mesh=whole, second_mesh=tool)
        else:
            meshes.generate_boolean_difference(first_mesh=whole, second_mesh=tool)
        whole = meshes.current_mesh_id()
    made = meshes.current_mesh()
    return made.vertex_matrix(), made.face_matrix().astype(np.int64)


def _add(meshes: pymeshlab.MeshSet, kind: int, rng: np.random.Generator) -> int:
    """A body of random sides and place, turned in half of the cases; its number."""
    sides = int(rng.integers(24, 64))
    if kind == 0:
        meshes.create_cube(size=1.0)
    elif kind == 1:
        meshes.create_cone(r0=0.5, r1=0.5, h=1.4, subdiv=sides)
    elif kind == 2:
        meshes.create_cone(r0=0.6, r1=0.2, h=1.2, subdiv=sides)
    else:
        meshes.create_sphere(radius=0.6, subdiv=4)
    made = meshes.current_mesh()
    points = made.vertex_matrix()
    points = (points - points.mean(axis=0)) * rng.uniform(0.4, 1.1, 3)
    if rng.random() < 0.5:
        turn, upper = np.linalg.qr(rng.standard_normal((3, 3)))
        turn *= np.sign(np.diag(upper))
        points = points @ (turn * np.linalg.det(turn))
    points += rng.uniform(-0.45, 0.45, 3)
    meshes.add_mesh(pymeshlab.Mesh(points, made.face_matrix()))
    return int(meshes.current_mesh_id())
