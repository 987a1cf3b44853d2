"""Numbers at the vertices of a file: properties, colours, and their way through repair."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.meshes import icosphere
from tests.soups import doubled_edge, unwelded
from vhquad.errors import MeshError
from vhquad.mesh.load import load
from vhquad.mesh.scalars import read_density, read_scalars


def write_ply(path: Path, vertices: object, faces: object, columns: dict[str, object]) -> Path:
    """A text PLY with more properties."""
    v, f = np.asarray(vertices), np.asarray(faces)
    head = ["ply", "format ascii 1.0", f"element vertex {len(v)}"]
    head += [f"property double {c}" for c in "xyz"]
    head += [
        f"property {'uchar' if c in ('red', 'green', 'blue') else 'float'} {c}" for c in columns
    ]
    head += [f"element face {len(f)}", "property list uchar int vertex_indices", "end_header"]
    table = np.column_stack([v, *columns.values()]).tolist()
    head += [" ".join(f"{x:.9g}" for x in row) for row in table]
    head += ["3 " + " ".join(map(str, row)) for row in f.tolist()]
    path.write_text("\n".join(head) + "\n", encoding="ascii")
    return path


def test_property_of_a_ply(tmp_path: Path) -> None:
    ball = icosphere(1)
    value = 1.0 + ball.vertices[:, 2] ** 2
    path = write_ply(tmp_path / "a.ply", ball.vertices, ball.faces, {"weight": value})
    np.testing.assert_allclose(read_scalars(path, "weight"), value, rtol=1e-8)
    np.testing.assert_allclose(read_density(load(path), "weight"), value, rtol=1e-8)


def test_values_follow_welded_vertices(tmp_path: Path) -> None:
    """A soup in which each vertex stands many times: its value is that of its place."""
    vertices, faces = unwelded(icosphere(1))
    path = write_ply(tmp_path / "a.ply", vertices, faces, {"h": 2.0 + vertices[:, 2]})
    loaded = load(path)
    assert loaded.mesh.n_vertices == 42
    expected = 2.0 + loaded.mesh.vertices[:, 2]
    np.testing.assert_allclose(read_density(loaded, "h"), expected, rtol=1e-7)


def test_added_vertices_take_the_mean(tmp_path: Path) -> None:
    vertices, faces = doubled_edge()
    path = write_ply(tmp_path / "a.ply", vertices, faces, {"h": np.full(len(vertices), 3.0)})
    loaded = load(path)
    assert (loaded.vertex_source < 0).any()
    np.testing.assert_allclose(read_density(loaded, "h"), 3.0)


def test_colours(tmp_path: Path) -> None:
    """Black, mid-grey and white are 1/4, 1 and 4; bytes in a PLY, shares in an OBJ."""
    vertices, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    grey = np.array([0, 127.5, 255])
    ply = write_ply(
        tmp_path / "a.ply", vertices, faces, dict.fromkeys(("red", "green", "blue"), grey)
    )
    np.testing.assert_allclose(read_density(load(ply), "color"), [0.25, 1.0, 4.0], rtol=1e-6)
    obj = tmp_path / "a.obj"
    obj.write_text("v 0 0 0 0 0 0\nv 1 0 0 .5 .5 .5\nv 0 1 0 1 1 1\nf 1 2 3\n", encoding="ascii")
    np.testing.assert_allclose(read_density(load(obj), "colour"), [0.25, 1.0, 4.0])


@pytest.mark.parametrize("line", ["v 0 0 0", "v 0 0 0 red 1 1"])
def test_what_is_not_there_is_refused(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.obj"
    path.write_text(f"{line}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="ascii")
    with pytest.raises(MeshError, match=r"no values 'color'.*there are: none"):
        read_scalars(path, "color")
    ball = icosphere(0)
    ply = write_ply(tmp_path / "a.ply", ball.vertices, ball.faces, {"h": np.ones(12)})
    with pytest.raises(MeshError, match=r"'weight'.*there are: h"):
        read_scalars(ply, "weight")
    with pytest.raises(MeshError, match="cannot be read"):
        read_scalars(tmp_path / "no.ply", "h")
