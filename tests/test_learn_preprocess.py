"""Folders to datasets: what is used, what is skipped and why, what is kept when run again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.learn_data import SETTINGS, K, quad_torus, write_shapes
from tests.meshes import blob, merge, moved
from vhquad.errors import ConfigError, DatasetError
from vhquad.field.cross import CrossField
from vhquad.field.io import write_field
from vhquad.geometry.frames import build_frames
from vhquad.learn.dataset import open_dataset
from vhquad.learn.preprocess import PreprocessSettings, preprocess
from vhquad.mesh.io import write_quad_mesh, write_triangle_mesh
from vhquad.mesh.quad import QuadMesh


def test_quads_become_samples(tmp_path: Path) -> None:
    """1. Two samples a shape with truth, operators that fit, and the split by shape."""
    write_shapes(tmp_path / "in", 2)
    (tmp_path / "in" / "split.json").write_text('{"ring1": "test"}')
    seen = []
    preprocess(tmp_path / "in", tmp_path / "out", SETTINGS, 1, lambda *args: seen.append(args))
    assert seen == [("ring0.obj", 1, 2), ("ring1.obj", 2, 2)]
    dataset = open_dataset(tmp_path / "out")
    assert [e.name for e in dataset.samples] == ["ring0.t0", "ring0.t1", "ring1.t0", "ring1.t1"]
    assert {e.shape for e in dataset.split("test")} == {"ring1"}
    assert (dataset.k, dataset.features) == (K, "local")
    assert (dataset.in_channels, dataset.in_lines) == (72, 6)
    assert dataset.samples[0].variant == "whole"
    for entry in dataset.samples:
        sample, mesh = dataset.load(entry), dataset.mesh(entry)
        assert sample.truth is not None
        assert sample.input.basis.shape == (mesh.n_vertices, 2 * K)
        assert sample.input.mass.sum().item() == pytest.approx(1.0, abs=1e-5)
        assert entry.leak is not None
        assert entry.leak < 0.15  # 200 vertices: chance alone gives 0.03
        truth = dataset.truth_field(entry)
        carried = truth.z[mesh.tail] * build_frames(mesh).transport ** 4
        assert np.median((carried * truth.z[mesh.head].conj()).real) > 0.8


def test_run_again_keeps_and_mends(tmp_path: Path) -> None:
    """2. Whole samples stay, damaged ones are made again the same, changed settings make anew."""
    write_shapes(tmp_path / "in", 1)
    first = preprocess(tmp_path / "in", tmp_path / "out", SETTINGS, 1)
    files = sorted((tmp_path / "out" / "samples").glob("*.npz"))
    times = [f.stat().st_mtime_ns for f in files]
    before = first.archive(first.samples[1])
    files[1].write_bytes(files[1].read_bytes()[:1000])
    with pytest.raises(DatasetError, match=r"ring0\.t1.*preprocess again"):
        first.load(first.samples[1])
    second = preprocess(tmp_path / "in", tmp_path / "out", SETTINGS, 1)
    assert second == first
    assert files[0].stat().st_mtime_ns == times[0]
    after = second.archive(second.samples[1])
    for name in before:
        np.testing.assert_array_equal(after[name], before[name])
    third = preprocess(tmp_path / "in", tmp_path / "out", replace(SETTINGS, seed=1), 1)
    assert third.samples[0].key != first.samples[0].key


def test_what_cannot_be_used_is_named(tmp_path: Path) -> None:
    """3. Broken, mixed, empty and doubled files are skipped with a reason; the rest goes on."""
    folder = tmp_path / "in"
    write_shapes(folder, 1)
    (folder / "broken.obj").write_text("v 0 0 nan\nf 1 2 3\n")
    (folder / "empty.ply").write_bytes(b"")
    vertices, quads = quad_torus(12, 8)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    lines += ["f " + " ".join(map(str, q + 1)) for q in quads] + ["f 1 2 3"]
    (folder / "mixed.obj").write_text("\n".join(lines))
    write_quad_mesh(folder / "ring0.off", QuadMesh(*quad_torus()))
    dataset = preprocess(folder, tmp_path / "out", SETTINGS, 1)
    reasons = dict(open_dataset(tmp_path / "out").skipped)
    assert {e.shape for e in dataset.samples} == {"ring0"}
    assert set(reasons) == {"broken.obj", "empty.ply", "mixed.obj", "ring0.off"}
    assert "99.0 % of the faces are quads" in reasons["mixed.obj"]
    assert "another file of that name" in reasons["ring0.off"]


def test_triangles_with_and_without_fields(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """4. A field of the same stem is the truth; plain meshes get operators, kept for predict."""
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "in"
    folder.mkdir()
    mesh = blob(3)
    z = np.exp(1j * np.linspace(0.0, 6.0, mesh.n_faces))
    for name in ("pair", "plain"):
        write_triangle_mesh(folder / f"{name}.obj", mesh)
    write_field(folder / "pair.rosy", mesh, CrossField("faces", z))
    dataset = preprocess(folder, tmp_path / "out", SETTINGS, 1)
    by_name = {e.name: e for e in dataset.samples}
    assert by_name["pair.t0"].variant == "pair"
    assert by_name["plain.t0"].variant == "plain"
    assert not by_name["plain.t0"].truth
    assert dataset.load(by_name["plain.t0"]).truth is None
    assert len(list((tmp_path / "cache").glob("*.npz"))) == 1
    truth = dataset.load(by_name["pair.t0"]).truth
    assert truth is not None
    assert float(truth.size.max()) == 0.0  # .rosy holds no sizes
    assert float(truth.weight.sum()) > 0.2
    with pytest.raises(DatasetError, match="no ground truth"):
        dataset.truth_field(by_name["plain.t0"])


def test_parts_become_samples_of_their_own(tmp_path: Path) -> None:
    """5. Two tori in one file: two samples; a third of 1 % of the area is left out."""
    folder = tmp_path / "in"
    folder.mkdir()
    v, q = quad_torus(24, 10)
    n = len(v)
    both = QuadMesh(
        np.concatenate([v, v + 10.0, 0.05 * v - 10.0]), np.concatenate([q, q + n, q + 2 * n])
    )
    write_quad_mesh(folder / "twins.obj", both)
    settings = replace(SETTINGS, triangulations=1)
    dataset = preprocess(folder, tmp_path / "out", settings, 1)
    assert [e.name for e in dataset.samples] == ["twins.c0.t0", "twins.c1.t0"]
    assert {e.shape for e in dataset.samples} == {"twins"}


def test_plain_meshes_keep_their_largest_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """6. One network input is one connected surface."""
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "in"
    folder.mkdir()
    write_triangle_mesh(folder / "two.obj", merge(blob(3), moved(blob(2), (5.0, 0.0, 0.0), 0.3)))
    dataset = preprocess(folder, tmp_path / "out", SETTINGS, 1)
    assert dataset.samples[0].vertices == blob(3).n_vertices


def test_two_processes_do_the_same(tmp_path: Path) -> None:
    """7. Order and content of the index do not depend on who did what."""
    write_shapes(tmp_path / "in", 2)
    settings = replace(SETTINGS, triangulations=1)
    one = preprocess(tmp_path / "in", tmp_path / "one", settings, 1)
    two = preprocess(tmp_path / "in", tmp_path / "two", settings, 2)
    assert one.samples == two.samples


def test_bad_folders_and_settings(tmp_path: Path) -> None:
    """8. Each says what is wrong."""
    with pytest.raises(DatasetError, match="no folder"):
        preprocess(tmp_path / "none", tmp_path / "out", SETTINGS)
    (tmp_path / "in").mkdir()
    with pytest.raises(DatasetError, match="holds no mesh"):
        preprocess(tmp_path / "in", tmp_path / "out", SETTINGS)
    (tmp_path / "in" / "a.obj").write_text("nothing")
    with pytest.raises(DatasetError, match=r"none of the 1 meshes .*a\.obj"):
        preprocess(tmp_path / "in", tmp_path / "out", SETTINGS, 1)
    (tmp_path / "in" / "split.json").write_text('{"a": "elsewhere"}')
    with pytest.raises(DatasetError, match="must map shapes"):
        preprocess(tmp_path / "in", tmp_path / "out", SETTINGS, 1)
    for wrong in ({"triangulations": 0}, {"vertices": (500, 200)}, {"crops": 2.0}, {"k": 0}):
        with pytest.raises(ConfigError):
            PreprocessSettings(**wrong)  # type: ignore[arg-type]


def test_damaged_indices_are_refused(tmp_path: Path) -> None:
    """9. Missing, foreign, of another version, cut off, or with a name that leaves the folder."""
    with pytest.raises(DatasetError, match="vhquad preprocess"):
        open_dataset(tmp_path)
    index = tmp_path / "index.json"
    good = {
        "format": "vhquad-dataset",
        "version": 4,
        "features": "hks",
        "turned": True,
        "k": 8,
        "in_channels": 30,
        "in_lines": 0,
        "order": 4,
        "skipped": [],
        "samples": [],
    }
    assert _written(index, good) is None
    assert "not the index" in str(_written(index, {**good, "format": "x"}))
    for old in (2, 3):  # their truths and Laplacians were others
        assert f"version {old}" in str(_written(index, {**good, "version": old}))
    assert "damaged" in str(_written(index, {**good, "samples": [{"name": "a"}]}))
    entry = {
        "name": "../../a",
        "shape": "a",
        "source": "a",
        "split": "train",
        "truth": True,
        "vertices": 3,
        "leak": 0.0,
        "variant": "whole",
        "key": "",
    }
    assert "no file name" in str(_written(index, {**good, "samples": [entry]}))
    index.write_text("{")
    with pytest.raises(DatasetError, match="cannot be read"):
        open_dataset(tmp_path)


def _written(index: Path, raw: dict[str, object]) -> DatasetError | None:
    index.write_text(json.dumps(raw))
    try:
        open_dataset(index.parent)
    except DatasetError as error:
        return error
    return None
