"""The terrain example: its truth leads to the summit, and it runs from end to end."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest

from tests.command_line import load_script


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return load_script("examples/terrain.py")


def test_the_truth_leads_to_the_summit(example: ModuleType) -> None:
    """1. From everywhere; and along the ground it points there, up to the relief."""
    terrain = example.make_terrain(np.random.default_rng(3))
    way = terrain.way()
    assert example.arrivals(terrain, way) == 1.0
    assert example.arrivals(terrain, -way) < 0.1
    assert example.degrees(way, way, terrain.mesh) == (pytest.approx(0.0, abs=1e-3),) * 2
    mean, median = example.degrees(1j * way, way, terrain.mesh)
    assert (mean, median) == (pytest.approx(90.0), pytest.approx(90.0))
    modulus = np.abs(way)
    assert np.median(modulus) == pytest.approx(1.0, abs=0.02)


def test_it_runs(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """2. On small terrains, for two steps; one path a figure is known: the truth's."""
    monkeypatch.setattr(example, "POINTS", 14)
    monkeypatch.setattr(sys, "argv", ["terrain.py", "--terrains", "2", "--steps", "2"])
    example.main()
    out = capsys.readouterr().out
    rows = {line[:17].strip(): line for line in out.splitlines()[-4:]}
    assert set(rows) == {"the shortest way", "the network", "its best input", "uphill"}
    assert "100 % arrive" in rows["the shortest way"]
