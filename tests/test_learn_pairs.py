"""Pairs of triangles and quads: the field of quads that some remesher made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import vhquad
from tests.meshes import half_sphere, merge, moved, torus
from tests.quad_meshes import quad_torus
from vhquad.errors import MeshError
from vhquad.field.cross import CrossField
from vhquad.field.singular import find_singularities
from vhquad.geometry.frames import from_3d, vertex_axes
from vhquad.learn.pairs import is_second_of_pair, quads_beside, read_pair, transfer
from vhquad.learn.preprocess import PreprocessSettings, preprocess
from vhquad.mesh.io import write_quad_mesh, write_triangle_mesh
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh

RING = torus(60, 30)


def quadriflow(mesh: TriMesh) -> QuadMesh:
    """300 quads by QuadriFlow."""
    module = pytest.importorskip("pyQuadriFlow.pyQuadriFlow")
    flags = (False, True, False, False, False)
    made = module.pyquadriflow(300, 0, mesh.vertices.tolist(), mesh.faces.tolist(), *flags)
    return QuadMesh(np.array(made["vertices"], float), np.array(made["faces"], np.int64))


def own(mesh: TriMesh) -> QuadMesh:
    """300 quads by this package."""
    return vhquad.remesh(mesh.vertices, mesh.faces, target_quads=300, method="curvature").quads


def nearest_edges(mesh: TriMesh, quads: QuadMesh) -> tuple[NDArray[np.complex128], float]:
    """Fourth powers of the directions of the quad whose centre is next to each vertex; mean edge.

    A rough answer by another way than the one tested.
    """
    corners = quads.vertices[quads.quads]
    gap = np.linalg.norm(mesh.vertices[:, None] - corners.mean(axis=1)[None], axis=2)
    corner = corners[gap.argmin(axis=1)]
    along = corner[:, 1] - corner[:, 0] + corner[:, 2] - corner[:, 3]
    across = corner[:, 3] - corner[:, 0] + corner[:, 2] - corner[:, 1]
    u = from_3d(np.stack([along, across], axis=1), vertex_axes(mesh))
    z = ((u / np.abs(u)) ** 4).sum(axis=1)
    return z / np.abs(z), float(0.5 * np.abs(u).mean())


@pytest.mark.parametrize("remesher", [quadriflow, own])
def test_the_field_is_that_of_the_quads(remesher: Callable[[TriMesh], QuadMesh]) -> None:
    """1. Crosses follow the nearest quads, sizes are their edges, nothing is left out."""
    quads = remesher(RING)
    field = transfer(RING, quads)
    assert (field.z != 0).all()
    expected, edge = nearest_edges(RING, quads)
    angle = np.degrees(np.arccos((field.z * expected.conj()).real.clip(-1, 1))) / 4
    assert np.median(angle) < 4.0  # the nearest quad turns by a few degrees across itself
    assert field.size is not None
    assert np.median(field.size) == pytest.approx(edge, rel=0.15)


def test_exact_quads_give_the_exact_field() -> None:
    """2. The circles of a torus: no singularity, sizes between those of the inner and outer rim."""
    field = transfer(RING, QuadMesh(*quad_torus()))
    assert len(find_singularities(RING, field)) == 0
    circles = np.cross(RING.vertices, [0.0, 0.0, 1.0])[:, None]
    along = from_3d(circles, vertex_axes(RING))[:, 0]
    cosine = (field.z * ((along / np.abs(along)) ** 4).conj()).real
    assert np.degrees(np.arccos(cosine.min())) / 4 < 3.0


def test_read_pair(tmp_path: Path) -> None:
    """3. The largest piece of the triangles is taken; its field comes with it."""
    path = tmp_path / "ring.stl"
    both = merge(RING, moved(half_sphere(1), (5.0, 0.0, 0.0)))
    write_triangle_mesh(tmp_path / "ring.obj", both)
    write_quad_mesh(tmp_path / "ring_quads.off", QuadMesh(*quad_torus()))
    assert quads_beside(tmp_path / "ring.obj") == tmp_path / "ring_quads.off"
    assert quads_beside(path) == tmp_path / "ring_quads.off"
    assert quads_beside(tmp_path / "other.obj") is None
    assert is_second_of_pair(tmp_path / "ring_quads.off")
    assert not is_second_of_pair(tmp_path / "ring.obj")
    assert not is_second_of_pair(tmp_path / "lonely_quads.obj")
    mesh, field = read_pair(tmp_path / "ring.obj", tmp_path / "ring_quads.off")
    assert (mesh.n_vertices, len(field)) == (RING.n_vertices, RING.n_vertices)
    assert isinstance(field, CrossField)


def test_a_folder_of_pairs_becomes_a_dataset(tmp_path: Path) -> None:
    """5. One sample a pair, its triangles as they are; what contradicts itself is named."""
    folder = tmp_path / "in"
    folder.mkdir()
    ring = torus(24, 12)
    for name in ("a", "b"):
        write_triangle_mesh(folder / f"{name}.obj", ring)
        write_quad_mesh(folder / f"{name}_quads.obj", own(ring))
    for name in ("c", "c_quads"):
        write_quad_mesh(folder / f"{name}.obj", QuadMesh(*quad_torus()))
    settings = PreprocessSettings(k=16, val=0.0)
    dataset = preprocess(folder, tmp_path / "out", settings, 1)
    assert [(e.name, e.variant, e.truth) for e in dataset.samples] == [
        ("a.t0", "pair", True),
        ("b.t0", "pair", True),
    ]
    np.testing.assert_array_equal(dataset.mesh(dataset.samples[0]).faces, ring.faces)
    truth = dataset.truth_field(dataset.samples[0])
    assert truth.size is not None
    assert (truth.size > 0).all()
    assert [(name, "so does" in reason) for name, reason in dataset.skipped] == [("c.obj", True)]


def test_other_surfaces_are_refused(tmp_path: Path) -> None:
    """4. Quads that lie elsewhere, or face the other way."""
    write_triangle_mesh(tmp_path / "ring.obj", RING)
    vertices, quads = quad_torus()
    for name, wrong in (
        ("away", QuadMesh(vertices + np.array([1.0, 0.0, 0.0]), quads)),
        ("inside", QuadMesh(vertices, quads[:, ::-1].copy())),
    ):
        write_quad_mesh(tmp_path / f"{name}.obj", wrong)
        with pytest.raises(MeshError, match="of one surface"):
            read_pair(tmp_path / "ring.obj", tmp_path / f"{name}.obj")
