"""The programs beside the model card: crops of heads, and the fit of the confidence."""

from __future__ import annotations

import numpy as np
import pytest

from tests.command_line import load_script


@pytest.mark.parametrize("kind", ["neck", "mask"])
def test_crops_take_off_what_they_say(kind: str) -> None:
    """1. The lowest goes, the top stays; a mask besides is the front. Units do not matter."""
    crop = load_script("benchmarks/head_crops.py").crop
    rng = np.random.default_rng(0)
    x = rng.random((4000, 3)) * [3.0, 5.0, 7.0] - 2.0
    areas = np.ones(len(x))
    kept = crop(x, areas, kind, np.random.default_rng(1)) > 0
    low, front = x[:, 2] < -2.0 + 0.05 * 7.0, x[:, 1] < -2.0 + 0.1 * 5.0
    assert not kept[low].any()
    assert kept[~low & front & (x[:, 2] > 0.5)].all()
    behind = x[:, 1] > -2.0 + 0.7 * 5.0
    assert kept[behind].any() == (kind == "neck")
    again = crop(7.0 * x + 1.0, areas, kind, np.random.default_rng(1)) > 0
    np.testing.assert_array_equal(again, kept)


def test_the_fit_finds_what_tells_right_from_wrong() -> None:
    """2. A model that is right where it agrees with itself: trusted there, and only there."""
    fit = load_script("benchmarks/fit_confidence.py")
    rng = np.random.default_rng(0)
    truth, wrong = np.exp(2j * np.pi * rng.random((2, 500)))
    rough = truth * np.exp(1j * rng.normal(0.0, 0.8, 500))
    agreed = rng.random(500)
    model = np.where(agreed > 0.5, truth, wrong)
    sample = fit.Drawn("shape", model, rough, truth, 0.9, agreed)
    good, blind, deaf = (0.0, 0.5, 0.55, 1), (0.0, -2.0, -1.0, 1), (0.0, 2.0, 3.0, 1)
    # 1. All trust is the model alone, none the other field alone.
    assert sample.loss(sample.blended(blind)) == pytest.approx(sample.loss(model))
    assert sample.loss(sample.blended(deaf)) == pytest.approx(sample.loss(rough))
    # 2. The right constants beat both, and cost less.
    assert sample.loss(sample.blended(good)) < 0.7 * min(sample.loss(model), sample.loss(rough))
    costs = [fit.cost([sample], constants) for constants in (good, blind, deaf)]
    assert costs[0] < min(costs[1:])
    # 3. A sure model is trusted whatever the neighbourhood says, if the shape decides.
    sure = fit.Drawn("shape", truth, wrong, truth, 1.0, np.full(500, 0.9))
    assert sure.loss(sure.blended((0.7, 0.8, 0.97, 1))) == pytest.approx(0.0, abs=1e-12)
