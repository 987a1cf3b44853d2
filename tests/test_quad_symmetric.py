"""Symmetric quads: their own mirror image bit for bit, of the input's topology, edges on the plane.

The plane across an axis through 0 must be exact; any other to 1e-12 of the diagonal.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.command_line import ROOT
from tests.meshes import (
    blob,
    cone,
    cube,
    disk,
    grid,
    half_sphere,
    icosphere,
    merge,
    moved,
    open_cylinder,
    pretzel,
    random_rigid,
    torus,
    two_spheres,
)
from vhquad.errors import ConfigError, MeshError
from vhquad.field.baseline import curvature_field
from vhquad.field.cross import CrossField
from vhquad.field.mirrored import to_half, with_mirror_image
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.load import load
from vhquad.mesh.mirror import cut_half
from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh
from vhquad.report import RemeshReport


def bumpy_ellipsoid(subdivisions: int = 3) -> TriMesh:
    """Symmetric across x alone."""
    sphere = icosphere(subdivisions)
    x = sphere.vertices
    bump = 1 + 0.12 * np.sin(3 * x[:, 1] + 1) * np.cos(4 * x[:, 0]) + 0.1 * np.sin(5 * x[:, 2])
    return TriMesh(x * bump[:, None] * [1.0, 1.5, 0.8], sphere.faces)


def run(mesh: TriMesh, symmetry: str, target: int = 250) -> RemeshResult:
    return remesh_mesh(
        mesh, curvature_field(mesh), RemeshSettings(target_quads=target, symmetry=symmetry)
    )


def plane_of(result: RemeshResult) -> MirrorPlane:
    found = result.report.symmetry
    assert found is not None
    assert found.made, found.warnings
    return MirrorPlane(found.normal, found.offset)


def check_symmetric(quads: QuadMesh, plane: MirrorPlane) -> None:
    """Every vertex and every quad has its image, and the plane carries edges."""
    image = plane.reflect(quads.vertices)
    exact = plane.axis is not None and plane.offset == 0.0
    # 1. vertices: an involution; partners are equal to the last bit, or to 1e-12
    if exact:
        key = {p.tobytes(): i for i, p in enumerate(quads.vertices + 0.0)}
        partner = np.array([key[p.tobytes()] for p in image + 0.0])
    else:
        gap = np.linalg.norm(image[:, None] - quads.vertices[None], axis=2)
        partner = gap.argmin(axis=1)
        size = np.linalg.norm(np.ptp(quads.vertices, axis=0))
        assert gap.min(axis=1).max() < 1e-12 * size
    np.testing.assert_array_equal(partner[partner], np.arange(quads.n_vertices))

    # 2. connectivity: the image of a quad, wound the other way, is a quad
    def rows(q: np.ndarray) -> set[tuple[int, ...]]:
        first = q.argmin(axis=1)
        return {tuple(np.roll(row, -k)) for row, k in zip(q.tolist(), first, strict=True)}

    assert rows(quads.quads) == rows(partner[quads.quads][:, ::-1])
    # 3. on the plane: exactly, in chains of edges (two at each vertex, one at a boundary)
    on = partner == np.arange(quads.n_vertices)
    assert (np.abs(plane.height(quads.vertices[on])) <= (0.0 if exact else 1e-15)).all()
    chain = quads.edges[on[quads.edges].all(axis=1)]
    degree = np.bincount(chain.reshape(-1), minlength=quads.n_vertices)[on]
    np.testing.assert_array_equal(degree, np.where(quads.is_boundary_vertex[on], 1, 2))
    # 4. no quad straddles it, and no doublet lies on it
    side = np.sign(plane.height(quads.vertices))
    side[on] = 0.0
    across = side[quads.quads]
    assert (across.max(axis=1) * across.min(axis=1) >= 0).all()
    assert len(quads.doublets) == 0


SHAPES: dict[str, tuple[Callable[[], TriMesh], str]] = {
    "sphere": (lambda: icosphere(3), "x"),
    "torus": (lambda: torus(36, 18), "y"),
    "torus lying": (lambda: torus(36, 18), "z"),
    "ellipsoid": (bumpy_ellipsoid, "x"),
    "cube": (lambda: cube(6), "z"),
    "pretzel": (lambda: pretzel(2, 3), "y"),
    "half sphere": (lambda: half_sphere(3), "x"),
    "cylinder": (lambda: open_cylinder(32, 12), "x"),
    "cylinder across": (lambda: moved(open_cylinder(32, 12), (0, 0, -1)), "z"),
    "disk": (lambda: disk(8), "y"),
    "cone": (lambda: cone(24, 10), "x"),
    "grid with hole": (lambda: moved(grid(15, 15, hole=True), (-0.5, 0, 0)), "x"),
    "two spheres": (two_spheres, "y"),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes(name: str) -> None:
    build, axis = SHAPES[name]
    mesh = build()
    result = run(mesh, axis)
    quads, report = result.quads, result.report
    assert plane_of(result).name == f"{axis} = 0"
    check_symmetric(quads, plane_of(result))
    assert quads.is_manifold
    assert report.topology_kept
    assert report.quality is not None
    assert report.quality.folded_quads == 0
    assert report.asked == 250
    assert abs(report.made / 250 - 1) < 0.3  # coarse; a half of 125 has few ways to be cut up
    # The rim of the quads lies on the rim of the mesh.
    rim = np.flatnonzero(mesh.twin < 0)
    if rim.size:
        line = np.stack([mesh.tail[rim], mesh.head[rim], mesh.head[rim]], axis=1)
        far = ClosestPoints(TriMesh(mesh.vertices, line)).distance(
            quads.vertices[quads.is_boundary_vertex]
        )
        assert far.max() < 1e-6 * mesh.diagonal


def test_any_plane(rng: np.random.Generator) -> None:
    """Turned and shifted, `auto` finds the one plane there is, and keeps to it to rounding."""
    for seed in range(2):
        rigid = random_rigid(np.random.default_rng(seed))
        result = run(rigid.mesh(bumpy_ellipsoid()), "auto")
        plane = plane_of(result)
        assert plane.axis is None
        assert abs(plane.normal @ rigid.rotation[:, 0]) > 1 - 1e-4
        check_symmetric(result.quads, plane)
        assert result.report.topology_kept


def test_plane_beside_the_origin() -> None:
    result = run(moved(bumpy_ellipsoid(), (3.0, 0.0, 0.0)), "x")
    assert plane_of(result).name == "x = 3"
    check_symmetric(result.quads, plane_of(result))


def test_no_plane() -> None:
    """`auto` says that there is none and remeshes all the same; an axis mirrors what there is."""
    mesh = blob(3, strength=0.6)
    result = run(mesh, "auto")
    found = result.report.symmetry
    assert found is not None
    assert not found.made
    assert "no mirror plane was found" in " ".join(result.report.shortfalls())
    assert result.report.topology_kept
    result = run(mesh, "x")
    check_symmetric(result.quads, plane_of(result))
    assert "not symmetric in x" in " ".join(result.report.shortfalls())


def test_mirrored_parts_and_a_lone_one() -> None:
    """A pair beside the plane is one part and its image; a part without partner is doubled."""
    ball = icosphere(2)
    pair = [moved(ball, (3, 0, 0), 0.5), moved(ball, (-3, 0, 0), 0.5)]
    result = run(merge(*pair), "x", 200)
    check_symmetric(result.quads, plane_of(result))
    assert result.report.topology_kept
    assert result.report.shortfalls() == ()
    result = run(merge(ball, *pair, moved(ball, (3, 2, 0), 0.4)), "x", 300)
    check_symmetric(result.quads, plane_of(result))
    assert result.quads.n_components == 5
    assert any("1 components have no mirror image" in s for s in result.report.shortfalls())


def test_thin_parts_stay_manifold() -> None:
    """One quad from seam to seam would coincide with its image: such strips are split."""
    for mesh, axis in ((torus(48, 10, 1.0, 0.05), "z"), (open_cylinder(16, 30, 0.05, 4.0), "x")):
        result = run(mesh, axis, 24)
        check_symmetric(result.quads, plane_of(result))
        assert result.quads.is_manifold
        assert result.report.topology_kept


def test_creases_are_kept() -> None:
    """A cube's edges, given and found, in a half cut through four of them."""
    mesh = cube(6)
    settings = RemeshSettings(target_quads=300, symmetry="x")
    sharp = np.abs(mesh.vertices[mesh.edges]) == 0.5
    rims = mesh.edges[(sharp.all(axis=1).sum(axis=1) == 2)]
    for creases in (None, rims):
        result = remesh_mesh(mesh, curvature_field(mesh), settings, creases=creases)
        check_symmetric(result.quads, plane_of(result))
        at = (np.abs(np.abs(result.quads.vertices) - 0.5) < 1e-9).sum(axis=1) >= 2
        edges = result.quads.edges
        assert result.quads.edge_lengths[at[edges].all(axis=1)].sum() == pytest.approx(12.0)


def test_density_reaches_the_half() -> None:
    """Four times as dense above as below: edges differ by about two, on both sides alike."""
    mesh = icosphere(4)
    density = np.where(mesh.vertices[:, 2] > 0, 4.0, 1.0)
    settings = RemeshSettings(target_quads=800, symmetry="x")
    result = remesh_mesh(mesh, curvature_field(mesh), settings, density=density)
    check_symmetric(result.quads, plane_of(result))
    height = result.quads.vertices[result.quads.quads][..., 2].mean(axis=1)
    ratio = (height > 0.3).sum() / (height < -0.3).sum()
    assert 2.0 < ratio < 6.0


def test_an_unusable_wish() -> None:
    with pytest.raises(ConfigError, match="--symmetry must be one of off, auto, x, y, z"):
        RemeshSettings(symmetry="w")
    apart = merge(moved(icosphere(2), (0, 0, 0)), moved(icosphere(2), (9, 0, 0), 0.2))
    with pytest.raises(MeshError, match="no half to mirror"):
        cut_half(apart, MirrorPlane([1, 0, 0], 5.0))


def test_report_reads_back() -> None:
    report = run(icosphere(2), "auto", 100).report
    assert report.symmetry is not None
    assert RemeshReport.from_dict(report.to_dict()).symmetry == report.symmetry


# ---- fields ---------------------------------------------------------------------------------


def test_field_of_a_half() -> None:
    """Directions along z carried to the half of a cylinder are still along z; sizes stay."""
    mesh = open_cylinder(20, 7)
    plane = MirrorPlane([0.6, 0.8, 0.0], 0.1)
    half = cut_half(mesh, plane)
    along = np.tile([0.0, 0.0, 1.0], (mesh.n_faces, 1))
    field = CrossField("faces", from_3d(along, face_axes(mesh)) ** 4, np.arange(mesh.n_faces) + 1.0)
    own = to_half(mesh, field, half)
    expected = from_3d(along[: len(own)], face_axes(half.mesh)) ** 4
    expected /= np.abs(expected)
    assert np.abs(own.z - expected).max() < 0.15  # vertices slide off the cylinder's facets a bit
    np.testing.assert_array_equal(own.size, half.face_source + 1.0)


def test_mean_with_the_mirror_image(rng: np.random.Generator) -> None:
    """A symmetric field stays; noise on one side becomes half as large on both."""
    mesh = open_cylinder(24, 10)
    plane = MirrorPlane([1.0, 0.0, 0.0], 0.0)
    along = np.tile([0.0, 0.0, 1.0], (mesh.n_faces, 1))
    z = from_3d(along, face_axes(mesh)) ** 4
    field = CrossField("faces", z, np.ones(mesh.n_faces))
    same = with_mirror_image(mesh, field, plane)
    np.testing.assert_allclose(same.z, field.z, atol=1e-9)
    right = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0
    turned = CrossField("faces", z * np.where(right, np.exp(4j * 0.2), 1.0), np.where(right, 4, 1))
    mean = with_mirror_image(mesh, turned, plane)
    away = np.abs(mesh.vertices[mesh.faces].mean(axis=1)[:, 0]) > 0.2
    angle = np.angle(mean.z / field.z)[away] / 4
    np.testing.assert_allclose(angle, np.where(right[away], 0.1, -0.1), atol=0.02)
    assert mean.size is not None
    np.testing.assert_allclose(mean.size[away], 2.0, rtol=0.05)


# ---- a real head ----------------------------------------------------------------------------


@pytest.mark.parametrize("symmetry", ["auto", "x"])
def test_the_example_head(symmetry: str) -> None:
    """Nearly symmetric, open at the neck; 1,000 quads along the curvature."""
    mesh = load(ROOT / "examples" / "head.obj").mesh
    result = run(mesh, symmetry, 1000)
    plane = plane_of(result)
    assert plane.axis == 0
    assert abs(plane.offset) < 0.01 * mesh.diagonal
    check_symmetric(result.quads, plane)
    assert result.report.topology_kept
    assert result.report.quality is not None
    assert result.report.quality.distance is not None
    assert result.report.quality.distance.mean < 0.5
