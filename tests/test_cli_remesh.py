"""`vhquad remesh`: what it writes, what it refuses, and that it leaves nothing half done."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import Invoke, write_obj
from tests.meshes import icosphere, torus, two_spheres
from tests.soups import several_broken_parts, unwelded
from vhquad.mesh.io import read_quad_mesh
from vhquad.quad import remeshing
from vhquad.report import RemeshReport

FAST = ("--method", "curvature", "--target-quads", "120")


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    """A torus: its field along the curvature has no singularity."""
    mesh = torus(32, 16)
    return write_obj(tmp_path / "ring.obj", mesh.vertices, mesh.faces)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".off"])
def test_writes_quads(invoke: Invoke, ring: Path, suffix: str) -> None:
    out = ring.parent / "deeper" / f"quad{suffix}"
    run = invoke("remesh", ring, "--out", out, *FAST)
    assert (run.code, run.err) == (0, "")
    assert "scaled Jacobian" in run.out
    quads = read_quad_mesh(out)
    assert quads.is_manifold
    assert quads.euler_characteristic == 0


def test_default_output_lies_beside_the_mesh(invoke: Invoke, ring: Path) -> None:
    assert invoke("remesh", ring, *FAST, "--quiet").out == ""
    assert ring.with_name("ring_quads.obj").exists()


def test_report_as_json(invoke: Invoke, ring: Path) -> None:
    """The file holds what the library reports, and reads back."""
    path = ring.with_name("report.json")
    run = invoke("remesh", ring, *FAST, "--seed", "5", "--json", path)
    assert run.code == 0
    report = RemeshReport.from_dict(json.loads(path.read_text(encoding="utf-8")))
    quads = read_quad_mesh(ring.with_name("ring_quads.obj"))
    assert report.made == quads.n_quads
    assert report.asked == 120
    assert report.topology_kept
    assert report.settings["seed"] == 5
    assert report.quality is not None
    assert report.quality.distance is not None
    assert {"read and repair", "field"} <= set(report.seconds)


def test_json_on_stdout_is_all_there_is(invoke: Invoke, ring: Path) -> None:
    run = invoke("remesh", ring, *FAST, "--json", "-")
    assert json.loads(run.out)["asked"] == 120


def test_the_same_seed_gives_the_same_file(invoke: Invoke, ring: Path) -> None:
    outs = [ring.with_name(f"{name}.obj") for name in "ab"]
    for out in outs:
        assert invoke("remesh", ring, *FAST, "--out", out, "--seed", "1").code == 0
    assert outs[0].read_bytes() == outs[1].read_bytes()


def test_predicts_by_default(invoke: Invoke, ring: Path, small_model: Path) -> None:
    run = invoke("remesh", ring, "--model", small_model, "--target-quads", "150")
    assert run.code == 0
    assert read_quad_mesh(ring.with_name("ring_quads.obj")).is_manifold


def test_field_of_ones_own(invoke: Invoke, ring: Path, small_model: Path) -> None:
    """predict's file is remesh's --field."""
    field = ring.with_name("f.rawfield")
    assert invoke("predict", ring, "--out", field, "--model", small_model).code == 0
    run = invoke("remesh", ring, "--field", field, "--target-quads", "150")
    assert run.code == 0


def test_edge_length(invoke: Invoke, ring: Path) -> None:
    """Quads of that size: area / length^2 of them, and their edges so long on average."""
    run = invoke("remesh", ring, "--method", "curvature", "--edge-length", "0.25", "--json", "-")
    report = json.loads(run.out)
    assert report["asked"] == pytest.approx(4 * np.pi**2 * 0.4 / 0.25**2, rel=0.05)
    assert report["quality"]["edge_length_mean"] == pytest.approx(0.25, rel=0.15)


def test_every_component_is_there(invoke: Invoke, tmp_path: Path) -> None:
    mesh = two_spheres()
    source = write_obj(tmp_path / "two.obj", mesh.vertices, mesh.faces)
    run = invoke("remesh", source, *FAST, "--json", "-")
    report = json.loads(run.out)
    assert (report["output"]["components"], len(report["components"])) == (2, 2)


def test_repairs_are_told(invoke: Invoke, tmp_path: Path) -> None:
    source = write_obj(tmp_path / "soup.obj", *unwelded(icosphere(2)))
    run = invoke("remesh", source, *FAST)
    assert run.code == 0
    assert "repair: duplicate vertices welded" in run.out
    source = write_obj(tmp_path / "parts.obj", *several_broken_parts())
    assert invoke("remesh", source, *FAST, "--quiet").code == 0


def test_symmetric_quads(invoke: Invoke, ring: Path) -> None:
    """Every vertex has its mirror image, to the last digit."""
    run = invoke("remesh", ring, *FAST, "--symmetry", "x")
    assert run.code == 0
    assert "mirror plane" in run.out
    vertices = read_quad_mesh(ring.with_name("ring_quads.obj")).vertices
    assert {tuple(v) for v in (vertices * [-1, 1, 1] + 0.0).tolist()} == {
        tuple(v) for v in (vertices + 0.0).tolist()
    }


def test_density_by_colour(invoke: Invoke, tmp_path: Path) -> None:
    """A ring that is white where x > 0 has more quads there, as far as loops allow."""
    mesh = torus(32, 16)
    colour = np.where(mesh.vertices[:, :1] > 0, 1.0, 0.5) * np.ones(3)
    path = write_obj(tmp_path / "a.obj", np.hstack([mesh.vertices, colour]), mesh.faces)
    run = invoke("remesh", path, "--method", "curvature", "-n", "600", "--density", "color")
    assert run.code == 0
    quads = read_quad_mesh(tmp_path / "a_quads.obj")
    right = quads.vertices[quads.quads].mean(axis=1)[:, 0] > 0
    assert right.sum() > 1.1 * (~right).sum()
    assert invoke("remesh", path, "--density", "weight").refused("'weight'", "color")


def test_density_must_be_positive(invoke: Invoke, tmp_path: Path) -> None:
    """Said before any work, with the number of bad values and the first of them."""
    rows = "0 0 0 1\n1 0 0 0\n0 1 0 nan\n3 0 1 2\n"
    head = "ply\nformat ascii 1.0\nelement vertex 3\n"
    head += "".join(f"property float {c}\n" for c in ("x", "y", "z", "w"))
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    path = tmp_path / "a.ply"
    path.write_text(head + rows, encoding="ascii")
    run = invoke("remesh", path, *FAST, "--density", "w")
    assert run.refused("--density w", "2 values", "0 at vertex 1")
    assert [p.name for p in tmp_path.iterdir() if p.suffix == ".obj"] == []


def test_map_for_libqex(invoke: Invoke, ring: Path) -> None:
    """As many cells of the integer grid as there are quads."""
    uv = ring.with_name("uv.obj")
    run = invoke("remesh", ring, *FAST, "--uv-out", uv, "--json", "-")
    assert run.code == 0
    rows = [line.split() for line in uv.read_text(encoding="ascii").splitlines()]
    points = np.array([row[1:] for row in rows if row[0] == "vt"], dtype=float)
    corners = np.array([[w.split("/")[1] for w in row[1:]] for row in rows if row[0] == "f"])
    a, b, c = np.moveaxis(points[corners.astype(int) - 1], 1, 0)
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert (area > 0).all()
    assert area.sum() == pytest.approx(json.loads(run.out)["made"], rel=1e-6)


# ---- refusals: code 2, one line, nothing written --------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("empty.obj", b"", ["empty.obj", "is empty"]),
        ("blank.obj", b"\n\n", ["blank.obj", "is empty"]),
        ("text.obj", b"this is no mesh\n", ["text.obj", "nor faces"]),
        ("cloud.obj", b"v 0 0 0\nv 1 0 0\n", ["cloud.obj", "no faces"]),
        ("nan.obj", b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", ["nan.obj", "NaN"]),
        ("far.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", ["far.obj"]),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", ["flat.obj", "area"]),
        ("binary.ply", bytes(range(256)), ["binary.ply"]),
        ("junk.glb", b"glTF" + bytes(40), ["junk.glb"]),
        ("mesh.xyz", b"0 0 0\n", ["mesh.xyz", ".obj"]),
    ],
)
def test_unusable_meshes(
    invoke: Invoke, tmp_path: Path, name: str, content: bytes, words: list[str]
) -> None:
    source = tmp_path / name
    source.write_bytes(content)
    run = invoke("remesh", source, "--out", tmp_path / "q.obj", "--method", "curvature")
    assert run.refused(*words), run.err
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_missing_mesh_and_folder(invoke: Invoke, tmp_path: Path) -> None:
    assert invoke("remesh", tmp_path / "no.obj").refused("no.obj", "does not exist")
    assert invoke("remesh", tmp_path, "--out", tmp_path / "q.obj").refused("is a folder")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--out", "q.stl"], ["--out", ".stl", ".obj, .ply or .off"]),
        (["--out", "q"], ["--out", "no suffix"]),
        (["--out", "folder.obj"], ["folder.obj", "is a folder"]),
        (["--out", "ring.obj"], ["--out", "overwrite an input"]),
        (["--out", "ring.obj/deeper/q.obj"], ["is a file"]),
        (["--uv-out", "uv.ply"], ["--uv-out", ".obj"]),
        (["--json", "r.txt"], ["--json", ".json"]),
        (["--preview", "p.jpg"], ["--preview", ".png"]),
        (["--out", "q.obj", "--uv-out", "q.obj"], ["--out and --uv-out both name"]),
        (["--crease", "sharp"], ["--crease", "off", "'sharp'"]),
        (["--crease", "200"], ["--crease"]),
        (["--target-quads", "0"], ["--target-quads"]),
        (["--edge-length", "-1"], ["--edge-length"]),
        (["--edge-length", "1", "--target-quads", "9"], ["--target-quads or --edge-length"]),
        (["--adaptivity", "2"], ["--adaptivity"]),
        (["--method", "curvature", "--model", "m.safetensors"], ["--method", "--model"]),
        (["--field", "f.rosy", "--model", "m.safetensors"], ["--field", "--model"]),
        (["--field", "f.rosy"], ["f.rosy"]),
        (["--field", "f.png"], ["f.png"]),
        (["--model", "no.safetensors"], ["no.safetensors", "does not exist"]),
    ],
)
def test_unusable_options(
    invoke: Invoke,
    ring: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    words: list[str],
) -> None:
    """Refused in one line that names the option, before any work, and nothing is written."""
    monkeypatch.chdir(ring.parent)
    Path("folder.obj").mkdir()
    before = sorted(ring.parent.rglob("*"))
    assert invoke("remesh", "ring.obj", *options).refused(*words)
    after = [p for p in sorted(ring.parent.rglob("*")) if "cache" not in p.parts]
    assert after == before


def test_unknown_device(invoke: Invoke, ring: Path, small_model: Path) -> None:
    run = invoke("remesh", ring, "--model", small_model, "--device", "quantum")
    assert run.refused("--device quantum")


def test_method_must_be_known(invoke: Invoke, ring: Path) -> None:
    run = invoke("remesh", ring, "--method", "magic")
    assert run.code == 2
    assert "magic" in run.err


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("3\n4\n1 0 0\n0 1 0\n0 0 1\n", ["3 crosses", "1024 faces"]),
        ("1024\n4\n" + "nan 0 0\n" * 1024, ["f.rosy"]),
        ("1024\n4\n" + "0 0 0\n" * 1024, ["f.rosy", "zero"]),
        ("hello\n", ["f.rosy"]),
    ],
    ids=["count", "nan", "zero", "text"],
)
def test_unusable_fields(invoke: Invoke, ring: Path, content: str, words: list[str]) -> None:
    field = ring.with_name("f.rosy")
    field.write_text(content, encoding="ascii")
    assert invoke("remesh", ring, "--field", field).refused(*words)
    assert not ring.with_name("ring_quads.obj").exists()


def test_foreign_checkpoints(invoke: Invoke, ring: Path) -> None:
    """A pickle, safetensors of something else, a description without weights."""
    import torch
    from safetensors.torch import save_file

    folder = ring.parent
    (folder / "pickle.pt").write_bytes(b"\x80\x04.")
    save_file({"weight": torch.zeros(2)}, folder / "other.safetensors")
    (folder / "other.json").write_text('{"format": "something else"}', encoding="utf-8")
    save_file({"weight": torch.zeros(2)}, folder / "bare.safetensors")
    for name, word in (("pickle.pt", ".safetensors"), ("other.safetensors", "other.json"),
                       ("bare.safetensors", "bare.json")):  # fmt: skip
        assert invoke("remesh", ring, "--model", folder / name).refused(word)


def test_an_older_result_survives_a_failure(
    invoke: Invoke, ring: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = ring.with_name("q.obj")
    out.write_text("precious", encoding="ascii")

    def broken(*args: object, **kwargs: object) -> None:
        raise RuntimeError("half way")

    monkeypatch.setattr(remeshing, "remesh_predicted", broken)
    assert invoke("remesh", ring, "--out", out, *FAST).code == 1
    assert out.read_text(encoding="ascii") == "precious"


def test_preview_without_its_library(
    invoke: Invoke, ring: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Said before the work, with the command that installs it."""
    monkeypatch.setitem(sys.modules, "pyvista", None)
    run = invoke("remesh", ring, *FAST, "--preview", ring.with_name("p.png"))
    assert run.refused("extra viz", "pip install")
    assert not ring.with_name("ring_quads.obj").exists()
