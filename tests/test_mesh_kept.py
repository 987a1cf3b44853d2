"""Loaded meshes come back from the cache as they were, and only from a sound entry."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from tests import meshes
from vhquad.errors import MeshError
from vhquad.mesh import kept
from vhquad.mesh.kept import load_kept
from vhquad.mesh.load import LoadedMesh, load


@pytest.fixture
def scan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file with a quad, a needle, a doubled face, an unused vertex and two crease lines."""
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(kept, "LEAST_BYTES", 1000)
    mesh = meshes.cube(4)
    lines = ["v {} {} {}".format(*p) for p in mesh.vertices.tolist()] + ["v 9 9 9"]
    lines += ["f {} {} {}".format(*f) for f in (mesh.faces + 1).tolist()]
    lines += ["f 1 2 2", "f {} {} {}".format(*(mesh.faces[3] + 1)), "l 1 2", "l 1 99"]
    path = tmp_path / "scan.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def same(a: LoadedMesh, b: LoadedMesh) -> bool:
    arrays = ["vertex_source", "face_source", "crease_edges"]
    rest = {field.name for field in fields(LoadedMesh)} - {*arrays, "mesh"}
    return (
        np.array_equal(a.mesh.vertices, b.mesh.vertices)
        and np.array_equal(a.mesh.faces, b.mesh.faces)
        and all(np.array_equal(getattr(a, name), getattr(b, name)) for name in arrays)
        and all(getattr(a, name) == getattr(b, name) for name in rest)
    )


def test_the_second_time_nothing_is_read(scan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = load(scan)
    assert plain.lines()
    assert plain.crease_edges is not None
    assert same(load_kept(scan), plain)

    def never(path: object) -> None:
        raise AssertionError("loaded again")

    with monkeypatch.context() as patch:
        patch.setattr(kept, "load", never)
        assert same(load_kept(scan), plain)
        scan.write_text(scan.read_text() + "# changed\n")
        with pytest.raises(AssertionError, match="loaded again"):
            load_kept(scan)


@pytest.mark.parametrize("kind", ["cut", "empty", "other"])
def test_damaged_entries_are_made_again(scan: Path, tmp_path: Path, kind: str) -> None:
    plain = load_kept(scan)
    (entry,) = (tmp_path / "cache").glob("mesh-*.npz")
    whole = entry.read_bytes()
    if kind == "other":
        with np.load(entry) as data:
            arrays = dict(data)
        np.savez(entry, **{**arrays, "face_source": arrays["face_source"][1:]})
    else:
        entry.write_bytes(whole[: len(whole) // 2] if kind == "cut" else b"")
    assert same(load_kept(scan), plain)
    assert entry.read_bytes() == whole


def test_small_files_and_missing_ones_go_the_usual_way(scan: Path, tmp_path: Path) -> None:
    kept.LEAST_BYTES = 10**9  # the fixture puts it back
    assert same(load_kept(scan), load(scan))
    assert not (tmp_path / "cache").exists()
    with pytest.raises(MeshError, match=r"none\.obj"):
        load_kept(tmp_path / "none.obj")
