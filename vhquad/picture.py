"""Pictures of meshes in rows of panels, as PNG files; needs no display.

Drawn by pyvista (the extra ``viz``), off screen, which works without a display or graphics card.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.atomic import atomic_path
from vhquad.errors import ConfigError
from vhquad.mesh.triangle import TriMesh

__all__ = ["SURFACE", "View", "check_viz", "open_panel", "picture", "view_of"]

Floats = NDArray[np.float64]

PANEL = (760, 860)  # pixels
MARGIN = 1.2
SURFACE = "#dcdcd6"
"""Colour of a surface that shows nothing else."""


@dataclass(frozen=True)
class View:
    """Where the camera stands: the same for all panels."""

    focus: Floats
    position: Floats
    up: tuple[float, float, float]
    scale: float


def check_viz() -> None:
    """Refuse a picture before the long work if its library is missing.

    Raises
    ------
    ConfigError
    """
    try:
        import_module("pyvista")
    except ImportError as error:
        raise ConfigError(
            f"a picture needs the extra viz ({error}); install it with: pip install 'vhquad[viz]'"
        ) from None


@contextmanager
def picture(path: str | os.PathLike[str], panels: int) -> Iterator[tuple[Any, Any]]:
    """A row of panels to draw into, written to a PNG file on leaving, whole or not at all.

    Yields
    ------
    (plotter, pyvista)
        The plotter has one row of ``panels`` subplots; see :func:`open_panel`.

    Raises
    ------
    ConfigError
        If pyvista is not installed.
    """
    check_viz()
    pv: Any = import_module("pyvista")
    vtk: Any = import_module("vtk")
    vtk.vtkObject.GlobalWarningDisplayOff()  # it complains of the missing display, then copes
    size = [panels * PANEL[0], PANEL[1]]
    plotter = pv.Plotter(off_screen=True, shape=(1, panels), window_size=size, border=False)
    try:
        plotter.set_background("white")
        yield plotter, pv
        with atomic_path(path) as temporary:
            plotter.screenshot(str(temporary))
    finally:
        plotter.close()


def open_panel(plotter: Any, column: int, title: str, view: View) -> None:
    """Go on in this panel, under a title."""
    plotter.subplot(0, column)
    plotter.add_text(title, font_size=11, color="black", position="upper_edge", font="arial")
    plotter.camera.focal_point = view.focus
    plotter.camera.position = view.position
    plotter.camera.up = view.up
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = view.scale


def view_of(mesh: TriMesh) -> View:
    """From the front, the right and above, all of the mesh in sight and room for the legend."""
    z_up = _stands_on_z(mesh)
    up = (0.0, 0.0, 1.0) if z_up else (0.0, 1.0, 0.0)
    direction = np.array([0.55, -1.0, 0.25] if z_up else [0.55, 0.25, 1.0])
    direction /= np.linalg.norm(direction)
    side = np.cross(up, direction)
    side /= np.linalg.norm(side)
    top = np.cross(direction, side)
    focus = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    across, along = (mesh.vertices - focus) @ side, (mesh.vertices - focus) @ top
    focus = focus + 0.5 * ((across.min() + across.max()) * side + (along.min() + along.max()) * top)
    scale = 0.5 * MARGIN * max(float(np.ptp(along)), float(np.ptp(across)) * PANEL[1] / PANEL[0])
    focus = focus - 0.05 * scale * top
    return View(focus, focus + 3.0 * mesh.diagonal * direction, up, scale)


def _stands_on_z(mesh: TriMesh) -> bool:
    """Guess whether z points up, not y: by where the openings are, as at a neck, if there are."""
    if mesh.is_closed:
        return False
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    opening = mesh.vertices[mesh.is_boundary_vertex].mean(axis=0)
    depth = (0.5 * (low + high) - opening) / np.maximum(high - low, 1e-12 * mesh.diagonal)
    return bool(depth[2] > max(depth[1], 0.2))
