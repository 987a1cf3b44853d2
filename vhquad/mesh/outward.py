"""Which way out: turn whole parts of a consistently wound mesh so that normals look outward.

- A closed part encloses a positive volume. A closed part inside another one (a cavity, an eyeball)
  keeps the winding of most of its area, as given.
- An open part whose holes are small (closing them with cones adds less than a quarter of its area,
  such as a head open at the neck) is judged by volume as if it were closed.
- Any other open part keeps the winding of most of its area.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.triangle import TriMesh

__all__ = ["inward_faces"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SMALL_HOLES = 0.25
_FLAT = 1e-9
"""A volume below this share of area * diagonal decides nothing."""


def inward_faces(mesh: TriMesh, turned: Bools) -> Bools:
    """Faces of the parts that are to be turned over; (m,).

    Parameters
    ----------
    mesh : TriMesh
        Consistently wound, of about unit size.
    turned : (m,) bool
        Faces that were turned over against the input already.
    """
    part = mesh.face_component
    count = mesh.n_components
    area = np.bincount(part, weights=mesh.face_areas, minlength=count)
    volume = _volumes(mesh.vertices[mesh.faces], part, count)
    capped, cap_area, has_border = _caps(mesh, part, count)
    closed = ~has_border
    judged = closed | (cap_area < _SMALL_HOLES * area)
    judged &= np.abs(volume + capped) > _FLAT * area * mesh.diagonal
    nested = _nested(mesh, part, closed & (volume < 0), closed)
    judged &= ~nested

    # Most of the area as given; at a tie the first face decides.
    given = np.bincount(
        part, weights=np.where(turned, -1.0, 1.0) * mesh.face_areas, minlength=count
    )
    _, first = np.unique(part, return_index=True)
    tie = np.abs(given) <= 1e-9 * area
    against = np.where(tie, turned[first], given < 0)
    return np.asarray(np.where(judged, volume + capped < 0, against)[part])


def _volumes(corners: Floats, part: Ints, count: int) -> Floats:
    """Signed volume between each part and the middle of its corners."""
    size = np.bincount(part, minlength=count)
    middle = np.stack(
        [
            np.bincount(part, weights=corners.mean(1)[:, i], minlength=count) / size
            for i in range(3)
        ],
        1,
    )
    p = corners - middle[part][:, None, :]
    cone = np.einsum("mi,mi->m", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6.0
    return np.asarray(np.bincount(part, weights=cone, minlength=count), dtype=np.float64)


def _caps(mesh: TriMesh, part: Ints, count: int) -> tuple[Floats, Floats, Bools]:
    """Volume and area that cones over the boundary loops add, and whether a part has any."""
    volume, area, has_border = np.zeros(count), np.zeros(count), np.zeros(count, dtype=bool)
    size = np.bincount(part, minlength=count)
    p = mesh.vertices[mesh.faces].mean(axis=1)
    middle = np.stack(
        [np.bincount(part, weights=p[:, i], minlength=count) / size for i in range(3)], 1
    )
    for loop in mesh.boundary_loops:  # few, as a rule
        which = part[loop[0] // 3]
        a = mesh.vertices[mesh.head[loop]] - middle[which]
        b = mesh.vertices[mesh.tail[loop]] - middle[which]
        tip = a.mean(axis=0)
        has_border[which] = True
        area[which] += 0.5 * np.linalg.norm(np.cross(b - a, tip - a), axis=1).sum()
        volume[which] += (np.cross(a, b) @ tip).sum() / 6.0
    return volume, area, has_border


def _nested(mesh: TriMesh, part: Ints, candidates: Bools, closed: Bools) -> Bools:
    """Which candidate parts lie inside another closed part, by the solid angle at one vertex."""
    result = np.zeros(len(closed), dtype=bool)
    if not candidates.any() or closed.sum() < 2:
        return result
    corners = mesh.vertices[mesh.faces]
    low, high = np.full((len(closed), 3), np.inf), np.full((len(closed), 3), -np.inf)
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    for one in np.flatnonzero(candidates):  # parts that are inside out: few
        around = closed & (low <= low[one]).all(axis=1) & (high >= high[one]).all(axis=1)
        around[one] = False
        if not around.any():
            continue
        eye = mesh.vertices[mesh.faces[np.flatnonzero(part == one)[0], 0]]
        outer = np.flatnonzero(around[part])
        winding = np.bincount(part[outer], weights=_solid_angles(corners[outer] - eye))
        result[one] = bool((np.abs(winding) > 2.0 * np.pi).any())
    return result


def _solid_angles(p: Floats) -> Floats:
    """Signed solid angle of triangles seen from the origin (Van Oosterom & Strackee 1983)."""
    a, b, c = np.moveaxis(p, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    over = np.einsum("mi,mi->m", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("mi,mi->m", x, y) for x, y in ((a, b), (b, c), (c, a)))
    under = la * lb * lc + ab * lc + bc * la + ca * lb
    return np.asarray(2.0 * np.arctan2(over, under))
