"""Exactly mirror-symmetric quads: remesh one half up to its plane, and mirror it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import ParametrizationError
from vhquad.field.cross import CrossField
from vhquad.field.mirrored import to_half, with_mirror_image
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.mirror import Half, cut_half, mirror_faces
from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.symmetry import Symmetry, find_symmetry
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.parts import Part, join_quads
from vhquad.quad.smooth import smooth_quads
from vhquad.quad.strips import split_strips
from vhquad.report import MeshCounts, SymmetryReport

__all__ = ["SYMMETRIES", "Mirrored", "find_plane", "remesh_mirrored"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SYMMETRIES = ("off", "auto", "x", "y", "z")

_ON = 1e-9
"""Boundary vertices of the quads nearer to the plane than this share of the diagonal are on it."""


Remesher = Callable[[TriMesh, CrossField, "Ints | None", "Bools | None"], list[Part]]


@dataclass(frozen=True, eq=False)
class Mirrored:
    """Symmetric quads, and the half that they were made of.

    Attributes
    ----------
    quads : QuadMesh
        Vertices of the half first, then their images in the same order, less those on the plane.
    parts : list of Part
        Of the components of the half.
    doubled : int
        Components that had no mirror image.
    """

    quads: QuadMesh
    parts: list[Part]
    doubled: int


def find_plane(mesh: TriMesh, symmetry: str) -> tuple[MirrorPlane | None, SymmetryReport]:
    """The plane to mirror in, and what to say about it.

    Parameters
    ----------
    mesh : TriMesh
    symmetry : str
        "auto", which may find that there is none, or "x", "y" or "z" for a plane across that axis.
    """
    found = find_symmetry(mesh, None if symmetry == "auto" else "xyz".index(symmetry))
    plane = found.plane if found.holds or symmetry != "auto" else None
    return plane, _report(symmetry, found, plane is not None)


def _report(asked: str, found: Symmetry, made: bool) -> SymmetryReport:
    off = (
        f"half of the mirrored surface is {100 * found.median:.2g} % of the diagonal off or more, "
        f"a twentieth {100 * found.tail:.2g} %"
    )
    warnings = []
    if not made:
        warnings.append(f"no mirror plane was found: in the best, {found.plane.name}, {off}")
    elif not found.holds:
        warnings.append(
            f"one half was mirrored, but the mesh is not symmetric in {found.plane.name}: {off}"
        )
    return SymmetryReport(
        asked=asked,
        plane=found.plane.name if made else "",
        normal=tuple(found.plane.normal.tolist()),
        offset=found.plane.offset,
        median=100.0 * found.median,
        tail=100.0 * found.tail,
        made=made,
        warnings=tuple(warnings),
    )


def remesh_mirrored(
    mesh: TriMesh,
    field: CrossField,
    creases: Ints | None,
    plane: MirrorPlane,
    remesh_parts: Remesher,
) -> Mirrored:
    """Quads that are their own mirror image, vertex for vertex, with edges on the plane.

    Parameters
    ----------
    mesh : TriMesh
        Sound, and about symmetric.
    field : CrossField
        On its faces, with sizes up to a common factor.
    creases : (k, 2) int64, optional
        Edges to keep.
    plane : MirrorPlane
    remesh_parts : callable
        Makes quads of every component of a mesh, given the field, edges to keep, and boundary
        halfedges at which the surface goes on, mirrored.

    Raises
    ------
    MeshError
        If there is nothing to mirror.
    ParametrizationError
        If the mirrored quads are no manifold of the topology that mirroring the half makes.
    """
    half = cut_half(mesh, plane)
    wanted = float((mesh.face_areas / _sizes(field) ** 2).sum())
    own = to_half(mesh, with_mirror_image(mesh, field, plane), half)
    count = 2.0 * float((half.mesh.face_areas / _sizes(own) ** 2).sum())
    own = replace(own, size=_sizes(own) * np.sqrt(count / wanted))
    pairs = None if creases is None else half.carry_edges(creases)
    parts = remesh_parts(half.mesh, own, pairs, half.seam)
    made, on = [], []
    for number, (part, cut) in enumerate(zip(parts, half.is_cut, strict=True)):
        quads = part.quads
        if cut:
            quads = _apart(quads, half, number)
        made.append(quads)
        on.append(_on_plane(quads, half) & cut)
    quads = join_quads(made)
    quads = QuadMesh(*mirror_faces(quads.vertices, quads.quads, np.concatenate(on), plane))
    topology = MeshCounts.of(quads).topology
    if not quads.is_manifold or topology != half.topology:
        raise ParametrizationError(
            "the mirrored quads are not manifold"
            if not quads.is_manifold
            else "the mirrored quads have (components, Euler characteristic, boundary loops) "
            f"{topology} instead of {half.topology}"
        )
    return Mirrored(quads, parts, half.doubled)


def _sizes(field: CrossField) -> NDArray[np.float64]:
    return np.ones(len(field)) if field.size is None else field.size


def _on_plane(quads: QuadMesh, half: Half) -> Bools:
    """Boundary vertices on the plane: the pipeline keeps to the boundary up to rounding; (n,)."""
    height = np.abs(half.plane.height(quads.vertices))
    return quads.is_boundary_vertex & (height <= _ON * half.mesh.diagonal)


def _apart(quads: QuadMesh, half: Half, number: int) -> QuadMesh:
    """No inner edge from seam to seam, which would coincide with its image.

    Where one quad spans a thin part from one side of the seam to the other, the strip of quads
    across it is split.
    """
    on = _on_plane(quads, half)
    across = np.flatnonzero(on[quads.edges].all(axis=1) & (quads.edge_quads == 2))
    if not across.size:
        return quads
    surface, _ = half.mesh.submesh(half.mesh.face_component == number)
    split = split_strips(quads, across)
    mesh, n = split.mesh, quads.n_vertices
    vertices = np.array(mesh.vertices)
    # The middle of such an edge is inside the thin part: its place is on the outer side.
    length = np.linalg.norm(np.diff(quads.vertices[quads.edges], axis=1)[:, 0], axis=1)
    middle = np.flatnonzero(np.isin(split.edge, across))
    outward = np.sign(half.plane.height(surface.vertices).sum()) * half.plane.normal
    vertices[n + middle] += length[split.edge[middle], None] * outward
    new = np.arange(mesh.n_vertices) >= n
    border = new & mesh.is_boundary_vertex
    whole = ClosestPoints(surface)
    vertices[border] = _boundary(surface).query(vertices[border]).point
    vertices[new & ~border] = whole.query(vertices[new & ~border]).point
    fixed = mesh.is_boundary_vertex
    return QuadMesh(smooth_quads(vertices, mesh.quads, whole, fixed), mesh.quads)


def _boundary(mesh: TriMesh) -> ClosestPoints:
    """Queries on the boundary of a mesh, as triangles without area."""
    rim = np.flatnonzero(mesh.twin < 0)
    tail, head = mesh.tail[rim], mesh.head[rim]
    return ClosestPoints(TriMesh(mesh.vertices, np.stack([tail, head, head], axis=1)))
