"""A stand-in with triangles no longer than its quads, on a smooth surface through the vertices.

A field and its map are no finer than the triangles they live on, and what these know of the surface
ends at their edges: all curvature sits at the vertices. Where quads are as small as triangles, and
the field is sure of its detail, edges are split, and the new vertices lifted to the curved patches
of :mod:`vhquad.mesh.pn_triangles`. (Without that, splitting does harm.) The quads are polished on
the original surface in the end, and judged against it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.field.creases import creases_for_quads
from vhquad.field.cross import CrossField
from vhquad.field.features import crease_halfedges
from vhquad.field.refine import Refinement, lengths_of_edges, no_refinement, split_edges
from vhquad.mesh.pn_triangles import PnTriangles
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.known import known_parts
from vhquad.quad.sizing import WantedSizes
from vhquad.quad.stand_in import StandIn

__all__ = ["refine_curves"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LONGEST = 1.0  # edge of triangles that are fine enough, in quad edges
WORTH_FROM = 0.5  # of the quads on triangles with longer ones
LEAST, LARGEST = 5_000, 9_000  # vertices of a mesh: fewer have little detail, more are fine enough
MOST = 12_000  # vertices of a copy
FIRST = 0.7  # of the largest factor by which an edge is too long: others wait
ROUNDS = 200
THIN = 1e-12  # square of the area, by the length to the fourth: a triangle that is a line


def refine_curves(
    mesh: TriMesh,
    wanted: WantedSizes,
    field: CrossField,
    creases: Ints | None = None,
    angle: float | None = None,
) -> StandIn | None:
    """A copy of a mesh with edges short for the quads there are to be, if its own are not.

    The copy is as fine as it can be, whatever the number of quads, so that it serves other numbers.

    Parameters
    ----------
    mesh : TriMesh
        Sound, any components and borders.
    wanted : WantedSizes
        At its faces. Their scale says whether there is a copy, not what it is like.
    field : CrossField
        On the faces. Parts that are not known (:mod:`vhquad.quad.known`) are left alone.
    creases : (k, 2) int64, optional
        Edges that quads must follow, in place of those sharper than the angle. They stay straight,
        as borders do.
    angle : float, optional
        In degrees; no creases if neither is given.

    Returns
    -------
    StandIn or None
        None where triangles are fine enough.
    """
    if not LEAST <= mesh.n_vertices <= LARGEST:
        return None
    known = known_parts(mesh, field, wanted.relative)[mesh.face_component]
    quads, size = mesh.face_areas / wanted.lengths**2, wanted.relative_at_vertices(mesh)
    coarse = _factors(mesh, size, known) > LONGEST * wanted.scale
    coarse = coarse[mesh.halfedge_edge].reshape(-1, 3)
    if quads[coarse.any(axis=1)].sum() < WORTH_FROM * quads.sum():
        return None
    lines = creases
    if lines is None and angle is not None:
        edge = float(np.sqrt(2.0 * mesh.area / mesh.n_faces))  # of quads made of two triangles
        lines = creases_for_quads(mesh, angle, edge, field=field)
    sharp = crease_halfedges(mesh, lines)
    done = no_refinement(mesh)
    share = np.tile(np.eye(3), (mesh.n_faces, 1, 1))
    at_vertex = size
    for _ in range(ROUNDS):
        room = MOST - done.mesh.n_vertices
        if room <= 0:
            break
        factor = _factors(done.mesh, at_vertex, known[done.parent])
        first = np.argsort(-factor, kind="stable")[:room]
        long = np.zeros(done.mesh.n_edges, dtype=bool)
        long[first[factor[first] > FIRST * factor.max()]] = True
        done = done.then(split_edges(done.mesh, long, factor))
        share = _shares(mesh, done)
        logarithm = np.einsum("fkc,fc->fk", share, np.log(size)[mesh.faces][done.parent])
        at_vertex = np.empty(done.mesh.n_vertices)
        at_vertex[done.mesh.faces] = np.exp(logarithm)
    face, corner = np.repeat(done.parent, 3), done.mesh.faces.reshape(-1)
    points = done.mesh.vertices.copy()
    points[corner] = PnTriangles(mesh, sharp).points(face, share.reshape(-1, 3))
    copy = TriMesh(points, done.mesh.faces)
    kept: Ints | None = None
    if creases is not None:
        kept = copy.edges[np.unique(copy.halfedge_edge[done.carry(sharp, False)])]
    return StandIn(copy, kept, mesh)


def _factors(mesh: TriMesh, size: Floats, known: Bools) -> Floats:
    """Length of edges of known parts over the least at their ends that is wanted, else 0; (ne,)."""
    theirs = np.zeros(mesh.n_edges, dtype=bool)
    theirs[mesh.halfedge_edge[np.repeat(known, 3)]] = True
    factor = lengths_of_edges(mesh) / size[mesh.edges].min(axis=1)
    return np.asarray(np.where(theirs, factor, 0.0))


def _shares(mesh: TriMesh, done: Refinement) -> Floats:
    """Barycentric coordinates of the corners of new faces in their parents; (m, 3, 3)."""
    base = mesh.vertices[mesh.faces[done.parent]]
    one, two = base[:, 1] - base[:, 0], base[:, 2] - base[:, 0]
    away = done.mesh.vertices[done.mesh.faces] - base[:, :1]
    a, b, c = (np.einsum("fi,fi->f", x, y) for x, y in ((one, one), (one, two), (two, two)))
    x, y = (np.einsum("fki,fi->fk", away, side) for side in (one, two))
    area = a * c - b * b
    thin = area <= THIN * (a + c) ** 2
    area = np.where(thin, 1.0, area)[:, None]
    second = (c[:, None] * x - b[:, None] * y) / area
    third = (a[:, None] * y - b[:, None] * x) / area
    share = np.stack([1.0 - second - third, second, third], axis=2)
    if thin.any():  # some of the many that do there
        sides = np.linalg.pinv(np.stack([one[thin], two[thin]], axis=2))
        inner = np.einsum("fji,fki->fkj", sides, away[thin])
        share[thin] = np.concatenate([1.0 - inner.sum(axis=2, keepdims=True), inner], axis=2)
    return share
