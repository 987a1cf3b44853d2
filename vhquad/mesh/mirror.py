"""Half of a mesh, cut exactly by its mirror plane, and the whole again from a half.

Where the half ends at the plane (the seam) its vertices lie exactly on it, and mirroring joins the
two halves there vertex by vertex, by number. Components beside the plane come in mirrored pairs, of
which the half holds one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.errors import MeshError
from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.plane_cut import cut_faces
from vhquad.mesh.triangle import TriMesh, next_halfedge

__all__ = ["Half", "cut_half", "mirror_faces"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_CROSSING = 0.02
"""Least share of a component's area on either side for the plane to cut it."""
_MORE = 1.01
"""How much larger the negative half must be to be kept."""


@dataclass(frozen=True, eq=False)
class Half:
    """The part of a mesh on one side of a plane.

    Attributes
    ----------
    mesh : TriMesh
        Sound; every component that the plane cuts ends at it in exact seams.
    plane : MirrorPlane
    seam : (3m,) bool
        Boundary halfedges on the plane, at which mirroring joins the halves.
    face_source : (m,) int64
        Face of the whole mesh that each face is part of.
    is_image : (m,) bool
        Faces that are mirror images of their sources, from components on the other side that have
        no partner on this one.
    vertex_ends : (n, 2) int64
        Vertices of the whole mesh between which each vertex lies; its own number twice if it is
        one of them.
    doubled : int
        Components beside the plane without a partner, of which the mirrored whole has two.
    """

    mesh: TriMesh
    plane: MirrorPlane
    seam: Bools
    face_source: Ints
    is_image: Bools
    vertex_ends: Ints
    doubled: int

    @property
    def is_cut(self) -> Bools:
        """Components that end at the plane, in the order of ``mesh.face_component``; (c,)."""
        cut = np.zeros(self.mesh.n_components, dtype=bool)
        cut[self.mesh.face_component[np.flatnonzero(self.seam) // 3]] = True
        return cut

    @property
    def seam_vertices(self) -> Bools:
        """Vertices of the seams, exactly on the plane; (n,)."""
        flag = np.zeros(self.mesh.n_vertices, dtype=bool)
        flag[self.mesh.tail[self.seam]] = True
        flag[self.mesh.head[self.seam]] = True
        return flag

    @property
    def topology(self) -> tuple[int, int, int]:
        """(components, Euler characteristic, boundary loops) of the whole that mirroring makes."""
        loops = 0
        for loop in self.mesh.boundary_loops:  # few
            on = self.seam[loop]  # each arc beside the plane closes up with its image
            loops += int((~on & np.roll(on, 1)).sum()) if on.any() else 2
        pinched = int(self.seam_vertices.sum()) - int(self.seam.sum())
        euler = 2 * self.mesh.euler_characteristic - pinched
        return 2 * self.mesh.n_components - int(self.is_cut.sum()), euler, loops

    def carry_edges(self, pairs: Ints) -> Ints:
        """Edges of the half that lie on given edges of the whole, as vertex pairs; (j, 2)."""
        ends = self.vertex_ends[self.mesh.edges].reshape(-1, 4)
        low, high = ends.min(axis=1), ends.max(axis=1)
        along = ((ends == low[:, None]) | (ends == high[:, None])).all(axis=1) & (low < high)
        size = np.int64(1 + max(int(ends.max()), int(pairs.max(initial=0))))
        wanted = pairs.min(axis=1) * size + pairs.max(axis=1)
        return self.mesh.edges[along & np.isin(low * size + high, wanted)]


def cut_half(mesh: TriMesh, plane: MirrorPlane) -> Half:
    """The half of a mesh on the positive side of a plane, or on the other if that is larger.

    Parameters
    ----------
    mesh : TriMesh
        Sound, as :func:`vhquad.mesh.repair.repair` leaves it.
    plane : MirrorPlane

    Raises
    ------
    MeshError
        If the plane cuts no component, and none has a mirror image.
    """
    side = _component_sides(mesh, plane)
    beside = side[mesh.face_component]
    pieces = cut_faces(mesh, plane, beside == 0)
    sign = np.where(beside[pieces.source] == 0, pieces.side, beside[pieces.source])
    whole = TriMesh(pieces.points, pieces.faces)
    area = whole.face_areas
    kept = -1 if area[sign < 0].sum() > _MORE * area[sign > 0].sum() else 1
    lonely, doubled = _without_partner(mesh, plane, side, kept)
    if doubled == mesh.n_components:
        raise MeshError(
            f"the plane {plane.name} neither cuts the mesh nor lies between parts that mirror each "
            "other; there is no half to mirror"
        )

    image = np.isin(mesh.face_component[pieces.source], lonely)
    taken = (sign == kept) | image
    seam = np.repeat(taken, 3) & (whole.twin >= 0) & ~taken[whole.twin // 3]
    faces = np.where(image[:, None], pieces.faces[:, ::-1], pieces.faces)[taken]
    moved = np.unique(pieces.faces[image])
    points = pieces.points.copy()
    points[moved] = plane.reflect(points[moved])
    faces, vertex = _one_fan_each(points, faces)
    return Half(
        mesh=TriMesh(points[vertex], faces),
        plane=plane,
        seam=seam[np.repeat(taken, 3)],
        face_source=pieces.source[taken],
        is_image=image[taken],
        vertex_ends=pieces.ends[vertex],
        doubled=doubled,
    )


def mirror_faces(
    vertices: Floats, faces: Ints, on_plane: Bools, plane: MirrorPlane
) -> tuple[Floats, Ints]:
    """A half and its mirror image as one mesh.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, s) int64
        Of any number of corners.
    on_plane : (n,) bool
        Vertices that are their own mirror image; they are put exactly on the plane.
    plane : MirrorPlane

    Returns
    -------
    vertices : (2 n - k, 3) float64
        Those given, then the images of the ones that are not on the plane, in the same order.
    faces : (2 m, s) int64
        Those given, then their images, wound so that they face the same way.
    """
    own = np.array(vertices)
    own[on_plane] = plane.project(own[on_plane])
    image = np.arange(len(own))
    image[~on_plane] = len(own) + np.arange(int((~on_plane).sum()))
    return (
        np.concatenate([own, plane.reflect(own[~on_plane])]),
        np.concatenate([faces, image[faces][:, ::-1]]),
    )


# ---- components -----------------------------------------------------------------------------


def _component_sides(mesh: TriMesh, plane: MirrorPlane) -> Ints:
    """Side of the plane that each component is on: 1, -1, or 0 if the plane cuts it; (c,)."""
    height = plane.height(mesh.vertices)[mesh.faces]
    above = height > 0
    few = np.where(above.sum(axis=1) == 2, 2, 1)  # the corners of the side with less of them
    alone = (above == (few == 1)[:, None]).argmax(axis=1)
    a, b, c = np.take_along_axis(height, (alone[:, None] + np.arange(3)) % 3, axis=1).T
    mixed = above.any(axis=1) & ~above.all(axis=1)
    tip = np.divide(a * a, (a - b) * (a - c), out=np.zeros_like(a), where=mixed)
    share = np.where(mixed, np.where(few == 1, tip, 1.0 - tip), above.all(axis=1))
    total = np.bincount(mesh.face_component, mesh.face_areas)
    part = np.bincount(mesh.face_component, mesh.face_areas * share) / total
    return np.where(part < _CROSSING, -1, np.where(part > 1.0 - _CROSSING, 1, 0))


def _without_partner(mesh: TriMesh, plane: MirrorPlane, side: Ints, kept: int) -> tuple[Ints, int]:
    """Components on the dropped side that have no mirror image, and how many on either side.

    Partners are near each other's image (by their boxes) and of about the same area.
    """
    count = mesh.n_components
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    corner = np.repeat(mesh.face_component, 3)
    np.minimum.at(low, corner, mesh.vertices[mesh.tail])
    np.maximum.at(high, corner, mesh.vertices[mesh.tail])
    middle, size = 0.5 * (low + high), np.linalg.norm(high - low, axis=1)
    area = np.bincount(mesh.face_component, mesh.face_areas)
    free = side == kept
    lonely = []
    for part in np.flatnonzero(side == -kept)[np.argsort(-area[side == -kept], kind="stable")]:
        gap = np.linalg.norm(middle - plane.reflect(middle[part]), axis=1)
        alike = free & (gap < 0.25 * size[part]) & (np.abs(np.log2(area / area[part])) < 1.0)
        if alike.any():
            free[np.where(alike, gap, np.inf).argmin()] = False
        else:
            lonely.append(part)
    return np.array(lonely, dtype=np.int64), len(lonely) + int(free.sum())


# ---- numbers ---------------------------------------------------------------------------------


def _one_fan_each(points: Floats, faces: Ints) -> tuple[Ints, Ints]:
    """Faces with vertices of a single fan, unused ones left out; the old number of each vertex."""
    mesh = TriMesh(points, faces)
    h = np.flatnonzero(mesh.twin >= 0)
    corners = 3 * len(faces)
    links = coo_matrix(
        (np.ones(len(h), dtype=np.int8), (h, next_halfedge(mesh.twin[h]))), (corners, corners)
    )
    fan = connected_components(links, directed=False)[1].astype(np.int64)
    old = np.zeros(int(fan.max()) + 1, dtype=np.int64)
    old[fan] = mesh.tail
    order = np.argsort(old, kind="stable")
    number = np.zeros(len(old), dtype=np.int64)
    number[order] = np.arange(len(old))
    return number[fan].reshape(-1, 3), old[order]
