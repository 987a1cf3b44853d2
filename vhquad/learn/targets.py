"""From an artist's quads to a triangle mesh with the cross field that would have given them.

1. One Catmull-Clark step (``subdivide.py``) remembers where each small quad lies in its parent.
2. The small quads are split along random diagonals, cropped if wanted, and remeshed isotropically
   or decimated, so that no triangle edge tells where the quads ran. :func:`leak` measures what it
   still tells.
3. Each vertex of the new mesh takes, at the closest point of the subdivided surface, the two edge
   vectors of its parent quad, interpolated.
4. These are projected to the vertex frame: z = sum of the unit fourth powers, normalised; its
   modulus before, halved, is the coherence (1: the quad is as good as rectangular); the size is the
   square root of the parallelogram's area.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pymeshlab
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import build_frames, from_3d, vertex_axes
from vhquad.learn.augment import clip_triangles
from vhquad.learn.subdivide import SQUARE, SubdividedQuads, catmull_clark
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.proxy import decimate
from vhquad.mesh.triangle import TriMesh

__all__ = ["Target", "isotropic_remesh", "leak", "make_target", "split_quads", "truth_at"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Crop = Callable[[Floats, Floats], Floats]
Change = Callable[[TriMesh], TriMesh]

SUBDIVIDE_UP_TO = 12_000  # quads; finer meshes are fine enough as they are
LEAST_DECIMATION = 4  # times fewer faces: else too many edges of the quads would be left
SAME_SIDE = 0.5  # least cosine between the normals of a vertex and of its closest point


@dataclass(frozen=True, eq=False)
class Target:
    """A triangle mesh and its ground truth.

    Attributes
    ----------
    mesh : TriMesh
    field : CrossField
        On the vertices; ``confidence`` is the coherence, 0 (with z = 0) where no truth was found.
    """

    mesh: TriMesh
    field: CrossField


def make_target(
    vertices: Floats,
    quads: Ints,
    n_vertices: int,
    rng: np.random.Generator,
    crop: Crop | None = None,
    change: Change | None = None,
    decimated: bool = False,
) -> Target:
    """Make one training sample from a quad mesh.

    Parameters
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
    n_vertices : int
        Wanted number of vertices of the triangle mesh; met to about a tenth.
    rng : Generator
        Draws the diagonals.
    crop : callable, optional
        From fine vertices (N, 3) and their areas (N,) to a height (N,); what is below 0 is cut off.
    change : callable, optional
        From the remeshed mesh to another near it; its truth too is that of the fine surface.
    decimated : bool
        Triangles as quadric decimation leaves them, in place of isotropic ones.

    Returns
    -------
    Target

    Raises
    ------
    MeshError
        If no usable mesh comes out (crop too small, surface too broken).
    """
    if len(quads) <= SUBDIVIDE_UP_TO:
        fine = catmull_clark(vertices, quads)
    else:
        corners = np.broadcast_to(SQUARE, (len(quads), 4, 2))
        fine = SubdividedQuads(vertices, quads, np.arange(len(quads)), np.array(corners))
    triangles, source, slots = split_quads(fine.quads, rng)
    surface = TriMesh(fine.vertices, triangles)
    v, f = fine.vertices, triangles
    if crop is not None:
        v, f = clip_triangles(v, f, crop(v, surface.vertex_areas))
        if len(f) == 0:
            raise MeshError("the crop leaves nothing")
    mesh = _decimated(v, f, n_vertices) if decimated else isotropic_remesh(v, f, n_vertices)
    if change is not None:
        mesh = change(mesh)
    return Target(mesh, truth_at(mesh, surface, fine, source, slots))


def split_quads(quads: Ints, rng: np.random.Generator) -> tuple[Ints, Ints, Ints]:
    """Cut quads along random diagonals.

    Returns
    -------
    triangles : (2k, 3) int64
    source : (2k,) int64
        Quad of each triangle.
    slots : (2k, 3) int64
        Corner of the quad that each corner is.
    """
    other = rng.random(len(quads)) < 0.5
    first = np.where(other[:, None], [1, 2, 3], [0, 1, 2])
    second = np.where(other[:, None], [1, 3, 0], [0, 2, 3])
    slots = np.concatenate([first, second])
    source = np.tile(np.arange(len(quads)), 2)
    return np.take_along_axis(quads[source], slots, axis=1), source, slots


def isotropic_remesh(vertices: Floats, faces: Ints, n_vertices: int) -> TriMesh:
    """Remesh with near-equilateral triangles and keep the largest component.

    Raises
    ------
    MeshError
        If nothing manifold with at least a tenth of the wanted vertices comes out.
    """
    soup = TriMesh(vertices, faces)
    length = np.sqrt(2.0 * soup.area / (np.sqrt(3.0) * n_vertices))
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces.astype(np.int32)))
    target = pymeshlab.PercentageValue(100.0 * length / soup.diagonal)
    meshes.meshing_isotropic_explicit_remeshing(iterations=8, targetlen=target)
    meshes.meshing_repair_non_manifold_edges()
    meshes.meshing_repair_non_manifold_vertices()
    meshes.meshing_remove_unreferenced_vertices()
    out = meshes.current_mesh()
    if out.face_number() == 0:
        raise MeshError("remeshing left nothing")
    mesh = TriMesh(out.vertex_matrix(), out.face_matrix().astype(np.int64))
    return _sound(mesh, n_vertices)


def _decimated(vertices: Floats, faces: Ints, n_vertices: int) -> TriMesh:
    """Decimate to about so many vertices, as scans often come, and keep the largest component."""
    n_faces = min(2 * n_vertices, len(faces) // LEAST_DECIMATION)
    return _sound(decimate(TriMesh(vertices, faces), n_faces), n_faces // 2)


def _sound(mesh: TriMesh, n_vertices: int) -> TriMesh:
    """The largest component; raises if it is not manifold or has too few vertices."""
    if mesh.n_components > 1:
        areas = np.bincount(mesh.face_component, weights=mesh.face_areas)
        mesh, _ = mesh.submesh(mesh.face_component == areas.argmax())
    if not mesh.has_manifold_vertices or mesh.n_vertices < 0.1 * n_vertices:
        raise MeshError(
            f"remeshing gave {mesh.n_vertices} vertices for {n_vertices} wanted"
            + ("" if mesh.has_manifold_vertices else ", not manifold")
        )
    return mesh


def truth_at(
    mesh: TriMesh, surface: TriMesh, fine: SubdividedQuads, source: Ints, slots: Ints
) -> CrossField:
    """Steps 3 and 4: the cross at each vertex of ``mesh`` by the closest point of ``surface``.

    Parameters
    ----------
    mesh : TriMesh
    surface : TriMesh
        The quads of ``fine``, cut into triangles.
    fine : SubdividedQuads
    source, slots
        As :func:`split_quads` gives them with these triangles.
    """
    hits = ClosestPoints(surface).query(mesh.vertices)
    child = source[hits.face]
    local = hits.interpolate(SQUARE[slots])  # (n, 2): where in the small quad
    along, across = _bilinear_derivatives(fine.vertices[fine.quads[child]], local)
    s_along, s_across = _bilinear_derivatives(fine.st[child], local)
    parent = np.stack([s_along, s_across], axis=2)  # columns: d(s, t) by x and by y
    edges = np.stack([along, across], axis=2) @ np.linalg.inv(parent)  # columns: by s and by t
    cross = from_3d(edges.transpose(0, 2, 1), vertex_axes(mesh))  # (n, 2)
    modulus = np.abs(cross)
    unit = np.divide(cross, modulus, out=np.zeros_like(cross), where=modulus > 0)
    total = (unit**4).sum(axis=1)
    facing = np.einsum("ni,ni->n", surface.face_normals[hits.face], mesh.vertex_normals)
    good = (facing >= SAME_SIDE) & (modulus > 0).all(axis=1)
    size = np.sqrt(np.abs((cross[:, 0].conj() * cross[:, 1]).imag))
    return CrossField(
        domain="vertices",
        z=np.where(good, total, 0.0),
        size=np.where(good, size, 0.0),
        confidence=np.where(good, 0.5 * np.abs(total), 0.0).clip(0.0, 1.0),
    )


def _bilinear_derivatives(corners: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Derivatives by x and y of the bilinear patch of corners (n, 4, d) at ``at`` (n, 2)."""
    x, y = at[:, :1], at[:, 1:]
    a0, a1, a2, a3 = (corners[:, j] for j in range(4))
    by_x = (1.0 - y) * (a1 - a0) + y * (a2 - a3)
    by_y = (1.0 - x) * (a3 - a0) + x * (a2 - a1)
    return by_x, by_y


def leak(mesh: TriMesh, field: CrossField) -> float:
    """How much the triangle edges tell of the field: 0 nothing, 0.35 for plainly split quads.

    The modulus of the mean over halfedges of e^4 conj(z), e the edge's unit direction.
    """
    angle = build_frames(mesh).halfedge_angle
    z = field.z[mesh.tail]
    known = z != 0
    return float(np.abs((np.exp(4j * angle[known]) * z[known].conj()).mean()))
