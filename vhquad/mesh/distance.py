"""How far two surfaces are apart: both ways, from samples that cover each evenly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh

__all__ = ["Distance", "SurfaceSamples", "sample_surface", "surface_distance"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SAMPLES = 100_000
_STEP = np.array([0.7548776662466927, 0.5698402909980532])
"""Roberts' additive sequence in the plane, from the plastic number."""


@dataclass(frozen=True)
class Distance:
    """Distances between a result and the surface it stands for, in % of the surface's diagonal."""

    hausdorff: float
    """The largest distance, both ways."""
    mean: float
    """The mean of the two mean distances."""
    to_surface_max: float
    """Farthest that a point of the result is from the surface."""
    to_surface_mean: float
    from_surface_max: float
    """Farthest that a point of the surface is from the result."""
    from_surface_mean: float


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Points spread over triangles, each standing for about the same area."""

    point: Floats
    """(s, 3)"""
    face: Ints
    """(s,) triangle of each point."""
    area: Floats
    """(s,) area that each point stands for."""


def sample_surface(vertices: Floats, faces: Ints, count: int) -> SurfaceSamples:
    """About `count` points, and at least one a triangle, the same ones every time.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    count : int
    """
    p = vertices[faces]
    area = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    total = float(area.sum())
    share = area * (count / total) if total > 0 else np.zeros(len(faces))
    number = np.maximum(1, np.rint(share)).astype(np.int64)
    face = np.repeat(np.arange(len(faces)), number)
    place = np.arange(len(face)) - np.repeat(np.cumsum(number) - number, number)
    # The first point of a triangle is its centroid: the reflected (2/3, 2/3).
    uv = (2.0 / 3.0 + place[:, None] * _STEP) % 1.0
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1.0, 1.0 - uv, uv)
    a, b, c = np.moveaxis(p[face], 1, 0)
    point = a + uv[:, :1] * (b - a) + uv[:, 1:] * (c - a)
    return SurfaceSamples(point, face, (area / number)[face])


def surface_distance(
    result: ClosestPoints, surface: ClosestPoints, samples: int = _SAMPLES
) -> Distance:
    """Sampled distances between two triangle meshes; vertices are always among the samples.

    Parameters
    ----------
    result, surface : ClosestPoints
        Queries on the two meshes.
    samples : int
        About how many points to spread over each.
    """
    to_max, to_mean = _one_way(result.mesh, surface, samples)
    from_max, from_mean = _one_way(surface.mesh, result, samples)
    percent = 100.0 / surface.mesh.diagonal
    return Distance(
        hausdorff=percent * max(to_max, from_max),
        mean=percent * 0.5 * (to_mean + from_mean),
        to_surface_max=percent * to_max,
        to_surface_mean=percent * to_mean,
        from_surface_max=percent * from_max,
        from_surface_mean=percent * from_mean,
    )


def _one_way(source: TriMesh, target: ClosestPoints, samples: int) -> tuple[float, float]:
    """Largest and mean distance of points of `source` from `target`."""
    spread = sample_surface(source.vertices, source.faces, samples)
    corners = source.vertices[source.is_used_vertex]
    distance = target.distance(np.concatenate([spread.point, corners]))
    inner = distance[: len(spread.point)]
    total = float(spread.area.sum())
    mean = float((inner * spread.area).sum() / total) if total > 0 else float(inner.mean())
    return float(distance.max()), mean
