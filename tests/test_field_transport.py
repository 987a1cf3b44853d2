"""Vertex and face fields into each other, against fields whose directions are known in space."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import disk, grid, icosphere, relabel, torus
from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.field.transport import to_faces, to_vertices
from vhquad.geometry.frames import face_axes, from_3d, vertex_axes
from vhquad.mesh.triangle import TriMesh


def known_field(mesh: TriMesh, vector: np.ndarray, domain: str) -> CrossField:
    """The cross along a vector (3,) or the circles about z, at vertices or faces."""
    if domain == "faces":
        points, axes = mesh.vertices[mesh.faces].mean(axis=1), face_axes(mesh)
    else:
        points, axes = mesh.vertices, vertex_axes(mesh)
    v = np.cross([0.0, 0.0, 1.0], points) if vector is None else np.tile(vector, (len(points), 1))
    return CrossField(domain, from_3d(v, axes) ** 4)


def degrees_apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(np.abs(np.angle(a * b.conj()))) / 4.0


@pytest.mark.parametrize("mesh", [grid(9, 7), disk(5)], ids=["grid", "disk"])
def test_a_constant_field_in_the_plane_stays_exactly(mesh: TriMesh) -> None:
    vector = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    on_vertices, on_faces = (known_field(mesh, vector, d) for d in ("vertices", "faces"))
    # Boundary vertices have rescaled frames: interior elements must be exact, all with one frame.
    inner_faces = ~mesh.is_boundary_vertex[mesh.faces].any(axis=1)
    there = to_faces(mesh, on_vertices)
    assert degrees_apart(there.z, on_faces.z)[inner_faces].max() < 1e-9
    back = to_vertices(mesh, on_faces)
    inner = ~mesh.is_boundary_vertex
    assert degrees_apart(back.z, on_vertices.z)[inner].max() < 1e-9


def test_error_on_a_torus_falls_with_the_mesh() -> None:
    errors = []
    for n in (24, 48, 96):
        mesh = torus(n, n // 2)
        z = to_faces(mesh, known_field(mesh, None, "vertices")).z
        errors.append(degrees_apart(z, known_field(mesh, None, "faces").z).mean())
    # Second order: a quarter per halving; 3 leaves room for the first step.
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]
    assert errors[2] < 0.1


def test_sizes_and_confidences_are_means_of_their_own() -> None:
    mesh = icosphere(1)
    rng = np.random.default_rng(0)
    n = mesh.n_vertices
    size, trust = rng.uniform(0.5, 2.0, n), rng.uniform(0, 1, n)
    field = CrossField("vertices", np.exp(1j * rng.uniform(0, 6, n)), size, trust)
    faces = to_faces(mesh, field)
    # 1. geometric mean of the sizes, arithmetic of the confidences
    np.testing.assert_allclose(faces.size, np.exp(np.log(size)[mesh.faces].mean(axis=1)))
    np.testing.assert_allclose(faces.confidence, trust[mesh.faces].mean(axis=1))
    # 2. constants stay constants, there and back
    same = CrossField("vertices", field.z, np.full(n, 0.7), np.full(n, 0.4))
    back = to_vertices(mesh, to_faces(mesh, same))
    np.testing.assert_allclose(back.size, 0.7)
    np.testing.assert_allclose(back.confidence, 0.4)
    # 3. a missing size does not drag the others down
    size[mesh.faces[0, 0]] = 0.0
    partial = to_faces(mesh, CrossField("vertices", field.z, size))
    np.testing.assert_allclose(partial.size[0] ** 2, size[mesh.faces[0, 1:]].prod())


def test_untrusted_vertices_do_not_count() -> None:
    mesh = torus(48, 24)
    field = known_field(mesh, None, "vertices")
    rng = np.random.default_rng(1)
    bad = rng.random(mesh.n_vertices) < 0.2
    spoilt = np.where(bad, -field.z, field.z)
    trusted = CrossField("vertices", spoilt, None, np.where(bad, 0.0, 1.0))
    some = ~bad[mesh.faces].all(axis=1)
    error = degrees_apart(to_faces(mesh, trusted).z, to_faces(mesh, field).z)
    assert error[some].max() < 6.0  # the curvature within a face; 45 where the spoilt count


def test_numbering_does_not_matter() -> None:
    mesh = torus(12, 8)
    rng = np.random.default_rng(5)
    other = relabel(mesh, rng)
    field = known_field(mesh, None, "vertices")
    copy = known_field(other.mesh, None, "vertices")
    a = to_faces(mesh, field).z
    b = to_faces(other.mesh, copy).z[other.face]
    truth_a = known_field(mesh, None, "faces").z
    truth_b = known_field(other.mesh, None, "faces").z[other.face]
    # Angles to a direction fixed in space, since the frames of faces differ.
    np.testing.assert_allclose(a * truth_a.conj(), b * truth_b.conj(), atol=1e-12)


def test_fields_of_other_meshes_are_refused() -> None:
    mesh = icosphere(1)
    with pytest.raises(FieldError, match="42 vertices"):
        to_faces(mesh, CrossField("vertices", np.ones(7)))
    with pytest.raises(FieldError, match="80 faces"):
        to_vertices(mesh, CrossField("faces", np.ones(7)))
