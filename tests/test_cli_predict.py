"""`vhquad predict`: the file beside the mesh, its formats, the summary."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import Invoke, write_obj
from tests.meshes import half_sphere, icosphere
from tests.soups import unwelded
from vhquad.field.io import read_field
from vhquad.mesh.load import load


@pytest.fixture
def head(tmp_path: Path) -> Path:
    mesh = half_sphere(3)
    return write_obj(tmp_path / "head.obj", mesh.vertices, mesh.faces)


def test_writes_a_field_beside_the_mesh(invoke: Invoke, head: Path, small_model: Path) -> None:
    run = invoke("predict", head, "--model", small_model)
    assert (run.code, run.err) == (0, "")
    assert "Euler characteristic" in run.out
    mesh = load(head).mesh
    field = read_field(head.with_suffix(".ffield"), mesh)
    assert (field.domain, len(field)) == ("faces", mesh.n_faces)


@pytest.mark.parametrize("suffix", [".ffield", ".vfield", ".rosy", ".rawfield", ".dmat"])
def test_every_format_holds_the_same_field(
    invoke: Invoke, head: Path, small_model: Path, suffix: str
) -> None:
    """Against .rawfield, up to the digits of the format."""
    raw, out = head.with_suffix(".rawfield"), head.with_name(f"f{suffix}")
    for path in (raw, out):
        run = invoke("predict", head, "--model", small_model, "--out", path, "--quiet")
        assert (run.code, run.out) == (0, "")
    mesh = load(head).mesh
    one, other = read_field(raw, mesh), read_field(out, mesh)
    assert one.size is not None
    if other.domain == "faces":
        np.testing.assert_allclose(other.z, one.z, atol=1e-6)
    assert (other.size is not None) == (suffix in (".rawfield", ".dmat"))


def test_loss_of_sizes_is_told(invoke: Invoke, head: Path, small_model: Path) -> None:
    out = invoke("predict", head, "--model", small_model).out
    assert "sizes and confidences are not kept" in " ".join(out.split())


def test_summary_as_json(invoke: Invoke, tmp_path: Path, small_model: Path) -> None:
    """On a closed mesh the indices sum to the Euler characteristic."""
    mesh = icosphere(3)
    source = write_obj(tmp_path / "ball.obj", mesh.vertices, mesh.faces)
    path = tmp_path / "r.json"
    assert invoke("predict", source, "--model", small_model, "--json", path).code == 0
    report = json.loads(path.read_text(encoding="utf-8"))
    assert report["index_sum"] == 2.0
    assert report["input"]["euler_characteristic"] == 2
    quarters = sum((4 - int(q)) * n for q, n in report["singularities"].items())
    assert quarters == 8
    assert report["size"]["least"] <= report["size"]["median"] <= report["size"]["largest"]


def test_field_of_a_repaired_mesh(invoke: Invoke, tmp_path: Path, small_model: Path) -> None:
    """The user learns that the rows are those of another mesh, and gets it with --mesh-out."""
    source = write_obj(tmp_path / "soup.obj", *unwelded(icosphere(2)))
    run = invoke("predict", source, "--model", small_model, "--quiet")
    assert run.code == 0
    assert "--mesh-out" in run.err
    fixed = tmp_path / "fixed.obj"
    run = invoke("predict", source, "--model", small_model, "--mesh-out", fixed, "--quiet")
    assert (run.code, run.err) == (0, "")
    loaded = load(fixed)
    assert loaded.lines() == []
    assert loaded.mesh.n_vertices == 162
    read_field(source.with_suffix(".ffield"), loaded.mesh)


def test_full_resolution(invoke: Invoke, head: Path, small_model: Path) -> None:
    """Below the limit nothing is decimated: both ways give the same field."""
    paths = [head.with_name(f"{n}.rawfield") for n in "ab"]
    assert invoke("predict", head, "--model", small_model, "--out", paths[0]).code == 0
    extra = ("--full-resolution", "--no-cache")
    assert invoke("predict", head, "--model", small_model, "--out", paths[1], *extra).code == 0
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_refusals(invoke: Invoke, head: Path) -> None:
    assert invoke("predict", head, "--out", head.with_suffix(".obj")).refused("--out", ".ffield")
    assert invoke("predict", head.with_name("no.obj")).refused("no.obj")
    bad = head.with_name("m.safetensors")
    assert invoke("predict", head, "--model", bad).refused("m.safetensors")
    assert not head.with_suffix(".ffield").exists()
