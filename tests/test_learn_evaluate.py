"""Evaluation: exact and random fields score what they must; baselines beside the model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.learn_data import MODEL, SETTINGS, write_shapes
from vhquad.errors import DatasetError
from vhquad.field.cross import CrossField
from vhquad.learn.evaluate import compare, evaluate
from vhquad.learn.preprocess import preprocess
from vhquad.nn.checkpoint import Model
from vhquad.nn.network import VectorHeatNet


def test_rows(tmp_path: Path) -> None:
    """1. A row a method and group; on a torus the principal directions are the truth."""
    write_shapes(tmp_path / "in", 2)
    (tmp_path / "in" / "split.json").write_text('{"ring0": "test", "ring1": "test"}')
    dataset = preprocess(tmp_path / "in", tmp_path / "out", SETTINGS, 1)
    rows = evaluate(Model(VectorHeatNet(MODEL)), dataset.folder)
    found = {row.method.split(" 0.")[0]: row for row in rows if row.group == "whole"}
    methods = {"model", "model + curvature", "random", "principal", "curvature-aligned"}
    assert set(found) == methods
    assert found["model + curvature"].direction < 0.1  # random weights earn no confidence
    assert found["random"].direction == pytest.approx(1.0, abs=0.15)
    assert found["random"].mean_angle == pytest.approx(22.5, abs=2.0)
    assert found["principal"].direction < 0.1
    assert found["curvature-aligned"].direction < 0.05
    assert found["random"].magnitude is None
    assert found["model"].magnitude is not None
    assert found["model"].meshes == 2
    assert found["random"].to_dict()["group"] == "whole"
    with pytest.raises(DatasetError, match="val split"):
        evaluate(Model(VectorHeatNet(MODEL)), dataset.folder, split="val")


def test_compare_by_hand() -> None:
    """2. Weights are area times coherence; vertices without truth do not count."""
    truth = CrossField(
        "vertices", np.array([1.0, 1.0, 0.0]), np.array([1.0, 2.0, 0.0]), np.array([1.0, 0.5, 0.0])
    )
    field = CrossField("vertices", np.array([1.0, -1.0, 1.0]), np.array([1.5, 2.0, 9.0]))
    errors = compare(field, truth, np.array([1.0, 2.0, 5.0]))
    np.testing.assert_allclose(errors.weight, [0.5, 0.5, 0.0])
    np.testing.assert_allclose(errors.cosine[:2], [1.0, -1.0])
    assert errors.relative_size is not None
    np.testing.assert_allclose(errors.relative_size, [0.5, 0.0, 0.0])
