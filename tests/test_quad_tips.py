"""find_tips: the points of cones, not those of creases, noise or round shapes."""

from __future__ import annotations

import numpy as np

from tests.meshes import cone, cube, icosphere
from vhquad.field.cross import CrossField
from vhquad.field.smooth import smoothest
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshSettings, remesh_mesh
from vhquad.quad.tips import find_tips

NONE = np.zeros((0, 3))


def test_a_sharp_cone_has_a_tip_and_a_blunt_one_has_none() -> None:
    """Turns of 2 pi (1 - 1 / sqrt(1 + h^2)): 161 degrees for a height of 1.5, 38 for 0.5."""
    sharp, blunt = cone(48, 20, height=1.5), cone(48, 20, height=0.5)
    assert find_tips(sharp, 0.1, NONE).tolist() == [sharp.n_vertices - 1]
    assert len(find_tips(blunt, 0.1, NONE)) == 0


def test_corners_of_creases_are_no_tips() -> None:
    box = cube(8)
    corners = (np.abs(np.abs(box.vertices - box.vertices.mean(axis=0)) - 0.5) < 1e-9).all(axis=1)
    assert corners.sum() == 8
    assert set(find_tips(box, 0.05, NONE)) <= set(np.flatnonzero(corners))
    assert len(find_tips(box, 0.05, box.vertices[corners])) == 0


def test_noise_has_no_tips() -> None:
    sphere = icosphere(4)
    rng = np.random.default_rng(0)
    noisy = TriMesh(sphere.vertices * (1 + 0.03 * rng.normal(size=(2562, 1))), sphere.faces)
    length = float(np.sqrt(noisy.area / 500))
    assert len(find_tips(sphere, length, NONE)) == 0
    assert len(find_tips(noisy, length, NONE)) == 0


def test_a_quad_vertex_is_on_the_tip() -> None:
    mesh = cone(48, 20, height=1.5)
    quads = remesh_mesh(
        mesh, CrossField("faces", smoothest(mesh)), RemeshSettings(target_quads=300)
    ).quads
    away = np.linalg.norm(quads.vertices - mesh.vertices[-1], axis=1)
    assert away.min() < 1e-12
