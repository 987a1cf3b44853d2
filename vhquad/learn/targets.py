"""From an artist's quads to a triangle mesh with the cross field that would have given them.

1. One Catmull-Clark step (``subdivide.py``) remembers where each small quad lies in its parent.
2. The small quads are split along random diagonals, cropped if wanted, and remeshed isotropically
   or decimated, so that no triangle edge tells where the quads ran. :func:`leak` measures what it
   still tells.
3. Points all over the faces of the new mesh take, at the closest point of the subdivided surface,
   the two edge vectors of its parent quad, interpolated.
4. These are projected to the face's frame and carried to the vertex whose cell the point lies in:
   z = mean over the cell of the unit fourth powers, normalised; its modulus before is the coherence
   (1: all quads of the cell have one direction and are as good as rectangular); the size is the
   square root of the parallelogram's area, its geometric mean. Taken at the vertex alone, the truth
   of quads smaller than triangles (eyelids, lips) would depend on where vertices happen to lie.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pymeshlab
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import Axes, build_frames, face_axes, from_3d
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
SAME_SIDE = 0.5  # least cosine between the normals of a face and of a closest point
LEAST_FOUND = 0.5  # of a vertex's cell: what must have a truth, else the vertex has none


def _cell_rule() -> tuple[Floats, Floats]:
    """Barycentric points (4, 3) and weights of the first corner's third of a triangle.

    That third is the quad of the corner, the middles of its two edges and the centroid; the points
    are the middles of its four parts.
    """
    corners = np.array([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [1 / 3, 1 / 3, 1 / 3], [0.5, 0.0, 0.5]])
    x, y = (part.reshape(-1, 1) for part in np.meshgrid([0.25, 0.75], [0.25, 0.75]))
    a, b, c, d = corners
    points = (1 - x) * (1 - y) * a + x * (1 - y) * b + x * y * c + (1 - x) * y * d
    by_x, by_y = (1 - y) * (b - a) + y * (c - d), (1 - x) * (d - a) + x * (c - b)
    weights = np.abs(by_x[:, 1] * by_y[:, 2] - by_x[:, 2] * by_y[:, 1])
    return points, weights / weights.sum()


CELL_POINTS, CELL_WEIGHTS = _cell_rule()


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
    """Steps 3 and 4: the mean cross over the cell of each vertex of ``mesh``.

    Parameters
    ----------
    mesh : TriMesh
    surface : TriMesh
        The quads of ``fine``, cut into triangles.
    fine : SubdividedQuads
    source, slots
        As :func:`split_quads` gives them with these triangles.
    """
    n_points = len(CELL_POINTS)
    places = np.concatenate([np.roll(CELL_POINTS, k, axis=1) for k in range(3)])
    points = np.einsum("sk,fki->fsi", places, mesh.vertices[mesh.faces])  # by face, corner, point
    face = np.repeat(np.arange(mesh.n_faces), 3 * n_points)
    closest, edges = _edges_at(points.reshape(-1, 3), surface, fine, source, slots)
    facing = np.einsum("ni,ni->n", surface.face_normals[closest], mesh.face_normals[face])
    axes = face_axes(mesh)
    cross = from_3d(edges, Axes(axes.e1[face], axes.e2[face]))  # (points, 2)
    modulus = np.abs(cross)
    good = (facing >= SAME_SIDE) & (modulus > 0).all(axis=1)
    unit = np.divide(cross, modulus, out=np.zeros_like(cross), where=modulus > 0)
    area = np.abs((cross[:, 0].conj() * cross[:, 1]).imag)
    good &= area > 0
    back = build_frames(mesh).vertex_to_face.conj() ** 4
    back = np.repeat(back.reshape(-1), n_points)
    vertex = np.repeat(mesh.faces.reshape(-1), n_points)
    share = mesh.face_areas[face] * np.tile(CELL_WEIGHTS, 3 * mesh.n_faces)

    def total(values: Floats) -> Floats:
        weighted = np.where(good, share * values, 0.0)
        return np.bincount(vertex, weighted, mesh.n_vertices).astype(np.float64)

    whole = np.bincount(vertex, share, mesh.n_vertices)
    found = total(np.ones(len(vertex)))
    known = found >= LEAST_FOUND * whole
    found = np.where(known & (found > 0), found, 1.0)
    fourth = 0.5 * (unit**4).sum(axis=1) * back
    z = (total(fourth.real) + 1j * total(fourth.imag)) / found
    logs = total(np.log(np.where(good, area, 1.0))) / found
    return CrossField(
        domain="vertices",
        z=np.where(known, z, 0.0),
        size=np.where(known, np.exp(0.5 * logs), 0.0),
        confidence=np.where(known, np.abs(z), 0.0).clip(0.0, 1.0),
    )


def _edges_at(
    points: Floats, surface: TriMesh, fine: SubdividedQuads, source: Ints, slots: Ints
) -> tuple[Ints, Floats]:
    """Closest faces of the surface (n,), and the parent quad's two edge vectors there (n, 2, 3)."""
    hits = ClosestPoints(surface).query(points)
    child = source[hits.face]
    local = hits.interpolate(SQUARE[slots])  # (n, 2): where in the small quad
    along, across = _bilinear_derivatives(fine.vertices[fine.quads[child]], local)
    s_along, s_across = _bilinear_derivatives(fine.st[child], local)
    parent = np.stack([s_along, s_across], axis=2)  # columns: d(s, t) by x and by y
    edges = np.stack([along, across], axis=2) @ np.linalg.inv(parent)  # columns: by s and by t
    return hits.face, edges.transpose(0, 2, 1)


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
