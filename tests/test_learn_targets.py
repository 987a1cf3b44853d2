"""Ground truth from quads against a torus whose directions and sizes are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from tests.learn_data import quad_torus
from tests.meshes import blob
from vhquad.errors import MeshError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import build_frames, face_axes, from_3d, vertex_axes
from vhquad.learn.augment import clip_triangles, crop_height, deform, mirror, roughen
from vhquad.learn.subdivide import catmull_clark
from vhquad.learn.targets import isotropic_remesh, leak, make_target, split_quads
from vhquad.mesh.triangle import TriMesh


def _along(mesh: TriMesh) -> np.ndarray:
    """z of the torus's parallels."""
    p = mesh.vertices
    direction = np.stack([-p[:, 1], p[:, 0], np.zeros(len(p))], axis=1)
    z = from_3d(direction, vertex_axes(mesh))
    return (z / np.abs(z)) ** 4


def _mean_along(mesh: TriMesh, rng: np.random.Generator) -> np.ndarray:
    """Mean of z of the parallels over each vertex's cell, by 200 random points a face."""
    frames, axes = build_frames(mesh), face_axes(mesh)
    total, count = np.zeros(mesh.n_vertices, dtype=complex), np.zeros(mesh.n_vertices)
    for face, corners in enumerate(mesh.faces):
        weights = rng.dirichlet((1.0, 1.0, 1.0), 200)
        x, y, _ = (weights @ mesh.vertices[corners]).T
        direction = np.stack([-y, x, 0 * x], axis=1)
        z = direction @ axes.e1[face] + 1j * (direction @ axes.e2[face])
        nearest = weights.argmax(axis=1)
        carried = (z / np.abs(z) / frames.vertex_to_face[face, nearest]) ** 4
        np.add.at(total, corners[nearest], mesh.face_areas[face] * carried)
        np.add.at(count, corners[nearest], mesh.face_areas[face])
    return total / count


def test_truth_on_a_torus(rng: np.random.Generator) -> None:
    """1. Directions to half a degree, sizes to 3 %, coherence of the cell's, nothing missing."""
    vertices, quads = quad_torus(60, 24)
    target = make_target(vertices, quads, 1500, rng)
    mesh, field = target.mesh, target.field
    assert mesh.n_vertices == pytest.approx(1500, rel=0.15)
    assert mesh.is_closed
    assert mesh.euler_characteristic == 0
    angle = np.degrees(np.abs(np.angle(field.z * _along(mesh).conj()))) / 4.0
    assert angle.mean() < 0.5
    assert angle.max() < 2.0
    r = np.linalg.norm(mesh.vertices[:, :2], axis=1)
    size = np.sqrt((2.0 * np.pi / 60) * r * (2.0 * np.pi / 24))
    assert field.size is not None
    assert field.confidence is not None
    np.testing.assert_allclose(field.size, size, rtol=0.03)
    mean = _mean_along(mesh, rng)
    assert np.degrees(np.abs(np.angle(field.z * mean.conj()))).max() / 4.0 < 0.5
    np.testing.assert_allclose(field.confidence, np.abs(mean), atol=0.01)


def test_truth_on_decimated_triangles(rng: np.random.Generator) -> None:
    """1b. Vertices are near the torus, not on it; few edges of the quads are left however many.

    Cells are large and lie to one side: the truth is that of the cell, not of the vertex.
    """
    vertices, quads = quad_torus(60, 24)
    for wanted in (700, 100_000):
        target = make_target(vertices, quads, wanted, rng, decimated=True)
        mesh, field = target.mesh, target.field
        assert mesh.n_vertices == pytest.approx(min(wanted, 60 * 24), rel=0.02)
        assert mesh.euler_characteristic == 0
        mean = _mean_along(mesh, rng)
        angle = np.degrees(np.abs(np.angle(field.z * mean.conj()))) / 4.0
        assert angle.mean() < 0.3
        assert np.percentile(angle, 95) < 1.0
        assert leak(mesh, field) < 0.15  # that of the quads cut in two is above 0.2


def test_triangles_do_not_tell(rng: np.random.Generator) -> None:
    """2. The leak: large for split quads, small after remeshing, small for random fields."""
    vertices, quads = quad_torus(60, 24)
    triangles, _, _ = split_quads(quads, rng)
    split = TriMesh(vertices, triangles)
    plain = leak(split, CrossField("vertices", _along(split)))
    target = make_target(vertices, quads, 1500, rng)
    remeshed = leak(target.mesh, target.field)
    z = np.exp(2j * np.pi * rng.random(target.mesh.n_vertices))
    assert plain > 0.2
    assert remeshed < 0.06, remeshed
    assert leak(target.mesh, CrossField("vertices", z)) < 0.05


def test_cropped_truth_is_that_of_the_whole(rng: np.random.Generator) -> None:
    """3. A crop opens the surface and leaves the directions as they were, up to its edge."""
    vertices, quads = quad_torus(60, 24)
    target = make_target(vertices, quads, 900, rng, crop=lambda v, _: v[:, 0] + 0.3)
    mesh = target.mesh
    assert len(mesh.boundary_loops) == 2
    assert mesh.vertices[:, 0].min() == pytest.approx(-0.3, abs=0.05)
    angle = np.degrees(np.abs(np.angle(target.field.z * _along(mesh).conj()))) / 4.0
    assert np.median(angle) < 0.5
    assert np.percentile(angle, 95) < 3.0  # vertex normals at the edge see one side only


def test_a_crop_of_everything_is_refused(rng: np.random.Generator) -> None:
    """4. With a reason."""
    vertices, quads = quad_torus(12, 8)
    with pytest.raises(MeshError, match="leaves nothing"):
        make_target(vertices, quads, 200, rng, crop=lambda v, _: np.full(len(v), -1.0))


def test_remesh_keeps_the_largest_part() -> None:
    """5. Two spheres: the smaller one goes."""
    big = blob(3)
    small = TriMesh(0.1 * big.vertices + 5.0, big.faces)
    v = np.concatenate([big.vertices, small.vertices])
    f = np.concatenate([big.faces, small.faces + big.n_vertices])
    mesh = isotropic_remesh(v, f, 300)
    assert mesh.n_components == 1
    assert mesh.area == pytest.approx(big.area, rel=0.05)


def test_catmull_clark_by_hand() -> None:
    """6. A flat 2 x 2 sheet: counts, parents, places in the parent, the middle vertex stays."""
    x, y = np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij")
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    quads = np.array([[0, 3, 4, 1], [1, 4, 5, 2], [3, 6, 7, 4], [4, 7, 8, 5]])
    fine = catmull_clark(vertices, quads)
    assert len(fine.vertices) == 9 + 12 + 4
    assert fine.quads.shape == (16, 4)
    np.testing.assert_array_equal(fine.parent, np.repeat(np.arange(4), 4))
    np.testing.assert_allclose(fine.vertices[4], vertices[4])
    np.testing.assert_allclose(fine.vertices[0], vertices[0])  # a corner stays
    np.testing.assert_allclose(fine.vertices[1], vertices[1])  # the boundary is straight
    # Inside, the place in the parent tells the position: bilinear interpolation of its corners.
    s, t = fine.st[..., 0, None], fine.st[..., 1, None]
    a, b, c, d = (vertices[quads[fine.parent]][:, None, j] for j in range(4))
    position = (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
    np.testing.assert_allclose(fine.vertices[fine.quads], position, atol=1e-12)


def test_catmull_clark_keeps_topology() -> None:
    """7. A torus stays one, with four times the quads, all old valences kept."""
    vertices, quads = quad_torus(12, 8)
    fine = catmull_clark(vertices, quads)
    triangles = np.concatenate([fine.quads[:, :3], fine.quads[:, [0, 2, 3]]])
    mesh = TriMesh(fine.vertices, triangles)
    assert mesh.is_closed
    assert mesh.euler_characteristic == 0
    assert (mesh.face_normals != 0).any(axis=1).all()


def test_clip_is_exact() -> None:
    """8. A cut of a flat square has the right area, normals and boundary."""
    square = TriMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    v, f = clip_triangles(square.vertices, square.faces, square.vertices[:, 0] - 0.25)
    part = TriMesh(v, f)
    assert part.area == pytest.approx(0.75)
    assert part.vertices[:, 0].min() == pytest.approx(0.25)
    assert (part.face_normals[:, 2] > 0.99).all()
    assert len(part.boundary_loops) == 1
    everything, faces = clip_triangles(square.vertices, square.faces, np.ones(4))
    assert len(everything) == 4
    assert len(faces) == 2


def test_crops_keep_the_share_they_should(rng: np.random.Generator) -> None:
    """9. Between 25 and 95 % of the area, less only where a second plane cuts too."""
    mesh = blob(4)
    shares = []
    for _ in range(80):
        height = crop_height(np.array(mesh.vertices), mesh.vertex_areas, rng)
        shares.append(mesh.vertex_areas[height > 0].sum() / mesh.area)
    assert max(shares) < 0.97
    assert np.mean(np.array(shares) < 0.24) < 0.2
    assert min(shares) < 0.45
    assert np.median(shares) == pytest.approx(0.6, abs=0.12)


def test_rough_samples_keep_their_truth(rng: np.random.Generator) -> None:
    """10. A scan's noise: triangles off by degrees, vertices by a tenth of an edge, same truth."""
    vertices, quads = quad_torus(60, 24)
    meshes = []

    def change(mesh: TriMesh) -> TriMesh:
        meshes.extend([mesh, roughen(mesh, rng)])
        return meshes[-1]

    target = make_target(vertices, quads, 1500, rng, change=change)
    smooth, rough = meshes
    np.testing.assert_array_equal(target.mesh.vertices, rough.vertices)
    edge = np.sqrt(smooth.area / smooth.n_faces)
    moved = np.linalg.norm(rough.vertices - smooth.vertices, axis=1)
    assert 0.005 * edge < moved.mean() < 0.2 * edge
    angle = np.degrees(np.abs(np.angle(target.field.z * _along(rough).conj()))) / 4.0
    assert angle.mean() < 1.0


def test_deformation_and_mirror(rng: np.random.Generator) -> None:
    """10. Deformed shapes stay smooth and of the same order; a mirrored one keeps its outside."""
    mesh = blob(3)
    moved = TriMesh(deform(np.array(mesh.vertices), rng), mesh.faces)
    assert 0.5 < moved.area / mesh.area < 2.0
    assert (moved.face_areas > 0.2 * mesh.face_areas).all()
    vertices, quads = quad_torus(12, 8)
    other, turned = mirror(vertices, quads)
    corners = other[turned]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    centre = corners.mean(axis=1)
    ring = 2.0 * centre / np.linalg.norm(centre[:, :2], axis=1, keepdims=True) * [1, 1, 0]
    assert (np.einsum("qi,qi->q", normal, centre - ring) > 0).all()


def test_frames_of_targets_are_the_libraries(rng: np.random.Generator) -> None:
    """11. The field is in the frames of the target's own mesh: smooth under its transport."""
    target = make_target(*quad_torus(60, 24), 1500, rng)
    carried = target.field.z[target.mesh.tail] * build_frames(target.mesh).transport ** 4
    assert (carried * target.field.z[target.mesh.head].conj()).real.min() > 0.5


def test_small_quads_have_their_mean(rng: np.random.Generator) -> None:
    """12. Rows of fine quads that bend by 30 degrees half-way: where a cell lies on both sides.

    The mean of the two directions is shorter, by as much as the shares of the cell say.
    """
    n = 120
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(0, 1, n // 2 + 1), indexing="ij")
    rise = np.abs(x) * np.tan(np.pi / 12)  # the upright edges stay
    number = np.arange(x.size).reshape(x.shape)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    sheet = np.stack([x, y + rise, 0 * x], axis=-1).reshape(-1, 3)
    target = make_target(sheet, quads.reshape(-1, 4), 600, rng)
    mesh, coherence = target.mesh, target.field.confidence
    assert coherence is not None
    edge = np.sqrt(mesh.area / mesh.n_vertices)
    assert edge > 1.5 / n
    off = np.abs(mesh.vertices[:, 0]) / edge
    inner = ~mesh.is_boundary_vertex  # at corners angles are rescaled: no direction is all faces'
    slanted = np.cos(np.pi / 6)  # edges 15 degrees from upright to each other
    np.testing.assert_allclose(coherence[inner & (off > 2.0)], slanted, atol=1e-6)
    seam = coherence[inner & (off < 0.3)]
    assert len(seam) > 5
    half = slanted * np.cos(np.pi / 6)  # a cell half and half, were the bend not rounded
    assert half - 0.005 < seam.min() < half + 0.05
    assert seam.max() < slanted - 0.02
