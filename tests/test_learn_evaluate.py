"""Evaluation: exact and random fields score what they must; baselines beside the model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.learn_data import MODEL, SETTINGS, write_shapes
from vhquad.errors import DatasetError, ModelError
from vhquad.field.cross import CrossField
from vhquad.learn.dataset import Dataset, SampleEntry
from vhquad.learn.evaluate import evaluate
from vhquad.learn.preprocess import preprocess
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import Model
from vhquad.nn.network import VectorHeatNet


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Two rings for testing, whole and varied."""
    folder = tmp_path_factory.mktemp("evaluate")
    write_shapes(folder / "in", 2)
    (folder / "in" / "split.json").write_text('{"ring0": "test", "ring1": "test"}')
    return preprocess(folder / "in", folder / "out", SETTINGS, 1)


def test_rows(dataset: Dataset) -> None:
    """1. A row a method and group; on a torus the principal directions are the truth."""
    found = evaluate(Model(VectorHeatNet(MODEL)), dataset.folder)
    rows = {row.method: row for row in found.rows if row.group == "whole"}
    assert set(rows) == {"model", "model + curvature", "curvature", "principal", "random"}
    assert rows["model + curvature"].direction < 0.1  # random weights earn no confidence
    assert rows["random"].direction == pytest.approx(1.0, abs=0.15)
    assert rows["random"].mean_angle == pytest.approx(22.5, abs=2.0)
    assert rows["principal"].direction < 0.1
    assert rows["curvature"].direction < 0.05
    assert rows["random"].magnitude is None
    assert rows["model"].magnitude is not None
    assert rows["model"].meshes == 2
    assert {row.group for row in found.rows} == {"all"} | {e.variant for e in dataset.samples}
    assert found.row("random").meshes == len(found.samples) == 4

    scores = [sample.direction["random"] for sample in found.samples]
    assert found.row("random").direction == pytest.approx(np.mean(scores))
    assert sum(b.share for b in found.calibration) == pytest.approx(1.0)
    parts = sum(b.share * b.losses["model"] for b in found.calibration)
    assert parts == pytest.approx(found.row("model").direction)


def test_polished(dataset: Dataset) -> None:
    """2. On a torus the polish leaves the truth as it is, and what curvature makes of it."""
    found = evaluate(Model(VectorHeatNet(MODEL)), dataset.folder)
    whole = {row.method: row for row in found.polished if row.group == "whole"}
    assert set(whole) == {"model + curvature", "curvature", "ground truth"}
    assert whole["ground truth"].direction < 0.01
    assert whole["curvature"].direction < 0.05
    assert whole["curvature"].meshes == 2
    scores = [sample.polished["curvature"] for sample in found.samples]
    every = {row.method: row for row in found.polished if row.group == "all"}
    assert every["curvature"].direction == pytest.approx(np.mean(scores))


def test_no_face_with_truth(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    """3. Truth at single vertices is compared there; no face has any, so no polished row."""
    whole = Dataset.truth_field

    def lone(self: Dataset, entry: SampleEntry) -> CrossField:
        truth = whole(self, entry)
        z = np.zeros_like(truth.z)
        z[0] = truth.z[0]
        return replace(truth, z=z)

    monkeypatch.setattr(Dataset, "truth_field", lone)
    found = evaluate(Model(VectorHeatNet(MODEL)), dataset.folder)
    assert found.polished == ()
    assert found.row("principal").meshes == 4
    assert found.row("principal").direction < 0.1


def test_singularities(dataset: Dataset) -> None:
    """4. A ring has none, and neither has what curvature makes of it."""
    rows = evaluate(Model(VectorHeatNet(MODEL)), dataset.folder).singularities
    whole = {row.method: row for row in rows if row.group == "whole"}
    assert set(whole) == {"ground truth", "model + curvature", "curvature"}
    assert (whole["ground truth"].artists, whole["ground truth"].count) == (0, 0)
    assert whole["curvature"].count == 0
    assert whole["curvature"].meshes == 2


def test_splits(dataset: Dataset) -> None:
    model = Model(VectorHeatNet(MODEL))
    with pytest.raises(DatasetError, match="val split"):
        evaluate(model, dataset.folder, split="val")
    calls: list[tuple[int, int]] = []
    found = evaluate(
        model, dataset.folder, split="all", on_sample=lambda *count: calls.append(count)
    )
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert {sample.split for sample in found.samples} == {"test"}


def test_refusals(dataset: Dataset) -> None:
    """5. Models for other data, and those that predict no crosses."""
    with pytest.raises(DatasetError, match="k = 12"):
        evaluate(Model(VectorHeatNet(replace(MODEL, k=12))), dataset.folder)
    with pytest.raises(ModelError, match="order 1"):
        evaluate(Model(VectorHeatNet(replace(MODEL, order=1))), dataset.folder)


def test_maps(dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """6. A picture a sample; a field that is right is dark where a wrong one is bright."""
    pv = pytest.importorskip("pyvista")
    from vhquad.learn.maps import draw_error_map
    from vhquad.learn.scores import FieldErrors

    monkeypatch.delenv("DISPLAY", raising=False)
    mesh = dataset.mesh(dataset.samples[0])
    n = mesh.n_vertices
    weight = np.full(n, 1.0 / n)
    errors = {
        "right": FieldErrors(weight, np.ones(n), None),
        "wrong": FieldErrors(weight, -np.ones(n), None),
    }
    draw_error_map(tmp_path / "map.png", mesh, errors, np.zeros(n))
    image = pv.read(tmp_path / "map.png")
    pixels = np.asarray(image.active_scalars).reshape(image.dimensions[1], -1, 3).astype(int)
    right, wrong, confidence = np.array_split(pixels, 3, axis=1)
    middle = slice(pixels.shape[0] // 3, None)  # without the titles and, at the foot, the bars
    for panel, yellow in ((right, False), (wrong, True), (confidence, False)):
        upper = panel[middle]
        coloured = upper[np.ptp(upper, axis=2) > 60]
        assert len(coloured) > 1000
        assert (np.median(coloured[:, 1]) > np.median(coloured[:, 2])) == yellow

    drawn: dict[str, list[str]] = {}

    def draw(path: Path, mesh: TriMesh, errors: dict[str, FieldErrors], *rest: object) -> None:
        drawn[path.name] = list(errors)

    monkeypatch.setattr("vhquad.learn.evaluate.draw_error_map", draw)
    evaluate(Model(VectorHeatNet(MODEL)), dataset.folder, maps=tmp_path / "maps")
    methods = ["model + curvature", "curvature"]
    assert drawn == {f"{entry.name}.png": methods for entry in dataset.samples}
