"""remesh_mesh: valid quads of the input's topology on every mesh, and an honest report."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.map_stages import field_along, noisy
from tests.meshes import (
    CLOSED,
    OPEN,
    Case,
    blob,
    cube,
    grid,
    icosphere,
    merge,
    moved,
    open_cylinder,
    plate_with_holes,
    punctured_torus,
    random_rigid,
    sphere_and_sheet,
    tetrahedron,
    torus,
)
from tests.remesh_checks import check_valid, plain_field, run
from vhquad.errors import ConfigError, FieldError
from vhquad.field.cross import CrossField
from vhquad.field.smooth import smoothest
from vhquad.field.transport import to_vertices
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quality import scaled_jacobians
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshSettings, remesh_mesh
from vhquad.report import MAP


@pytest.mark.parametrize("case", CLOSED + OPEN, ids=str)
def test_every_mesh_of_the_suite(case: Case) -> None:
    mesh, target = case.mesh, 300
    result = run(mesh, target)
    check_valid(mesh, result)
    assert result.report.asked == target
    assert result.report.output.euler_characteristic == case.euler
    if case.name != "plate_with_holes":  # see test_a_count_does_not_cost_the_creases
        assert not result.report.fallbacks
    assert 0.8 * target < result.quads.n_quads < 1.2 * target
    # 4. square corners and no folds, near the surface: an edge of 1/17 of the size cuts corners
    # of it by a percent or two at most
    folded = scaled_jacobians(result.quads).min(axis=1) <= 0
    assert folded.sum() <= (2 if case.name in ("tetrahedron", "cone") else 0)
    off = ClosestPoints(mesh).query(result.quads.vertices).distance
    assert off.max() < 0.02 * mesh.diagonal


@pytest.mark.parametrize(
    "name", ["tetrahedron", "icosphere", "one_triangle", "grid", "open_cylinder", "cone", "disk"]
)
def test_tiny_targets(name: str) -> None:
    case = next(c for c in CLOSED + OPEN if c.name == name)
    for target in (1, 20):
        result = run(case.mesh, target)
        check_valid(case.mesh, result)
        assert result.quads.n_quads < 80


@pytest.mark.parametrize("target", [100, 300, 500])
def test_a_count_does_not_cost_the_creases(target: int) -> None:
    """All arcs alike round up at once: 200 quads or 450, if nothing made some of them differ."""
    result = run(plate_with_holes(2, 2), target)
    assert result.report.components[0].method == MAP
    assert abs(result.quads.n_quads - target) <= 0.06 * target


def test_two_triangles() -> None:
    mesh = grid(1, 1)
    result = run(mesh, 24)
    check_valid(mesh, result)
    assert result.quads.irregular_interior == {}
    assert result.quads.n_quads in (20, 24)
    # The four corners are vertices: quads cover all of the rectangle.
    for corner in mesh.vertices:
        assert np.linalg.norm(result.quads.vertices - corner, axis=1).min() < 1e-12


def test_one_triangle_has_three_corners() -> None:
    result = run(TriMesh([[0, 0, 0], [1, 0, 0], [0.4, 1, 0]], [[0, 1, 2]]), 30)
    # Three corners of one quad each leave one vertex of valence three inside.
    assert result.quads.irregular_interior == {3: 1}


def test_irregular_vertices_are_the_singularities_of_the_field() -> None:
    for mesh in (icosphere(2), torus(), blob(3), open_cylinder(), punctured_torus()):
        result = run(mesh, 400)
        part = result.report.components[0]
        assert part.method == MAP
        irregular = {k: n for k, n in part.singularities.items() if k != 4}
        assert result.quads.irregular_interior == irregular
        # quarter indices add up: closed surfaces have 4 chi of them
        if mesh.is_closed:
            assert sum((4 - k) * n for k, n in irregular.items()) == 4 * mesh.euler_characteristic


def test_corners_of_creases_are_irregular_as_the_field_says() -> None:
    """Three quads at a corner of a block, five at a corner of a hole: a face around, two in it."""
    for mesh, corners in ((cube(), {3: 8}), (plate_with_holes(2), {3: 8, 5: 16})):
        result = run(mesh, 400)
        part = result.report.components[0]
        assert part.method == MAP
        assert (dict(part.singularities), dict(part.crease_corners)) == ({}, corners)
        assert result.quads.irregular_interior == corners


@given(
    strength=st.floats(0.2, 1.0),
    target=st.integers(50, 300),
    seed=st.integers(0, 10_000),
    shape=st.sampled_from(["sphere", "torus", "cylinder", "open torus"]),
)
@settings(max_examples=8)
def test_noisy_fields(strength: float, target: int, seed: int, shape: str) -> None:
    mesh = {
        "sphere": icosphere(2),
        "torus": torus(16, 8),
        "cylinder": open_cylinder(16, 6),
        "open torus": punctured_torus(),
    }[shape]
    z = noisy(mesh, strength, np.random.default_rng(seed))
    check_valid(mesh, run(mesh, target, CrossField("faces", z)))


def test_creases_become_chains_of_edges() -> None:
    mesh = cube(4)
    result = run(mesh, 294)
    assert result.quads.n_quads == 294
    assert result.quads.irregular_interior == {3: 8}
    # Every vertex is on the cube, and 12 edges hold 8 + 12 * 6 of them exactly.
    on = np.isclose(np.abs(result.quads.vertices), 0.5, atol=1e-9)
    assert on.any(axis=1).all()
    assert (on.sum(axis=1) == 3).sum() == 8
    assert (on.sum(axis=1) == 2).sum() == 12 * 6


def test_creases_given_or_off() -> None:
    mesh = grid(12, 12, 1.0, 1.0)
    along = field_along(mesh, np.tile([1.0, 0.0, 0.0], (mesh.n_faces, 1)))
    line = np.flatnonzero(np.isclose(mesh.vertices[:, 0], 0.25))
    line = line[np.argsort(mesh.vertices[line, 1])]
    result = remesh_mesh(
        mesh,
        CrossField("faces", along),
        RemeshSettings(target_quads=100),
        creases=np.stack([line[:-1], line[1:]], axis=1),
    )
    check_valid(mesh, result)
    on = np.isclose(result.quads.vertices[:, 0], 0.25, atol=1e-9)
    assert on.sum() == 11  # a column of the lattice; 10 x 10 quads alone have none there
    off = remesh_mesh(mesh, CrossField("faces", along), RemeshSettings(target_quads=100))
    assert not np.isclose(off.quads.vertices[:, 0], 0.25, atol=1e-3).any()
    free = remesh_mesh(cube(4), plain_field(cube(4)), RemeshSettings(200, crease=None))
    check_valid(cube(4), free)


def test_several_components_share_the_count() -> None:
    mesh = merge(icosphere(2), moved(torus(), (4.0, 0, 0)), moved(grid(), (0, 4.0, 0), 2.0))
    result = run(mesh, 600)
    check_valid(mesh, result)
    areas = np.bincount(mesh.face_component, mesh.face_areas)
    for part, area in zip(result.report.components, areas, strict=True):
        assert part.target == pytest.approx(600 * area / mesh.area, abs=1)
        assert part.made == pytest.approx(part.target, rel=0.2)
    assert result.report.input.components == 3
    check_valid(sphere_and_sheet(), run(sphere_and_sheet(), 40))


def test_sizes_of_the_field_steer_the_density() -> None:
    mesh = icosphere(3)
    height = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    field = CrossField("faces", np.zeros(mesh.n_faces), 0.2 * np.exp(0.5 * height))
    # 1. without a target the sizes say how many
    native = remesh_mesh(mesh, field)
    expected = float((mesh.face_areas / field.size**2).sum())
    assert native.report.asked == pytest.approx(expected, abs=1)
    assert native.quads.n_quads == pytest.approx(expected, rel=0.1)
    # 2. wider columns to the right; adaptivity 0 ignores the sizes. The map spaces columns as the
    # sizes say (the ratio is exp(-0.5)), the polish squares quads up again for the most part.
    flat = grid(24, 24)
    x = flat.vertices[flat.faces].mean(axis=1)[:, 0]
    along = field_along(flat, np.tile([1.0, 0.0, 0.0], (flat.n_faces, 1)))
    wider = CrossField("faces", along, 0.04 * np.exp(x))
    for adaptivity, least, most in ((0.0, 0.98, 1.02), (1.0, 0.55, 0.95)):
        result = remesh_mesh(flat, wider, RemeshSettings(400, adaptivity=adaptivity))
        centre = result.quads.vertices[result.quads.quads].mean(axis=1)[:, 0]
        assert least < (centre > 0.51).sum() / (centre < 0.49).sum() < most
    # 3. an edge length instead of a count
    edge = remesh_mesh(mesh, field, RemeshSettings(edge_length=0.2))
    assert edge.report.asked == round(mesh.area / 0.04)


def test_fields_on_vertices() -> None:
    mesh = icosphere(2)
    field = to_vertices(mesh, CrossField("faces", smoothest(mesh)))
    result = run(mesh, 200, field)
    check_valid(mesh, result)
    assert result.quads.irregular_interior == {3: 8}


def test_the_same_again_and_moved(rng: np.random.Generator) -> None:
    mesh = blob(2)
    field = CrossField("faces", smoothest(mesh))
    a, b = run(mesh, 200, field), run(mesh, 200, field)
    np.testing.assert_array_equal(a.quads.quads, b.quads.quads)
    np.testing.assert_array_equal(a.quads.vertices, b.quads.vertices)
    # A rigid motion moves the quads along: fields live in frames of the mesh.
    motion = random_rigid(rng)
    c = run(motion.mesh(mesh), 200, field)
    np.testing.assert_array_equal(a.quads.quads, c.quads.quads)
    np.testing.assert_allclose(motion.points(a.quads.vertices), c.quads.vertices, atol=1e-4)


def test_the_report() -> None:
    mesh = plate_with_holes(2, 2)
    steps: list[tuple[str, float]] = []
    result = remesh_mesh(
        mesh,
        plain_field(mesh),
        RemeshSettings(target_quads=200, seed=7),
        progress=lambda step, share: steps.append((step, share)),
    )
    report = result.report
    assert report.settings["seed"] == 7
    assert report.settings["target_quads"] == 200
    assert (report.input.vertices, report.input.faces) == (mesh.n_vertices, mesh.n_faces)
    assert report.output.vertices == result.quads.n_vertices
    assert {"align", "map", "quantise", "lay out", "polish", "check"} <= set(report.seconds)
    assert all(value >= 0 for value in report.seconds.values())
    assert type(report).from_dict(report.to_dict()) == report
    shares = [share for _, share in steps]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)


def test_the_map_on_request() -> None:
    mesh = torus()
    result = remesh_mesh(mesh, plain_field(mesh), RemeshSettings(target_quads=200), with_uv=True)
    assert result.uv is not None
    uv = result.uv.uv
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert (area > 0).all()
    assert area.sum() == pytest.approx(result.quads.n_quads, rel=1e-12)
    assert run(mesh).uv is None


def test_what_does_not_fit_is_refused() -> None:
    mesh = tetrahedron()
    with pytest.raises(FieldError, match="3 crosses, the mesh 4 faces"):
        remesh_mesh(mesh, CrossField("faces", np.ones(3)))
    with pytest.raises(FieldError, match="5 crosses, the mesh 4 vertices"):
        remesh_mesh(mesh, CrossField("vertices", np.ones(5)))
    for wrong in (
        {"target_quads": 0},
        {"edge_length": -1.0},
        {"edge_length": np.inf},
        {"target_quads": 10, "edge_length": 1.0},
        {"crease": 180.0},
        {"adaptivity": 1.5},
    ):
        with pytest.raises(ConfigError, match="--"):
            RemeshSettings(**wrong)  # type: ignore[arg-type]
