"""Singularities of a cross field as it stands: where the four directions turn around a vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.field.matching import match_field
from vhquad.field.transport import to_faces
from vhquad.mesh.triangle import TriMesh

__all__ = ["Singularities", "find_singularities"]


@dataclass(frozen=True, eq=False)
class Singularities:
    """The interior vertices at which a cross field is singular.

    Attributes
    ----------
    vertex : (s,) int64
    quarters : (s,) int64
        Four times the index: 1 makes a vertex of three quads, -1 one of five.
    euler_characteristic : int
        Of the mesh; the indices of a closed mesh sum to it, the boundary takes the rest.
    boundary_quarters : int
        Four times what the boundary takes: two less the quads at each of its vertices, summed.
    """

    vertex: NDArray[np.int64]
    quarters: NDArray[np.int64]
    euler_characteristic: int
    boundary_quarters: int = 0

    def __len__(self) -> int:
        return len(self.vertex)

    @property
    def by_quads(self) -> dict[int, int]:
        """How many would make a vertex of so many quads: 3 where the index is +1/4, and so on."""
        quads, count = np.unique(4 - self.quarters, return_counts=True)
        return dict(zip(quads.tolist(), count.tolist(), strict=True))

    @property
    def total(self) -> float:
        """Sum of the indices."""
        return float(self.quarters.sum()) / 4.0


def find_singularities(mesh: TriMesh, field: CrossField) -> Singularities:
    """The singularities of a field on vertices or faces, by the smallest turns between faces.

    Raises
    ------
    FieldError
        If the field is not one of this mesh.
    """
    expected = mesh.n_faces if field.domain == "faces" else mesh.n_vertices
    if len(field) != expected:
        raise FieldError(f"the field has {len(field)} crosses, the mesh {expected} {field.domain}")
    crosses = field if field.domain == "faces" else to_faces(mesh, field)
    border = mesh.twin < 0
    matched = match_field(mesh, crosses.angle, border, np.zeros(3 * mesh.n_faces))
    singular = np.flatnonzero(matched.sector_is_singular & ~matched.sector_is_feature)
    rim = matched.sector_is_feature
    return Singularities(
        vertex=matched.sector_vertex[singular],
        quarters=4 - matched.sector_quads[singular],
        euler_characteristic=mesh.euler_characteristic,
        boundary_quarters=int((2 - matched.sector_quads[rim]).sum()),
    )
