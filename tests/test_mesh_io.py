"""Reading and writing: round trips, files made by others, and files that are wrong."""

from __future__ import annotations

import contextlib
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from tests import meshes
from tests.data_paths import DATA, needs_data
from vhquad.errors import MeshError
from vhquad.mesh import io
from vhquad.mesh.parse import parse_obj, parse_off
from vhquad.mesh.ply import parse_ply
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh

ODD = np.array([[0.1, -1e-17, 1e300], [1 / 3, 2.5, -0.0], [np.pi, 7.0, 1e-308], [1.0, 2.0, 3.0]])


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".off", ".OBJ"])
def test_quads_come_back_to_the_last_bit(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"mesh{suffix}"
    for mesh in (meshes.quad_torus(), QuadMesh(ODD, [[0, 1, 2, 3]])):
        io.write_quad_mesh(path, mesh)
        back = io.read_quad_mesh(path)
        np.testing.assert_array_equal(back.vertices, mesh.vertices)
        np.testing.assert_array_equal(back.quads, mesh.quads)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".off"])
def test_trimesh_reads_what_we_write(tmp_path: Path, suffix: str) -> None:
    path, mesh = tmp_path / f"mesh{suffix}", meshes.blob(2)
    io.write_triangle_mesh(path, mesh)
    other = trimesh.load(path, process=False)
    np.testing.assert_allclose(other.vertices, mesh.vertices, rtol=1e-15)
    np.testing.assert_array_equal(other.faces, mesh.faces)
    quad = meshes.quad_cube(2)
    io.write_quad_mesh(path, quad)
    other = trimesh.load(path, process=False)
    assert other.area == pytest.approx(6.0)
    assert other.volume == pytest.approx(1.0)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".off", ".stl", ".glb"])
def test_we_read_what_trimesh_writes(tmp_path: Path, suffix: str) -> None:
    path, mesh = tmp_path / f"mesh{suffix}", meshes.torus(9, 7)
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    soup = io.read_polygons(path)
    assert soup.name == "mesh"
    assert (soup.sizes == 3).all()
    back = soup.vertices[soup.corners].reshape(-1, 3, 3)
    np.testing.assert_allclose(back, mesh.vertices[mesh.faces], atol=1e-6)


def test_every_geometry_of_a_scene_is_placed(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    scene = trimesh.Scene([box])
    mirror = np.diag([-2.0, 2.0, 2.0, 1.0])
    mirror[0, 3] = 5.0
    scene.add_geometry(box, transform=mirror, node_name="mirrored")
    scene.add_geometry(trimesh.load_path([[0, 0, 0], [1, 1, 1]]))
    path = tmp_path / "two.glb"
    scene.export(path)
    soup = io.read_polygons(path)
    assert soup.n_faces == 24
    mesh = TriMesh(soup.vertices, soup.corners.reshape(-1, 3))
    p = mesh.vertices[mesh.faces]
    volume = np.einsum("mi,mi->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6.0
    # The mirrored box keeps its outside: volumes 1 and 8 add.
    assert volume == pytest.approx(9.0)
    assert mesh.vertices[:, 0].max() == pytest.approx(6.0)


def test_obj_of_every_style() -> None:
    text = """# made by hand
mtllib x.mtl
o first
v 0 0 0 1.0 0.5 0.5
v\t1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vn 0 0 1
f 1/1/1 2//1 3/1 \\
 4
usemtl red
v 2 0 0
g second
f -4 -1 -3
s off
l 1 2 3
l 4 5
p 1
f  2   5 3
"""
    soup = parse_obj(text.replace("\n", "\r\n"))
    assert soup.faces == [[0, 1, 2, 3], [1, 4, 2], [1, 4, 2]]
    assert soup.lines.tolist() == [[0, 1], [1, 2], [3, 4]]
    assert soup.vertices.shape == (5, 3)


@pytest.mark.parametrize(
    ("text", "say"),
    [
        ("v 0 0\nf 1 1 1", "line 1 is not a vertex"),
        ("v 0 0 0\nv 0 zero 0\nf 1 1 1", "line 2 is not a vertex"),
        ("v 0 0 0\nf 1 2 1", "line 2 names vertex 2, but there are 1"),
        ("v 0 0 0\nf 1 0 1", "line 2 names vertex 0"),
        ("v 0 0 0\nf 1 -2 1", "line 2 names vertex -2"),
        ("v 0 0 0\nf 1 a 1", "line 2 is not a face"),
        ("v 0 0 0\nf 1 1.5 1", "line 2 is not a face"),
        ("v 0 0 0\nf 1 99999999999999999999 1", "line 2 is not a face"),
    ],
)
def test_obj_errors_name_the_line(text: str, say: str) -> None:
    with pytest.raises(MeshError, match=say):
        parse_obj(text)


def test_off_of_several_styles() -> None:
    body = "0 0 0 9\n1 0 0 9\n\n1 1 0 9 # last\n3 0 1 2 255 0 0\n3 2 1 0\n"
    for head in ("OFF\n# a remark\n3 2 0\n", "OFF 3 2 0\n", "NCOFF\n3 2 0\n", "3 2 0\n"):
        soup = parse_off(head + body)
        assert soup.faces == [[0, 1, 2], [2, 1, 0]]
        np.testing.assert_array_equal(soup.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0]])


@pytest.mark.parametrize(
    ("text", "say"),
    [
        ("OFF\n", "counts"),
        ("OFF\n4 1 0\n0 0 0\n", "ends early"),
        ("OFF\n1 1 0\n0 0 x\n3 0 0 0", "line 3 is not a vertex"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0", "line 4 is not a face"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0 1", "outside 0..0"),
        ("4OFF\n1 1 0\n", "not supported"),
    ],
)
def test_off_errors(text: str, say: str) -> None:
    with pytest.raises(MeshError, match=say):
        parse_off(text)


def ply(kind: str, mixed: bool) -> bytes:
    """Two quads, or a quad and a triangle, with properties and elements that do not matter."""
    head = (
        f"ply\nformat {kind} 1.0\ncomment by hand\nelement material 1\n"
        "property list uchar int ids\nproperty float shine\n"
        "element vertex 6\nproperty float x\nproperty float y\n"
        "property uchar red\nproperty double z\nelement face 2\nproperty uchar flag\n"
        "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    ).encode()
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0.25)]
    faces = [[0, 1, 2, 3], [1, 4, 5] if mixed else [1, 4, 5, 2]]
    if kind == "ascii":
        rows = ["2 7 8 0.5"] + [f"{x} {y} 255 {z}" for x, y, z in points]
        rows += [f"1 {len(f)} {' '.join(map(str, f))} 2 0.5 0.5" for f in faces]
        return head + "\n".join(rows).encode() + b"\n"
    order = "<" if "little" in kind else ">"
    body = struct.pack(order + "Biif", 2, 7, 8, 0.5)
    body += b"".join(struct.pack(order + "ffBd", x, y, 255, z) for x, y, z in points)
    for f in faces:
        body += struct.pack(f"{order}BB{len(f)}iB2f", 1, len(f), *f, 2, 0.5, 0.5)
    return head + body


KINDS = ["ascii", "binary_little_endian", "binary_big_endian"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mixed", [False, True])
def test_ply_of_every_kind(kind: str, mixed: bool) -> None:
    soup = parse_ply(ply(kind, mixed))
    assert soup.faces == [[0, 1, 2, 3], [1, 4, 5] if mixed else [1, 4, 5, 2]]
    assert soup.vertices.tolist()[5] == [2.0, 1.0, 0.25]
    assert soup.vertices.dtype == np.float64


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mixed", [False, True])
def test_a_ply_cut_short_is_refused(kind: str, mixed: bool) -> None:
    data = ply(kind, mixed)
    for length in range(len(data) - 1):
        cut = data[:length]
        try:
            soup = parse_ply(cut)
        except MeshError:
            continue
        # Only a text file that lost its last digits can still be a whole file.
        assert kind == "ascii"
        assert length > len(data) - 5
        assert soup.n_faces == 2


@pytest.mark.parametrize(
    ("old", "new", "say"),
    [
        ("format ascii", "format weird", "header line 'format weird"),
        ("property float x", "property floaty x", "'property floaty x'"),
        ("property float x", "property float q", "no vertices with x"),
        ("property float y", "property float x", "'property float x'"),
        ("element face 2", "element face -2", "'element face -2'"),
        ("element face 2", "element face 3", "3 entries of 'face' are announced"),
        ("element face", "element tristrips", "triangle strips"),
        ("end_header", "end", "header"),
        ("4 0 1 2 3", "4 0 1 2 9", "outside 0..5, such as 9"),
        ("4 0 1 2 3", "4 0 1 2 nan", "outside 0..5, such as -1"),
        ("4 0 1 2 3", "4 0 1 2 x", "not a number"),
        ("4 0 1 2 3", "nan 0 1 2 3", "ends early"),
    ],
)
def test_ply_errors(old: str, new: str, say: str) -> None:
    with pytest.raises(MeshError, match=re.escape(say)):
        parse_ply(ply("ascii", False).replace(old.encode(), new.encode()))


@given(st.binary(max_size=200), st.sampled_from(["ply\n", "OFF\n", "v 0 0 0\nf 1 1 1\n", ""]))
def test_no_bytes_break_the_parsers(noise: bytes, head: str) -> None:
    data = head.encode() + noise
    text = data.decode("utf-8", "replace")
    for parse, given_ in ((parse_ply, data), (parse_obj, text), (parse_off, text)):
        with contextlib.suppress(MeshError):
            parse(given_)  # type: ignore[operator]


@pytest.mark.parametrize("suffix", io.READABLE)
@pytest.mark.parametrize(
    "data", [b"", b" \n", b"\0" * 200, b"solid\n", b"glTF\x02\0\0\0", b"hello there\n" * 9, b"{}"]
)
def test_rubbish_gives_one_line(tmp_path: Path, suffix: str, data: bytes) -> None:
    path = tmp_path / f"rubbish{suffix}"
    path.write_bytes(data)
    with pytest.raises(MeshError) as caught:
        io.read_polygons(path)
    message = str(caught.value)
    assert "rubbish" in message
    assert "\n" not in message
    assert len(message) < 300 + len(str(path))


def test_places_that_are_no_mesh_file(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="does not exist"):
        io.read_polygons(tmp_path / "none.obj")
    with pytest.raises(MeshError, match="is a folder"):
        io.read_polygons(tmp_path)
    with pytest.raises(MeshError, match="cannot be read"):
        io.read_polygons("a\0b.obj")
    (tmp_path / "mesh.xyz").write_text("0 0 0")
    with pytest.raises(MeshError, match=r"'\.xyz' is not read; use \.obj"):
        io.read_polygons(tmp_path / "mesh.xyz")
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\n")
    with pytest.raises(MeshError, match=r"2 vertices but no faces \(a point cloud\?\)"):
        io.read_polygons(tmp_path / "points.obj")


def test_the_content_decides_before_the_suffix(tmp_path: Path) -> None:
    path = tmp_path / "really_ply.obj"
    path.write_bytes(ply("ascii", False))
    assert io.read_polygons(path).n_faces == 2


def test_mixed_faces_are_counted_and_refused(tmp_path: Path) -> None:
    path = tmp_path / "mixed.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 0\nf 1 2 3 4\nf 1 2 3\nf 1 2 3 4 5\n"
    )
    with pytest.raises(MeshError, match=r"2 of 3 .*\(1 with 3 corners, 1 with 5 corners\)"):
        io.read_quad_mesh(path)
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3 4\n")
    with pytest.raises(MeshError, match=r"mixed\.obj: 1 vertices are NaN"):
        io.read_quad_mesh(path)


def test_uv_of_each_corner_comes_back(tmp_path: Path, rng: np.random.Generator) -> None:
    mesh = meshes.icosphere(1)
    uv = rng.integers(-3, 3, (mesh.n_faces, 3, 2)) / 3.0
    path = tmp_path / "uv.obj"
    io.write_obj_with_uv(path, mesh, uv)
    rows = [line.split() for line in path.read_text().splitlines()]
    vt = np.array([[float(x) for x in r[1:]] for r in rows if r[0] == "vt"])
    corner = np.array(
        [[[int(x) for x in c.split("/")] for c in r[1:]] for r in rows if r[0] == "f"]
    )
    np.testing.assert_array_equal(corner[..., 0] - 1, mesh.faces)
    np.testing.assert_array_equal(vt[corner[..., 1] - 1], uv)
    np.testing.assert_array_equal(io.read_polygons(path).vertices, mesh.vertices)


def test_uv_that_cannot_be_written(tmp_path: Path) -> None:
    mesh = meshes.one_triangle()
    with pytest.raises(MeshError, match=r"use the suffix \.obj"):
        io.write_obj_with_uv(tmp_path / "uv.ply", mesh, np.zeros((1, 3, 2)))
    with pytest.raises(MeshError, match="shape"):
        io.write_obj_with_uv(tmp_path / "uv.obj", mesh, np.zeros((3, 2)))
    with pytest.raises(MeshError, match="finite"):
        io.write_obj_with_uv(tmp_path / "uv.obj", mesh, np.full((1, 3, 2), np.nan))


def test_outputs_that_cannot_be_written(tmp_path: Path) -> None:
    quad = meshes.quad_grid()
    with pytest.raises(MeshError, match=r"cannot write the format '\.fbx'; use \.obj"):
        io.write_quad_mesh(tmp_path / "out.fbx", quad)
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(MeshError, match="is a folder"):
        io.check_output(tmp_path / "folder.obj")
    (tmp_path / "file").write_text("x")
    with pytest.raises(MeshError, match="cannot be written"):
        io.write_quad_mesh(tmp_path / "file" / "out.obj", quad)


@needs_data
def test_the_smaller_data_is_read() -> None:
    for path in sorted(DATA.glob("*/*.obj")):
        if path.stat().st_size > 500_000:
            continue
        soup = io.read_polygons(path)
        assert soup.n_faces > 500
        assert np.isfinite(soup.vertices).all()
        assert np.unique(soup.corners).size == len(soup.vertices)
