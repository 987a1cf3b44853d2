"""Field files: round trips, a reader from the description alone, hand-made files, broken files."""

from __future__ import annotations

import re
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.meshes import blob, cube, disk, grid, icosphere
from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.field.features import find_creases
from vhquad.field.io import FORMAT_LOSSES, read_field, write_field
from vhquad.field.sharp import read_sharp, write_sharp
from vhquad.field.transport import to_faces, to_vertices
from vhquad.geometry.frames import face_axes
from vhquad.mesh.triangle import TriMesh

SUFFIXES = [".ffield", ".vfield", ".rosy", ".rawfield", ".dmat"]
TWO = TriMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def some_field(mesh: TriMesh, domain: str, seed: int = 0, sizes: bool = True) -> CrossField:
    rng = np.random.default_rng(seed)
    n = mesh.n_faces if domain == "faces" else mesh.n_vertices
    z = np.exp(1j * rng.uniform(-np.pi, np.pi, n))
    return CrossField(domain, z, rng.uniform(0.01, 3.0, n) if sizes else None)


def radians_apart(a: CrossField, b: CrossField) -> float:
    assert a.domain == b.domain
    return float(np.abs(np.angle(a.z * b.z.conj())).max()) / 4.0


def save(tmp_path: Path, name: str, text: str | bytes) -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


# ---- round trips ----------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_is_exact_to_rounding(suffix: str, tmp_path: Path) -> None:
    for mesh in (blob(2), disk(4)):
        domain = "vertices" if suffix == ".vfield" else "faces"
        field = some_field(mesh, domain)
        path = tmp_path / f"a{suffix}"
        write_field(path, mesh, field)
        back = read_field(path, mesh)
        # 1. directions: 17 digits leave rounding only
        assert radians_apart(field, back) < 2e-15
        # 2. sizes where the format keeps them, and the format says so where not
        if suffix in (".rawfield", ".dmat"):
            np.testing.assert_allclose(back.size, field.size, rtol=4e-15)
            assert "size" not in FORMAT_LOSSES[suffix]
        else:
            assert back.size is None
            assert "size" in FORMAT_LOSSES[suffix]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_fields_are_brought_to_where_the_format_wants_them(suffix: str, tmp_path: Path) -> None:
    mesh = blob(3)
    path = tmp_path / f"a{suffix}"
    if suffix == ".vfield":
        field = some_field(mesh, "faces")
        expected = to_vertices(mesh, field)
    else:
        field = some_field(mesh, "vertices")
        expected = to_faces(mesh, field)
    write_field(path, mesh, field)
    assert radians_apart(expected, read_field(path, mesh)) < 2e-15


@pytest.mark.parametrize("suffix", [".rawfield", ".dmat"])
def test_formats_of_either_domain(suffix: str, tmp_path: Path) -> None:
    mesh, path = blob(2), tmp_path / f"a{suffix}"
    field = some_field(mesh, "vertices", sizes=False)
    write_field(path, mesh, field, domain="vertices")
    back = read_field(path, mesh)
    # No sizes were written: unit vectors come back as none.
    assert back.domain == "vertices"
    assert back.size is None
    assert radians_apart(field, back) < 2e-15
    with pytest.raises(FieldError, match="faces, not vertices"):
        write_field(tmp_path / "a.rosy", mesh, field, domain="vertices")


def test_a_ffield_is_what_its_description_says(tmp_path: Path) -> None:
    """Reads as vcglib's LoadFFIELD is described to: first triple to PD2, second to PD1."""
    mesh, path = blob(2), tmp_path / "a.ffield"
    field = some_field(mesh, "faces")
    write_field(path, mesh, field)
    text = path.read_text()
    # 1. the first word starts with '#'; rest of that line and a whole line are skipped
    assert text.split()[0].startswith("#")
    rest = text.split("\n", 2)[2]
    # 2. an integer: the count; the rest of its line and the column names are skipped
    count, _, rest = rest.split("\n", 2)
    assert int(count) == mesh.n_faces
    # 3. eight floats a face: two ignored values, two vectors that the reader normalises
    values = np.array(rest.split(), dtype=float).reshape(-1, 8)
    first, second = values[:, 2:5], values[:, 5:8]
    normal = mesh.face_normals
    # 4. unit, tangent, at right angles, the second counter-clockwise from the first
    for v in (first, second):
        np.testing.assert_allclose(np.linalg.norm(v, axis=1), 1.0, atol=1e-14)
        np.testing.assert_allclose(np.einsum("fi,fi->f", v, normal), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(normal, first), second, atol=1e-12)
    # 5. and both lie on the cross
    axes = face_axes(mesh)
    for v in (first, second):
        u = np.einsum("fi,fi->f", v, axes.e1) + 1j * np.einsum("fi,fi->f", v, axes.e2)
        np.testing.assert_allclose(u**4, field.z, atol=1e-12)


def test_a_rawfield_turns_counter_clockwise_and_a_rosy_has_six_numbers_of_header(
    tmp_path: Path,
) -> None:
    mesh = blob(2)
    field = some_field(mesh, "faces")
    write_field(tmp_path / "a.rawfield", mesh, field)
    head, *rows = (tmp_path / "a.rawfield").read_text().splitlines()
    assert head == f"4 {mesh.n_faces}"
    four = np.array([row.split() for row in rows], dtype=float).reshape(-1, 4, 3)
    quarter = np.cross(mesh.face_normals[:, None, :], four)
    np.testing.assert_allclose(quarter, np.roll(four, -1, axis=1), atol=1e-12)
    write_field(tmp_path / "a.rosy", mesh, field)
    lines = (tmp_path / "a.rosy").read_text().splitlines()
    assert lines[:2] == [str(mesh.n_faces), "4"]
    assert len(lines) == mesh.n_faces + 2


@given(st.lists(st.floats(-np.pi, np.pi), min_size=2, max_size=2), st.sampled_from(SUFFIXES))
def test_any_angles_survive(tmp_path_factory: pytest.TempPathFactory, angles, suffix) -> None:
    path = tmp_path_factory.mktemp("any") / f"a{suffix}"
    if suffix == ".vfield":
        field = CrossField("vertices", np.exp(1j * np.array([*angles, *angles])))
    else:
        field = CrossField("faces", np.exp(1j * np.array(angles)))
    write_field(path, TWO, field)
    assert radians_apart(field, read_field(path, TWO)) < 2e-15


# ---- hand-made files ------------------------------------------------------------------------

ROWS = "1 1 1 0 0 0 1 0\n1 1 0 1e0 0 -1 0 0\n"
COLUMNS = "k1\t k2\t k1v_x\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.ffield", f"# frame generated with VCG\ntarget_frame\n2\n{COLUMNS}{ROWS}"),
        ("a.ffield", f"# x\ntarget frame \n2\n{COLUMNS}{ROWS}"),
        ("a.ffield", f"#\ntitle\none more line\n2\n{COLUMNS}{ROWS}"),
        ("a.FFIELD", f"#\ntarget_frame\n2\n{COLUMNS}{ROWS}".replace("\n", "\r\n")),
        ("a.rosy", "2\n4\n1.000000 0 0 \n0 -2e-3 0 \n"),
        ("a.rosy", "2\r\n4\r\n1 0 0\r\n0 1 0\r\n"),
        ("a.rawfield", "4 2\n1 0 0 0 1 0 -1 0 0 0 -1 0 0 1 0 -1 0 0 0 -1 0 1 0 0"),
        ("a.rawfield", "1 2\n1 0 0\n0 1 0.5\n"),
        ("a.dmat", "3 2\n1\n0\n0\n1\n0\n0\n"),
        ("a.dmat", "7 2\n1\n0\n0\n1\n1\n0\n0\n0\n-1\n0\n0\n1\n0\n0\n"),
        ("a.dmat", b"0 0\n3 2\n" + struct.pack("<6d", 1, 0, 0, 1, 0, 0)),
        ("a.txt", "1e0 0 0 0 1 0\n0 1 0 -1 0 0\n"),
    ],
)
def test_files_of_others_are_read(name: str, text: str | bytes, tmp_path: Path) -> None:
    field = read_field(save(tmp_path, name, text), TWO)
    assert field.domain == "faces"
    # Both faces hold the cross of the coordinate axes; face 1's frame starts along its diagonal.
    np.testing.assert_allclose(field.z, [1.0, -1.0], atol=1e-12)


def test_vertex_files_and_directions_that_are_not_at_right_angles(tmp_path: Path) -> None:
    rows = "1 1 1 0 0 0 1 0\n" * 4
    field = read_field(save(tmp_path, "a.vfield", f"#\nt\n4\nk\n{rows}"), TWO)
    assert field.domain == "vertices"
    assert len(field) == 4
    # 10 degrees off square: the fourth powers meet in the middle
    a = np.radians([0.0, 100.0])
    pair = " ".join(f"{np.cos(t)} {np.sin(t)} 0" for t in a)
    field = read_field(save(tmp_path, "a.txt", f"{pair}\n{pair}\n"), TWO)
    np.testing.assert_allclose(np.degrees(np.angle(field.z[0])) / 4, 5.0, atol=1e-9)
    # 45 degrees apart: they cancel, so the first decides
    a = np.radians([0.0, 45.0])
    pair = " ".join(f"{np.cos(t)} {np.sin(t)} 0" for t in a)
    field = read_field(save(tmp_path, "a.txt", f"{pair}\n{pair}\n"), TWO)
    np.testing.assert_allclose(field.z[0], 1.0, atol=1e-9)


def test_vectors_are_projected_to_the_tangent_plane(tmp_path: Path) -> None:
    field = read_field(save(tmp_path, "a.rosy", "2\n4\n1 0 9\n0 1 -9\n"), TWO)
    np.testing.assert_allclose(field.z, [1.0, -1.0], atol=1e-12)


# ---- broken files ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.ffield", "", "line 1: a field file starts with '#'"),
        ("a.ffield", "# x\n", "line 4: expected a number of elements, found ''"),
        ("a.ffield", f"#\nt\n3\n{COLUMNS}{ROWS}1 1 1 0 0 0 1 0", "line 3: .* 3 crosses.* 2 faces"),
        ("a.ffield", f"#\nt\n2\n{COLUMNS}{ROWS}1 1", "line 5 on: .* 16 numbers, the file has 18"),
        ("a.ffield", f"#\nt\n2\n{COLUMNS}1 1 1 0 0 0 1 0\n1 1 0 one 0 1 0 0", "line 6: 'one'"),
        ("a.vfield", f"#\nt\n2\n{COLUMNS}{ROWS}", "2 crosses, the mesh 4 vertices"),
        ("a.rosy", "2\n2\n1 0 0\n0 1 0\n", "line 2: a cross field has order 4, not 2"),
        ("a.rosy", "3\n4\n1 0 0\n0 1 0\n1 1 0", "line 1: .* 3 crosses, the mesh 2 faces"),
        ("a.rosy", "2\n4\n1 0 0\n0 0 0\n", "face 1 is zero"),
        ("a.rosy", "2\n4\n1 0 0\nnan 0 0\n", "face 1 is not finite"),
        ("a.rosy", "2\n4\ninf 0 0\n1 0 0\n", "face 0 is not finite"),
        ("a.rosy", "2\n4\n1e300 0 0\n1 0 0\n", "face 0 is not finite"),
        ("a.rosy", "2\n4\n1 0 0\n0 0 1\n", "face 1 is perpendicular"),
        ("a.rosy", "-2\n4\n", "line 1: expected a number"),
        ("a.rawfield", "4\n", "line 1: a .rawfield starts"),
        ("a.rawfield", "3 2\n" + "1 0 0 " * 6, "1, 2 or 4 directions in a file, not 3"),
        ("a.rawfield", "4 5\n" + "1 0 0 " * 20, "5 crosses, the mesh 2 faces and 4 vertices"),
        ("a.dmat", "x y\n", "line 1: a .dmat starts"),
        ("a.dmat", "5 2\n" + "1 " * 10, "columns, not 5"),
        ("a.dmat", b"0 0\n3 2\n" + struct.pack("<5d", *range(5)), "take 48 bytes, not 40"),
        ("a.dmat", "7 2\n0\n0\n1\n1\n0\n0\n0\n0\n0\n0\n1\n1\n0\n0\n", "1 is missing"),
        ("a.txt", "1 0 0\n0 1 0\n", "12 numbers, the file has 6"),
        ("a.xyz", "", "fields end in .ffield"),
        ("a", "", "not in 'nothing'"),
    ],
)
def test_broken_files_are_refused(
    name: str, text: str | bytes, message: str, tmp_path: Path
) -> None:
    path = save(tmp_path, name, text)
    with pytest.raises(FieldError, match=message) as caught:
        read_field(path, TWO)
    assert name in str(caught.value)


@given(data=st.binary(max_size=200), suffix=st.sampled_from([*SUFFIXES, ".txt", ".sharp"]))
def test_rubbish_never_gets_through(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, suffix: str
) -> None:
    path = save(tmp_path_factory.mktemp("rubbish"), f"a{suffix}", data)
    # A file may be legal by chance; anything but a FieldError would end the test.
    with suppress(FieldError):
        _ = read_sharp(path, TWO) if suffix == ".sharp" else read_field(path, TWO)


def test_missing_files_zero_crosses_and_unknown_suffixes(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="cannot be read"):
        read_field(tmp_path / "none.rosy", TWO)
    with pytest.raises(FieldError, match="no direction, the first is 1"):
        write_field(tmp_path / "a.rosy", TWO, CrossField("faces", [1, 0]))
    with pytest.raises(FieldError, match=r"not in '\.txt'"):
        write_field(tmp_path / "a.txt", TWO, CrossField("faces", [1, 1]))
    with pytest.raises(FieldError, match="sizes are zero"):
        write_field(tmp_path / "a.dmat", TWO, CrossField("faces", [1, 1], [1.0, 0.0]))
    assert list(tmp_path.iterdir()) == []


# ---- sharp edges ----------------------------------------------------------------------------


def test_sharp_files_list_both_sides_and_come_back(tmp_path: Path) -> None:
    mesh, path = cube(2), tmp_path / "a.sharp"
    pairs = find_creases(mesh)
    write_sharp(path, mesh, pairs)
    head, *rows = path.read_text().splitlines()
    # 1. as QuadWild writes it: every flagged face edge, with commas; a cube is convex
    assert int(head) == len(rows) == 2 * len(pairs)
    assert all(re.fullmatch(r"1,\d+,[012]", row) for row in rows)
    # 2. the same edges come back, also from one side only and with blanks
    np.testing.assert_array_equal(read_sharp(path, mesh), pairs)
    once = sorted(set(rows), key=lambda r: int(r.split(",")[1]))[: len(rows)]
    save(tmp_path, "b.sharp", f"{len(once)}\n" + "\n".join(once).replace(",", " "))
    np.testing.assert_array_equal(read_sharp(tmp_path / "b.sharp", mesh), pairs)
    # 3. inside out, the same edges are concave
    inside_out = TriMesh(mesh.vertices, mesh.faces[:, ::-1])
    write_sharp(path, inside_out, pairs)
    assert path.read_text().splitlines()[1].startswith("0,")


def test_sharp_files_name_borders_for_quadwild_but_they_are_no_creases(tmp_path: Path) -> None:
    mesh, path = grid(3, 2), tmp_path / "a.sharp"
    write_sharp(path, mesh)
    assert path.read_text().splitlines()[0] == "10"
    assert read_sharp(path, mesh).shape == (0, 2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "starts with the number"),
        ("1,0,0\n", "starts with the number"),
        ("2\n1,0,0\n", "2 edges are said, 1 follow"),
        ("1\n1,0\n", "line 2: expected type,face,edge"),
        ("1\n1,80,0\n", "80 faces"),
        ("1\n1,0,3\n", "counted from 0"),
        ("1\n1,a,3\n", "line 2: '1,a,3' is not numbers"),
    ],
)
def test_broken_sharp_files_are_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FieldError, match=message):
        read_sharp(save(tmp_path, "a.sharp", text), icosphere(1))
