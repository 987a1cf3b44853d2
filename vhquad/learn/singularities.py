"""Singularities of a field as a remesh finds them, against the artist's irregular vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from vhquad.field.align import AlignedField
from vhquad.field.cross import CrossField
from vhquad.field.singular import find_singularities
from vhquad.mesh.triangle import TriMesh

__all__ = [
    "ArtistsPoints",
    "SingularPoints",
    "SingularityRow",
    "artists",
    "singular_points",
    "singularity_row",
]

Floats = NDArray[np.float64]

DEFAULT_QUADS = 2000
NEAR = 2.0  # of the artist's quads: so far apart two singularities may be the same


@dataclass(frozen=True, eq=False)
class SingularPoints:
    """Interior singularities of a field.

    Attributes
    ----------
    points : (s, 3) float64
    quarters : (s,) int64
        Four times the index.
    """

    points: Floats
    quarters: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True)
class SingularityRow:
    """Counts over a group of meshes.

    Attributes
    ----------
    method, group : str
    meshes : int
        On which the field could be aligned; the counts are of these.
    count, artists : int
        Singularities of the field, and of the artist's field as it stands.
    matched : int
        Pairs of them of the same sign, at most two of the artist's quads apart.
    """

    method: str
    group: str
    meshes: int
    count: int
    artists: int
    matched: int


@dataclass(frozen=True, eq=False)
class ArtistsPoints(SingularPoints):
    """The artist's, with the length of his quads there and on average.

    Attributes
    ----------
    size : (s,) float64
    edge_length : float
    """

    size: Floats
    edge_length: float


def artists(mesh: TriMesh, truth: CrossField) -> ArtistsPoints:
    """Singularities of the ground truth as it stands.

    Those whose surroundings are not known are left out. Without sizes, quads are those of a mesh of
    2,000.
    """
    length = float(np.sqrt(mesh.area / DEFAULT_QUADS))
    size, known = np.full(mesh.n_vertices, length), truth.z != 0
    if truth.size is not None and (truth.size > 0).any():
        size, known = truth.size, known & (truth.size > 0)
        area = mesh.vertex_areas[known]
        length = float(np.sqrt(area.sum() / (area / size[known] ** 2).sum()))
    found = find_singularities(mesh, truth)
    clear = np.ones(mesh.n_vertices, dtype=bool)
    clear[mesh.faces[~known[mesh.faces].all(axis=1)]] = False
    kept = clear[found.vertex]
    vertex = found.vertex[kept]
    return ArtistsPoints(mesh.vertices[vertex], found.quarters[kept], size[vertex], length)


def singular_points(aligned: AlignedField) -> SingularPoints:
    """The interior singularities of a polished field."""
    singular = (aligned.sector_quads != 4) & ~aligned.sector_is_feature
    vertex = aligned.sector_vertex[singular]
    return SingularPoints(aligned.mesh.vertices[vertex], 4 - aligned.sector_quads[singular])


def singularity_row(
    method: str, group: str, pairs: Sequence[tuple[SingularPoints | None, ArtistsPoints]]
) -> SingularityRow:
    """Counts over pairs of (the field's, the artist's)."""
    usable = [(found, wanted) for found, wanted in pairs if found is not None]
    return SingularityRow(
        method=method,
        group=group,
        meshes=len(usable),
        count=sum(len(found) for found, _ in usable),
        artists=sum(len(wanted) for _, wanted in usable),
        matched=sum(_matched(found, wanted) for found, wanted in usable),
    )


def _matched(found: SingularPoints, wanted: ArtistsPoints) -> int:
    """How many can be paired, each once."""
    distance = np.linalg.norm(found.points[:, None] - wanted.points[None], axis=2)
    near = distance <= NEAR * wanted.size[None]
    near &= np.sign(found.quarters)[:, None] == np.sign(wanted.quarters)[None]
    return int(near[linear_sum_assignment(~near)].sum())
