"""Pairs of a triangle mesh and a quad mesh of the same surface: supervision by any remesher.

``NAME.obj`` holds the triangles and ``NAME_quads.obj`` (or .ply, .off) beside it the quads, as
``vhquad remesh`` names them; the quads may come from any other tool or hand. The triangles stay as
they are, which is what the remesher saw, and take the field of the quads at the closest points.
(An artist's quads alone make more of themselves: see :mod:`vhquad.learn.targets`.)
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vhquad.errors import MeshError
from vhquad.field.cross import CrossField
from vhquad.learn.subdivide import SQUARE, SubdividedQuads
from vhquad.learn.targets import split_quads, truth_at
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.io import read_quad_mesh
from vhquad.mesh.load import load
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh

__all__ = ["MARK", "is_second_of_pair", "quads_beside", "read_pair", "transfer"]

MARK = "_quads"
QUAD_SUFFIXES = (".obj", ".ply", ".off")
TRIANGLE_SUFFIXES = (".obj", ".ply", ".off", ".stl", ".glb")
FAR = 0.02  # of the diagonal; what is further off has no truth
LEAST_SHARE = 0.5  # of the area that must have one


def quads_beside(path: Path) -> Path | None:
    """The quad mesh that belongs to a triangle mesh's file, if there is one."""
    beside = (path.with_name(f"{path.stem}{MARK}{suffix}") for suffix in QUAD_SUFFIXES)
    return next((file for file in beside if file.exists()), None)


def is_second_of_pair(path: Path) -> bool:
    """Whether a file is the quads of a pair, hence no source of its own."""
    if not path.stem.endswith(MARK) or path.suffix.lower() not in QUAD_SUFFIXES:
        return False
    stem = path.stem[: -len(MARK)]
    return any(path.with_name(f"{stem}{suffix}").exists() for suffix in TRIANGLE_SUFFIXES)


def read_pair(path: Path, quads: Path) -> tuple[TriMesh, CrossField]:
    """The largest component of a triangle mesh, repaired, with the field of the quads.

    Raises
    ------
    MeshError
        If a file cannot be read or used, or the two are not of one surface.
    """
    mesh = load(path).mesh
    if mesh.n_components > 1:
        areas = np.bincount(mesh.face_component, weights=mesh.face_areas)
        mesh, _ = mesh.submesh(mesh.face_component == areas.argmax())
    field = transfer(mesh, read_quad_mesh(quads))
    share = float(mesh.vertex_areas[field.z != 0].sum() / mesh.area)
    if share < LEAST_SHARE:
        raise MeshError(
            f"only {100.0 * share:.0f} % of {path.name} lies on {quads.name} and faces its way; "
            "the two must be of one surface, in the same place"
        )
    return mesh, field


def transfer(mesh: TriMesh, quads: QuadMesh) -> CrossField:
    """The crosses and sizes of quads at the vertices of a triangle mesh, by closest points.

    Parameters
    ----------
    mesh : TriMesh
    quads : QuadMesh

    Returns
    -------
    CrossField
        On the vertices; the confidence is the coherence, 0 (with z = 0) where no quad is near or
        the nearest faces away.
    """
    corners = np.broadcast_to(SQUARE, (quads.n_quads, 4, 2))
    own = np.arange(quads.n_quads)
    patches = SubdividedQuads(quads.vertices, quads.quads, own, np.array(corners))
    triangles, source, slots = split_quads(quads.quads, np.random.default_rng(0))
    surface = TriMesh(quads.vertices, triangles)
    field = truth_at(mesh, surface, patches, source, slots)
    assert field.size is not None
    assert field.confidence is not None
    near = ClosestPoints(surface).query(mesh.vertices).distance <= FAR * mesh.diagonal
    return CrossField("vertices", field.z * near, field.size * near, field.confidence * near)
