"""The invariance experiments change nothing but what they say."""

from __future__ import annotations

import importlib
from types import ModuleType

import numpy as np
import pytest

from tests.command_line import ROOT
from tests.meshes import blob, half_sphere
from vhquad.field.cross import CrossField
from vhquad.learn.baselines import curvature
from vhquad.mesh.triangle import TriMesh


@pytest.fixture(scope="module")
def experiments() -> ModuleType:
    pytest.importorskip("matplotlib")  # comes with pyvista
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "benchmarks")
        return importlib.import_module("invariances")


def test_folding_keeps_every_length(experiments: ModuleType) -> None:
    """1. To rounding, by any angle; and it does leave the plane."""
    flat = experiments.folded_sheet(0.0)
    assert np.ptp(flat.vertices[:, 2]) == 0.0
    for fold in (0.3, 0.9, 1.4):
        folded = experiments.folded_sheet(fold)
        np.testing.assert_allclose(folded.edge_lengths, flat.edge_lengths, rtol=1e-12)
        assert np.ptp(folded.vertices[:, 2]) > 0.2


@pytest.mark.parametrize("mesh", [blob(2), half_sphere(2)])
def test_renumbering_is_undone(
    experiments: ModuleType, mesh: TriMesh, rng: np.random.Generator
) -> None:
    """2. A field that depends on no numbers comes back as it was, whatever the frames."""
    new = rng.permutation(mesh.n_vertices)
    other = experiments._renumbered(mesh, new, rng)
    assert not np.array_equal(other.faces, mesh.faces)
    before = curvature(mesh)
    back = experiments._numbered_back(mesh, other, new, curvature(other))
    assert isinstance(back, CrossField)
    np.testing.assert_allclose(back.z, before.z, atol=1e-6)
