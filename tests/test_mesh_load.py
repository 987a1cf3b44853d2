"""Loading: seams, soups, scenes and broken files by the one door that commands use."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests import meshes, soups
from tests.data_paths import data_file
from vhquad.errors import MeshError
from vhquad.mesh import io
from vhquad.mesh.load import load


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".off", ".stl", ".glb"])
def test_every_format_gives_the_same_surface(tmp_path: Path, suffix: str) -> None:
    mesh, path = meshes.torus(12, 8), tmp_path / f"torus{suffix}"
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    loaded = load(path)
    assert loaded.mesh.is_closed
    assert loaded.mesh.n_vertices == mesh.n_vertices
    assert loaded.mesh.euler_characteristic == 0
    assert loaded.mesh.area == pytest.approx(mesh.area, rel=1e-6)
    assert loaded.report.welded_vertices == (3 * 192 - 96 if suffix == ".stl" else 0)
    assert loaded.path == path
    assert loaded.crease_edges is None


def test_an_ascii_stl_of_two_solids(tmp_path: Path) -> None:
    path = tmp_path / "two.stl"
    a, b = meshes.cube(1), meshes.moved(meshes.tetrahedron(), (5, 0, 0))
    texts = [
        trimesh.Trimesh(m.vertices, m.faces, process=False).export(file_type="stl_ascii")
        for m in (a, b)
    ]
    path.write_text("\n".join(texts))
    assert load(path).mesh.n_components == 2


def test_quads_are_cut_and_sources_name_them(tmp_path: Path) -> None:
    quad, path = meshes.quad_cube(2), tmp_path / "cube.obj"
    io.write_quad_mesh(path, quad)
    loaded = load(path)
    assert loaded.polygons == 24
    assert loaded.lines() == ["polygons cut into triangles: 24"]
    np.testing.assert_array_equal(loaded.face_source, np.repeat(np.arange(24), 2))
    np.testing.assert_array_equal(loaded.vertex_source, np.arange(quad.n_vertices))
    assert loaded.mesh.is_closed
    assert not loaded.report.changed


def test_vertices_split_at_seams_are_welded(tmp_path: Path) -> None:
    # Each side of the cube with vertices of its own, as exporters write flat shading.
    quad, path = meshes.quad_cube(1), tmp_path / "flat.ply"
    v = quad.vertices[quad.quads].reshape(-1, 3)
    io.write_quad_mesh(path, io.QuadMesh(v, np.arange(24).reshape(-1, 4)))
    loaded = load(path)
    assert loaded.mesh.is_closed
    assert loaded.report.welded_vertices == 16
    assert loaded.lines()[1] == "duplicate vertices welded: 16"


def test_line_elements_are_creases(tmp_path: Path) -> None:
    mesh, path = meshes.cube(2), tmp_path / "lines.obj"
    io.write_triangle_mesh(path, mesh)
    edge = np.abs(mesh.vertices[mesh.edges]) == 0.5
    sharp = ((edge.sum(axis=2) >= 2).all(axis=1)) & (edge.all(axis=1).sum(axis=1) == 2)
    wanted = mesh.edges[sharp]
    assert len(wanted) == 24
    with path.open("a") as file:
        file.writelines(f"l {a + 1} {b + 1}\n" for a, b in wanted)
        file.write("l 1 26\n")
    loaded = load(path)
    assert loaded.crease_edges is not None
    np.testing.assert_array_equal(loaded.crease_edges, wanted)
    assert loaded.lines() == ["line elements that are no edge left out: 1"]


def test_creases_survive_weld_and_split(tmp_path: Path) -> None:
    v, f = soups.two_cubes_on_an_edge()
    axis = np.flatnonzero((v[:, :2] == 0).all(axis=1))
    path = tmp_path / "cubes.obj"
    rows = [f"v {x} {y} {z}\n" for x, y, z in v] + [f"f {a} {b} {c}\n" for a, b, c in f + 1]
    path.write_text("".join(rows) + f"l {axis[0] + 1} {axis[1] + 1}\n")
    loaded = load(path)
    assert loaded.crease_edges is not None
    assert len(loaded.crease_edges) == 2  # one on each cube
    assert loaded.ignored_lines == 0


@pytest.mark.parametrize(
    ("text", "say"),
    [
        ("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", r"mesh\.obj: 1 faces use vertices that are NaN"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", r"mesh\.obj: none of the 1 faces has any area"),
        ("v 0 0 0\nv 1 0 0\nf 1 2\n", r"mesh\.obj: there are no faces"),
        ("v 0 0 0\nf 1 2 3\n", r"mesh\.obj: line 2 names vertex 2"),
        ("hello\n", r"mesh\.obj holds neither vertices nor faces"),
    ],
)
def test_errors_name_the_file_in_one_line(tmp_path: Path, text: str, say: str) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(text)
    with pytest.raises(MeshError, match=say) as caught:
        load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "loops", "genus"),
    [("fish", 0, 0), ("skull", 0, 2), ("cad_cube_bored", 0, 5), ("torus", 0, 1), ("wingnut", 0, 0)],
)
def test_known_models(name: str, loops: int, genus: int) -> None:
    m = load(data_file("tris", f"{name}.obj")).mesh
    assert len(m.boundary_loops) == loops
    assert m.euler_characteristic == 2 - 2 * genus - loops
    assert m.has_manifold_vertices
