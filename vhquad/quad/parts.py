"""What is made of one component of a mesh, and all components together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.report import ComponentReport

__all__ = ["Part", "UvMap", "join_quads", "join_uv"]


@dataclass(frozen=True, eq=False)
class UvMap:
    """An integer-grid map of the input: its integer isolines are the edges of the quads.

    Attributes
    ----------
    mesh : TriMesh
        The input, refined where the map needs it.
    uv : (m, 3, 2) float64
        Coordinates of each corner, in quad edges.
    flips : int
        Triangles that the map folds, none but at coarse targets.
    """

    mesh: TriMesh
    uv: NDArray[np.float64]
    flips: int


@dataclass(frozen=True, eq=False)
class Part:
    """The quads of one component, how they were made, and their map if asked for."""

    quads: QuadMesh
    report: ComponentReport
    uv: UvMap | None = None


def join_quads(parts: Sequence[QuadMesh]) -> QuadMesh:
    """All components in one mesh, in order."""
    start = np.cumsum([0, *(part.n_vertices for part in parts)])[:-1]
    return QuadMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.quads + s for part, s in zip(parts, start, strict=True)]),
    )


def join_uv(maps: Sequence[UvMap | None]) -> UvMap | None:
    """All maps in one; None if some component has none."""
    given = [uv for uv in maps if uv is not None]
    if not given or len(given) < len(maps):
        return None
    start = np.cumsum([0, *(uv.mesh.n_vertices for uv in given)])[:-1]
    mesh = TriMesh(
        np.concatenate([uv.mesh.vertices for uv in given]),
        np.concatenate([uv.mesh.faces + s for uv, s in zip(given, start, strict=True)]),
    )
    return UvMap(mesh, np.concatenate([uv.uv for uv in given]), sum(uv.flips for uv in given))
