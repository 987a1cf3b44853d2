"""The preview: a picture of three panels, drawn without a display."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.meshes import half_sphere, quad_cube, torus
from vhquad.field.baseline import curvature_field
from vhquad.field.cross import CrossField
from vhquad.preview import draw_preview


@pytest.fixture(autouse=True)
def _no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyvista")
    monkeypatch.delenv("DISPLAY", raising=False)


def pixels(path: Path) -> np.ndarray:
    import pyvista as pv

    image = pv.read(path)
    return np.asarray(image.active_scalars).reshape(image.dimensions[1], -1, 3)


def test_three_panels(tmp_path: Path) -> None:
    """Each third of the picture holds something other than the white ground."""
    path = tmp_path / "p.png"
    mesh = torus()
    draw_preview(path, mesh, curvature_field(mesh), quad_cube(3))
    image = pixels(path)
    for panel in np.array_split(image, 3, axis=1):
        assert (panel < 200).any(axis=2).mean() > 0.02
    assert [p.name for p in tmp_path.iterdir()] == ["p.png"]


def test_marks_have_their_colours(tmp_path: Path) -> None:
    """A cube of quads has eight vertices of valence 3: red, in the last panel."""
    path = tmp_path / "p.png"
    mesh = half_sphere()
    draw_preview(path, mesh, CrossField("vertices", np.ones(mesh.n_vertices)), quad_cube(2))
    panel = np.array_split(pixels(path).astype(int), 3, axis=1)[2]
    red = (panel[..., 0] > 150) & (panel[..., 1] < 90) & (panel[..., 2] < 90)
    assert red.any()
