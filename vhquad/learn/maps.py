"""Pictures of errors: a mesh coloured by how far fields are from the truth, and by confidence."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.learn.scores import FieldErrors
from vhquad.mesh.triangle import TriMesh
from vhquad.picture import SURFACE, open_panel, picture, view_of

__all__ = ["draw_error_map"]

Floats = NDArray[np.float64]

WORST = 45.0  # degrees; no two crosses are further apart


def draw_error_map(
    path: str | os.PathLike[str],
    mesh: TriMesh,
    errors: Mapping[str, FieldErrors],
    confidence: Floats,
) -> None:
    """Draw a panel a method, coloured by the angle to the truth, and one of the confidence.

    Parameters
    ----------
    path : str or PathLike
        A ``.png`` file, written whole or not at all.
    mesh : TriMesh
    errors : dict of str to FieldErrors
        By method; what has no weight stays grey.
    confidence : (n,) float64
        In [0, 1].

    Raises
    ------
    ConfigError
        If pyvista is not installed.
    """
    with picture(path, len(errors) + 1) as (plotter, pv):
        view = view_of(mesh)
        surface = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
        for column, (method, found) in enumerate(errors.items()):
            open_panel(plotter, column, f"{method}: {found.weight @ found.angle:.1f}° off", view)
            angle = np.where(found.weight > 0, found.angle, np.nan)
            _coloured(plotter, surface, angle, WORST, "%.0f°", column)
        open_panel(plotter, len(errors), "confidence of the model", view)
        _coloured(plotter, surface, confidence, 1.0, "%.1f", len(errors))


def _coloured(
    plotter: Any, surface: Any, values: Floats, top: float, text: str, column: int
) -> None:
    plotter.add_mesh(
        surface.copy(),
        scalars=values,
        clim=(0.0, top),
        cmap="viridis",
        nan_color=SURFACE,
        smooth_shading=True,
        ambient=0.5,
        specular=0.0,
        scalar_bar_args={
            "title": " " * (column + 1),  # bars of one title would be one bar
            "color": "black",
            "font_family": "arial",
            "label_font_size": 16,
            "n_labels": 4,
            "fmt": text,
            "position_x": 0.2,
            "position_y": 0.02,
            "width": 0.6,
            "height": 0.07,
        },
    )
