"""Creases: found where they are, aligned exactly, dropped only where no quad fits."""

from __future__ import annotations

import numpy as np
import pytest

from tests.data_paths import data_file
from tests.field_checks import check_aligned
from tests.meshes import cube, grid, icosphere, plate_with_holes, torus
from vhquad.errors import ConfigError, MeshError
from vhquad.field.align import AlignSettings, align_field
from vhquad.field.cross import CrossField
from vhquad.field.dual import face_angles
from vhquad.field.features import crease_halfedges, dihedral_angles, find_creases
from vhquad.field.smooth import smoothest
from vhquad.mesh.triangle import TriMesh


def no_field(mesh: TriMesh) -> CrossField:
    return CrossField("faces", np.zeros(mesh.n_faces))


def roof(angle: float, n: int = 6) -> TriMesh:
    """Two n x n squares that meet along the y axis at a given angle between their normals."""
    flat = grid(2 * n, n, 2.0, 1.0)
    x, y = flat.vertices[:, 0] - 1.0, flat.vertices[:, 1]
    slope = 0.5 * angle
    return TriMesh(np.stack([x * np.cos(slope), y, -np.abs(x) * np.sin(slope)], 1), flat.faces)


def wedge(turn: float, n: int = 6) -> TriMesh:
    """A closed slice of a round cake, `turn` radians wide: its tip has two narrow corners."""
    a = turn * np.linspace(0, 1, n + 1)
    rim = np.stack([np.cos(a), np.sin(a)], axis=1)
    flat = np.vstack([[[0.0, 0.0]], rim])
    v = np.vstack([np.column_stack([flat, np.full(n + 2, z)]) for z in (0.0, 0.6)])
    top = n + 2
    f = []
    for i in range(1, n + 1):
        f += [[0, i + 1, i], [top, top + i, top + i + 1]]
        f += [[i, i + 1, top + i + 1], [i, top + i + 1, top + i]]
    f += [[0, 1, top + 1], [0, top + 1, top], [n + 1, 0, top], [n + 1, top, top + n + 1]]
    return TriMesh(v, f)


def test_dihedral_angles_of_known_edges() -> None:
    mesh = cube(3)
    angle = dihedral_angles(mesh)
    # 1. a cube has edges of 90 degrees and flat ones
    assert np.allclose(angle, 0.0) or set(np.round(np.degrees(angle)).astype(int)) == {0, 90}
    # 2. and 12 * 3 of the sharp ones
    assert len(find_creases(mesh)) == 36
    # 3. boundaries are not sharp
    assert (dihedral_angles(grid()) == 0.0).all()


def test_threshold_and_length_choose_creases() -> None:
    mesh = roof(np.radians(30.0))
    assert len(find_creases(mesh, 40.0)) == 0
    assert len(find_creases(mesh, 25.0)) == 6
    assert len(find_creases(mesh, 25.0, shortest=0.99)) == 6
    assert len(find_creases(mesh, 25.0, shortest=1.01)) == 0
    with pytest.raises(ConfigError, match="180"):
        find_creases(mesh, 0.0)


def test_given_creases_are_checked() -> None:
    mesh = icosphere(1)
    i, j = mesh.edges[3]
    flag = crease_halfedges(mesh, [[j, i]])
    assert sorted(np.flatnonzero(flag)) == sorted(mesh.edge_halfedges[3])
    assert not crease_halfedges(mesh, None).any()
    with pytest.raises(MeshError, match="join vertices 0 and 0"):
        crease_halfedges(mesh, [[0, 0]])
    with pytest.raises(MeshError, match="shape"):
        crease_halfedges(mesh, [1, 2, 3])


def test_cube_gets_one_quad_per_corner_sector_and_nothing_else() -> None:
    mesh = cube(4)
    aligned = align_field(mesh, no_field(mesh), find_creases(mesh))
    check_aligned(mesh, aligned)
    assert aligned.report.singularities == {}
    assert (aligned.report.creases, aligned.report.creases_dropped) == (48, 0)
    corners = aligned.sector_quads[aligned.sector_is_feature]
    assert np.bincount(corners).tolist() == [0, 24, 2 * 12 * 3]


def test_field_follows_creases_exactly() -> None:
    mesh = plate_with_holes()
    aligned = align_field(mesh, CrossField("faces", smoothest(mesh)), find_creases(mesh))
    check_aligned(mesh, aligned)
    h = np.flatnonzero(aligned.feature)
    off = face_angles(aligned.mesh)[h] - aligned.angle[h // 3] - aligned.axis[h] * np.pi / 2
    np.testing.assert_allclose(np.angle(np.exp(4j * off)), 0.0, atol=1e-9)


@pytest.mark.parametrize("degrees", [20.0, 35.0, 60.0, 120.0])
def test_a_narrow_wedge_loses_only_the_creases_that_leave_no_room(degrees: float) -> None:
    mesh = wedge(np.radians(degrees))
    aligned = align_field(mesh, no_field(mesh), find_creases(mesh), AlignSettings(0.1))
    check_aligned(mesh, aligned)
    assert (aligned.report.creases_dropped > 0) == (degrees < 45.0)


def test_an_open_crease_ends_inside_a_face() -> None:
    mesh = torus(24, 12)
    pairs = np.stack([np.arange(0, 48, 12), np.arange(12, 60, 12)], axis=1)
    aligned = align_field(mesh, CrossField("faces", smoothest(mesh)), pairs)
    check_aligned(mesh, aligned)
    assert aligned.report.creases == 4


@pytest.mark.parametrize("name", ["cad_bracket", "wingnut"])
def test_cad_meshes_keep_nearly_all_their_creases(name: str) -> None:
    lines = data_file("tris", f"{name}.obj").read_text().splitlines()
    v = [[float(x) for x in line.split()[1:4]] for line in lines if line.startswith("v ")]
    f = [[int(x) - 1 for x in line.split()[1:4]] for line in lines if line.startswith("f ")]
    mesh = TriMesh(v, f)
    aligned = align_field(mesh, no_field(mesh), find_creases(mesh))
    check_aligned(mesh, aligned)
    assert aligned.report.creases_dropped < 0.05 * aligned.report.creases
