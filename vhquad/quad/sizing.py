"""How long the quad edges are to be at each face: the field's sizes, adaptivity, density, count."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import ConfigError
from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh

__all__ = ["SIZE_RANGE", "WantedSizes", "checked_density", "wanted_sizes"]

Floats = NDArray[np.float64]

DEFAULT_QUADS = 4000  # where neither a count nor a size is given
MOST_A_FACE = 4.0  # quads; sizes that amount to more are not believed
SIZE_RANGE = 8.0
"""Sizes of the field, and what a density makes of them, are kept within this factor of their
middle."""


class WantedSizes(NamedTuple):
    """How long quad edges are to be.

    Attributes
    ----------
    relative : (m,) float64
        At each face, up to ``scale``: the same whatever the count asked for.
    scale : float
    quads : int
        That the scaled lengths amount to.
    """

    relative: Floats
    scale: float
    quads: int

    @property
    def lengths(self) -> Floats:
        """The edge lengths themselves; (m,)."""
        return self.relative * self.scale

    def relative_at_vertices(self, mesh: TriMesh) -> Floats:
        """The mean of the relative ones around each vertex of the mesh they are for; (n,)."""
        corner, each = mesh.faces.reshape(-1), np.repeat(np.log(self.relative), 3)
        count = np.bincount(corner, minlength=mesh.n_vertices)
        return np.exp(np.bincount(corner, each, mesh.n_vertices) / np.maximum(count, 1))


def checked_density(density: ArrayLike, n_vertices: int, name: str = "density") -> Floats:
    """A density with one positive, finite value a vertex.

    Parameters
    ----------
    density : (n,) array_like
    n_vertices : int
    name : str
        What to call it in messages.

    Raises
    ------
    ConfigError
        If it is something else; the message counts the bad values and names the first.
    """
    values = np.asarray(density, dtype=np.float64)
    if values.shape != (n_vertices,):
        raise ConfigError(
            f"{name} must hold one value for each of {n_vertices} vertices, not {values.shape}"
        )
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
    if len(bad):
        raise ConfigError(
            f"{name} must be positive and finite: {len(bad)} values are not, the first is "
            f"{values[bad[0]]:g} at vertex {bad[0]}"
        )
    return values


def wanted_sizes(
    mesh: TriMesh,
    field: CrossField,
    *,
    adaptivity: float = 1.0,
    density: Floats | None = None,
    target_quads: int | None = None,
    edge_length: float | None = None,
) -> WantedSizes:
    """Wanted edge length of each face, and the number of quads that these amount to.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On faces; its sizes count, if it has some.
    adaptivity : float
        0 for one size, 1 for the sizes of the field, anything between.
    density : (n,) float64, optional
        Positive; multiplies the quads per area at each vertex, after the adaptivity.
    target_quads, edge_length : optional
        At most one of them: what all is scaled to. With neither, the sizes of the field say, unless
        they amount to more than four quads a face.

    Returns
    -------
    WantedSizes
    """
    if field.size is None or not (field.size > 0).any():
        size = np.ones(mesh.n_faces)
        native = None
    else:
        middle = float(np.median(field.size[field.size > 0]))
        size = np.where(field.size > 0, field.size, middle)
        size = np.clip(size, middle / SIZE_RANGE, middle * SIZE_RANGE)
        native = float((mesh.face_areas / size**2).sum())
        mean = _mean(mesh, size)
        size = mean * (size / mean) ** adaptivity
    if density is not None:
        factor = np.exp(-0.5 * np.log(density)[mesh.faces].mean(axis=1))
        if native is not None:
            native *= float((mesh.face_areas / (size * factor) ** 2).sum())
            native /= float((mesh.face_areas / size**2).sum())
        size = size * factor
        mean = _mean(mesh, size)
        size = np.clip(size, mean / SIZE_RANGE, mean * SIZE_RANGE)
    if target_quads is not None:
        target = float(target_quads)
    elif edge_length is not None:
        target = mesh.area / edge_length**2
    elif native is not None and native <= max(MOST_A_FACE * mesh.n_faces, DEFAULT_QUADS):
        target = native
    else:
        target = float(DEFAULT_QUADS)
    count = float((mesh.face_areas / size**2).sum())
    return WantedSizes(size, float(np.sqrt(count / target)), max(round(target), 1))


def _mean(mesh: TriMesh, size: Floats) -> float:
    """Mean over the area, of the logarithms."""
    return float(np.exp(np.average(np.log(size), weights=mesh.face_areas + 1e-300)))
