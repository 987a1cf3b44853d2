"""The smoothing of a given field against its closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.meshes import grid
from vhquad.field.constrained import pose
from vhquad.field.cross import CrossField
from vhquad.field.refine import no_refinement
from vhquad.geometry.frames import face_axes, from_3d


def left_of_a_wave(smoothing: float, confidence: float | None) -> float:
    """Share of a small wave of half the width of a square that is left of it."""
    mesh = grid(40, 40, 1.0, 1.0)
    x = mesh.vertices[mesh.faces].mean(axis=1)[:, 0]
    straight = from_3d(np.tile([1.0, 0.0, 0.0], (mesh.n_faces, 1)), face_axes(mesh)) ** 4
    wave = 1e-3 * np.cos(2 * np.pi * x)
    sure = None if confidence is None else np.full(mesh.n_faces, confidence)
    field = CrossField("faces", straight * np.exp(1j * wave), confidence=sure)
    no_feature = np.zeros(3 * mesh.n_faces, dtype=bool)
    size = np.full(mesh.n_faces, 0.2)
    posed = pose(no_refinement(mesh), no_feature, field, size, smoothing)
    left = np.angle(posed.solve() * straight.conj())
    return float((left * wave).sum() / (wave**2).sum())


TRUST = [(0.5, 0.0), (0.9, 0.0), (0.95, 0.5), (1.0, 1.0)]  # of a confidence


def test_a_field_is_sure_if_it_says_so() -> None:
    confidence, trust = np.array(TRUST).T
    field = CrossField("faces", np.ones(len(TRUST)), confidence=confidence)
    np.testing.assert_allclose(field.trust, trust)
    assert not replace(field, confidence=None).trust.any()


@pytest.mark.parametrize(("confidence", "trust"), TRUST)
@pytest.mark.parametrize("smoothing", [0.25, 1.0])
def test_a_wave_is_damped_by_its_length(smoothing: float, confidence: float, trust: float) -> None:
    """``w / (w + k^2)`` is left of a wave of number k. The weight w is the confidence over the
    squared length of detail, which is half as much where the field is sure."""
    plain, left = (left_of_a_wave(smoothing, value) for value in (None, confidence))
    # On these triangles the wave is no exact eigenvector, and its energy 9 % above the plane's.
    weight = 1.0 / (0.2 * smoothing) ** 2
    assert plain == pytest.approx(weight / (weight + (2 * np.pi) ** 2), rel=0.1)
    # All else is exact: it is as if so much shorter details had been asked for.
    shorter = smoothing * 0.5**trust / np.sqrt(confidence)
    assert 1.0 - left == pytest.approx(1.0 - left_of_a_wave(shorter, None), rel=1e-9)
