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
from vhquad.field.cross import CrossField
from vhquad.field.transport import to_faces
from vhquad.geometry.frames import face_axes, to_3d
from vhquad.mesh.triangle import TriMesh

__all__ = ["SURFACE", "View", "check_viz", "draw_crosses", "open_panel", "picture", "view_of"]

Floats = NDArray[np.float64]

PANEL = (760, 860)  # pixels
MARGIN = 1.2
SURFACE = "#dcdcd6"
"""Colour of a surface that shows nothing else."""
CROSS = "#3c3c3c"
CROSSES = 2500  # drawn, about
ARM = 0.42  # half a cross, of the mean distance between crosses
LIFT = 0.12  # of an arm, so that crosses stand clear of the surface


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
def picture(
    path: str | os.PathLike[str], panels: int, panel: tuple[int, int] = PANEL
) -> Iterator[tuple[Any, Any]]:
    """A row of panels to draw into, written to a PNG file on leaving, whole or not at all.

    Parameters
    ----------
    path : str or PathLike
    panels : int
    panel : (int, int)
        Width and height of each, in pixels.

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
    size = [panels * panel[0], panel[1]]
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


def draw_crosses(
    plotter: Any, pv: Any, mesh: TriMesh, field: CrossField, count: int = CROSSES
) -> None:
    """Lay about so many crosses of a field on the surface, into the open panel."""
    start, end = _segments(mesh, field, count)
    n = len(start)
    ends = np.stack([np.full(n, 2), np.arange(n), np.arange(n) + n], axis=1)
    lines = pv.PolyData(np.concatenate([start, end]), lines=ends)
    plotter.add_mesh(lines, color=CROSS, line_width=1.6, lighting=False)


def _segments(mesh: TriMesh, field: CrossField, count: int) -> tuple[Floats, Floats]:
    """Both lines of a cross at faces spread evenly over the surface; ends (2q, 3) each."""
    crosses = field if field.domain == "faces" else to_faces(mesh, field)
    spacing = np.sqrt(mesh.area / count)
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    known = np.flatnonzero((crosses.z != 0) & (mesh.face_areas > 0))
    cell = np.floor(centre[known] / spacing).astype(np.int64)
    known = known[np.unique(cell, axis=0, return_index=True)[1]]
    length = ARM * np.sqrt(mesh.area / max(len(known), 1))
    axes = face_axes(mesh)
    u = np.exp(1j * crosses.angle)
    centre = centre[known] + LIFT * length * mesh.face_normals[known]
    arms = [length * to_3d(u * turn, axes)[known] for turn in (1.0, 1j)]
    start = np.concatenate([centre - arm for arm in arms])
    return start, np.concatenate([centre + arm for arm in arms])


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
