"""Losses, angles, sizes and calibration, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.learn.scores import FieldErrors, calibration, compare, evaluation_row


def test_compare_by_hand() -> None:
    """1. Weights are area times coherence; vertices without truth do not count."""
    truth = CrossField(
        "vertices", np.array([1.0, 1.0, 0.0]), np.array([1.0, 2.0, 0.0]), np.array([1.0, 0.5, 0.0])
    )
    field = CrossField("vertices", np.array([1.0, -1.0, 1.0]), np.array([1.5, 2.0, 9.0]))
    errors = compare(field, truth, np.array([1.0, 2.0, 5.0]))
    np.testing.assert_allclose(errors.weight, [0.5, 0.5, 0.0])
    np.testing.assert_allclose(errors.cosine[:2], [1.0, -1.0])
    np.testing.assert_allclose(errors.angle[:2], [0.0, 45.0])
    assert errors.direction == pytest.approx(1.0)
    assert errors.ratio is not None
    np.testing.assert_allclose(errors.ratio, [1.5, 1.0, 0.0])
    with pytest.raises(FieldError, match="empty"):
        compare(field, truth, np.array([0.0, 0.0, 5.0]))


def test_row_by_hand() -> None:
    """2. Each mesh counts the same, however many vertices it has; sizes as logarithms."""
    one = FieldErrors(np.array([1.0]), np.array([1.0]), np.array([np.e]))
    cosine = np.cos(4.0 * np.radians([20.0, 10.0]))
    two = FieldErrors(np.array([0.5, 0.5]), cosine, np.array([1.0, np.exp(2.0)]))
    row = evaluation_row("m", "all", [one, two])
    assert row.meshes == 2
    assert row.mean_angle == pytest.approx(0.25 * 20.0 + 0.25 * 10.0)
    assert (row.median_angle, row.p95_angle) == (pytest.approx(0.0), pytest.approx(20.0))
    assert row.over_15 == pytest.approx(0.25)
    assert row.direction == pytest.approx(0.25 * (1.0 - cosine).sum())
    # logarithms 1, 0, 2 with weights 1/2, 1/4, 1/4: mean 1, variance 1/2
    assert row.size_bias == pytest.approx(np.e - 1.0)
    assert row.size_spread == pytest.approx(np.sqrt(0.5))
    assert row.magnitude == pytest.approx(0.5 * (np.e - 1.0) + 0.25 * (np.e**2 - 1.0))


def test_unknown_sizes_are_left_out() -> None:
    """3. A ratio of 0 is none; a method without sizes has no figures of them."""
    half = np.array([0.5, 0.5])
    row = evaluation_row("m", "all", [FieldErrors(half, np.ones(2), np.array([0.0, 1.5]))])
    assert row.magnitude == pytest.approx(0.5)
    assert row.size_spread == pytest.approx(0.0)
    none = evaluation_row("m", "all", [FieldErrors(half, np.ones(2), None)])
    assert (none.magnitude, none.size_bias, none.size_spread) == (None, None, None)


def test_calibration_by_hand() -> None:
    """4. Confidence 0 and 1 are bins of their own; shares sum to 1; empty bins are left out."""
    stated = np.array([0.0, 0.05, 0.051, 0.99, 1.0])
    weight = np.array([0.1, 0.2, 0.3, 0.2, 0.2])
    cosine = np.array([0.0, 0.5, 0.6, 0.9, 1.0])
    errors = {"m": [FieldErrors(weight, cosine, None)], "n": [FieldErrors(weight, -cosine, None)]}
    bins = calibration([stated], errors)
    assert [(b.low, b.high) for b in bins] == [(0, 0), (0, 0.05), (0.05, 0.2), (0.8, 1), (1, 1)]
    np.testing.assert_allclose([b.share for b in bins], weight)
    np.testing.assert_allclose([b.losses["m"] for b in bins], 1.0 - cosine)
    np.testing.assert_allclose([b.losses["n"] for b in bins], 1.0 + cosine)
