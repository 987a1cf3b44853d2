"""A picture of a remesh: the input, its cross field, the quads, side by side."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.field.cross import CrossField
from vhquad.field.singular import find_singularities
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.picture import SURFACE, View, draw_crosses, open_panel, picture, view_of

__all__ = ["COLOURS", "draw_preview"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COLOURS = {2: "#9b30b0", 3: "#d7301f", 5: "#2166ac", 6: "#08a8a0"}
"""Colour of a vertex by its quads; 2 stands for fewer too, 6 for more."""

INDICES = {2: "index +1/2", 3: "index +1/4", 5: "index -1/4", 6: "index -1/2"}
VALENCES = {2: "valence 2", 3: "valence 3", 5: "valence 5", 6: "valence 6+"}
EDGE = "#303030"


def draw_preview(
    path: str | os.PathLike[str], mesh: TriMesh, field: CrossField, quads: QuadMesh
) -> None:
    """Draw three panels to a PNG file: triangles; crosses and singularities; quads.

    Parameters
    ----------
    path : str or PathLike
        A ``.png`` file, written whole or not at all.
    mesh : TriMesh
        The input.
    field : CrossField
        On its vertices or faces.
    quads : QuadMesh
        The result; irregular vertices are marked by valence.

    Raises
    ------
    ConfigError
        If pyvista is not installed.
    """
    with picture(path, 3) as (plotter, pv):
        view = view_of(mesh)
        open_panel(plotter, 0, f"input: {mesh.n_faces:,} triangles", view)
        _surface(plotter, pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces), 0.6)
        _field_panel(plotter, pv, mesh, field, view)
        _quad_panel(plotter, pv, quads, view, mesh.diagonal)


def _field_panel(plotter: Any, pv: Any, mesh: TriMesh, field: CrossField, view: View) -> None:
    singular = find_singularities(mesh, field)
    open_panel(plotter, 1, f"cross field: {len(singular)} singularities", view)
    smooth = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    plotter.add_mesh(smooth, color=SURFACE, smooth_shading=True, ambient=0.35, specular=0.0)
    draw_crosses(plotter, pv, mesh, field)
    points = mesh.vertices[singular.vertex]
    _marks(plotter, pv, points, 4 - singular.quarters, mesh.diagonal, INDICES)


def _quad_panel(plotter: Any, pv: Any, quads: QuadMesh, view: View, diagonal: float) -> None:
    irregular = np.flatnonzero(
        ~quads.is_boundary_vertex & (quads.valence > 0) & (quads.valence != 4)
    )
    open_panel(plotter, 2, f"{quads.n_quads:,} quads: {len(irregular)} irregular vertices", view)
    if quads.n_quads:
        _surface(plotter, pv.PolyData.from_regular_faces(quads.vertices, quads.quads), 1.2)
    points, valence = quads.vertices[irregular], quads.valence[irregular]
    _marks(plotter, pv, points, valence, diagonal, VALENCES)


def _surface(plotter: Any, surface: Any, width: float) -> None:
    plotter.add_mesh(
        surface,
        color=SURFACE,
        show_edges=True,
        edge_color=EDGE,
        line_width=width,
        ambient=0.35,
        specular=0.0,
    )


def _marks(
    plotter: Any, pv: Any, points: Floats, quads: Ints, diagonal: float, names: dict[int, str]
) -> None:
    """Balls at singular or irregular vertices, coloured by their quads, and a legend."""
    kind = np.clip(quads, 2, 6)
    legend = []
    for value, colour in COLOURS.items():
        chosen = points[kind == value]
        if len(chosen) == 0:
            continue
        ball = pv.Sphere(radius=0.0055 * diagonal, theta_resolution=12, phi_resolution=12)
        balls = pv.PolyData(chosen).glyph(geom=ball, scale=False, orient=False)
        plotter.add_mesh(balls, color=colour, ambient=0.5, specular=0.0)
        legend.append([f"{len(chosen)} {names[value]}", colour])
    if legend:
        plotter.add_legend(
            legend,
            face="circle",
            bcolor=None,
            size=(0.34, 0.035 * len(legend)),
            loc="lower left",
            font_family="arial",
        )
