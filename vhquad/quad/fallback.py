"""The last resort: decimate, pair triangles, split what is left; always a valid all-quad mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh, next_halfedge, prev_halfedge
from vhquad.mesh.vectors import cross, unit
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.decimate import decimate
from vhquad.quad.ragged import PolygonMesh, midpoint_split
from vhquad.quad.smooth import smooth_quads

__all__ = ["boundary_curves", "pair_triangles", "triangles_to_quads"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CORNER_TURN = np.deg2rad(50.0)
WORST_PAIR = 0.1  # least scaled Jacobian of a quad made of two triangles
ALIGNMENT_WEIGHT = 0.5
QUADS_PER_TRIANGLE = 2.25  # 2 in a pair, 3 alone; about a quarter find no partner


def triangles_to_quads(
    mesh: TriMesh,
    target_quads: int,
    angle: NDArray[np.floating] | None = None,
    iterations: int = 30,
) -> QuadMesh:
    """An all-quad mesh of the topology of any manifold triangle mesh, near a number of quads.

    Parameters
    ----------
    mesh : TriMesh
        Manifold; any genus, boundaries, components; one triangle is enough.
    target_quads : int
        Wanted number of quads, met within 10 % or so if the topology lets, within a factor of
        two if the input is coarser than that.
    angle : (m,) array, optional
        Angle of one direction of a cross in each face's frame (axis: its halfedge 0), radians,
        counter-clockwise; pairs whose quad follows it are preferred.
    iterations : int
        Steps of the polish at the end.

    Returns
    -------
    QuadMesh
        Same Euler characteristic, boundary loops and components; boundary vertices lie on the
        boundary polylines.
    """
    splits, goal = 1, max(round(target_quads / QUADS_PER_TRIANGLE), 1)
    while goal > mesh.n_faces:
        splits, goal = splits + 1, max(goal // 4, 1)
    coarse, source = decimate(mesh, goal)
    directions = None if angle is None else _vertex_crosses(mesh, np.asarray(angle))[source]
    polygons = pair_triangles(coarse, directions)
    curves = boundary_curves(mesh)
    curve, arc = _on_boundary(mesh, source, curves)
    surface = ClosestPoints(mesh)
    for _ in range(splits):
        n = len(polygons.vertices)
        before, polygons = polygons, midpoint_split(polygons)
        curve, arc = _split_boundary(before, polygons, curves, curve, arc)
        polygons = _on_surface(polygons, n, surface, curves, curve, arc)
    bound = curves.bind(curve)
    fixed = np.zeros(len(curve), dtype=bool)
    fixed[: len(source)] = _corners(mesh)[source]
    quads = polygons.quads()
    smooth = smooth_quads(quads.vertices, quads.quads, surface, fixed, bound, iterations)
    return QuadMesh(smooth, quads.quads)


# ---- pairing --------------------------------------------------------------------------------


def pair_triangles(mesh: TriMesh, directions: Floats | None = None) -> PolygonMesh:
    """Join pairs of triangles into quads, best quads first; the rest stay triangles.

    Parameters
    ----------
    mesh : TriMesh
        Manifold.
    directions : (n, 3) array, optional
        A direction of a cross at each vertex, in space; zero where there is none.

    Returns
    -------
    PolygonMesh
        Triangles and quads on the same vertices. No inside vertex is left with two polygons.
    """
    h = np.flatnonzero((mesh.twin >= 0) & (np.arange(3 * mesh.n_faces) < mesh.twin))
    t = mesh.twin[h]
    quad = np.stack(
        [mesh.tail[h], mesh.tail[prev_halfedge(t)], mesh.head[h], mesh.tail[prev_halfedge(h)]], 1
    )
    score = _pair_score(mesh.vertices, quad, directions)
    score[quad[:, 1] == quad[:, 3]] = -1.0
    order = np.argsort(-score, kind="stable")
    order = order[score[order] > WORST_PAIR]
    spare = np.bincount(mesh.edges.reshape(-1), minlength=mesh.n_vertices)
    spare = (spare - np.where(mesh.is_boundary_vertex, 2, 3)).tolist()
    partner = np.full(mesh.n_faces, -1, dtype=np.int64)
    taken = [False] * mesh.n_faces
    chosen = []
    for e, f, g, a, b in np.stack([order, h[order] // 3, t[order] // 3, *quad[order][:, ::2].T], 1):
        if taken[f] or taken[g] or spare[a] < 1 or spare[b] < 1:
            continue
        taken[f] = taken[g] = True
        spare[a] -= 1
        spare[b] -= 1
        chosen.append(e)
    picked = np.array(chosen, dtype=np.int64)
    partner[h[picked] // 3] = t[picked] // 3
    partner[t[picked] // 3] = h[picked] // 3
    single = np.flatnonzero(partner < 0)
    # Sides of the polygons, as halfedges of the triangles.
    pair = (t[picked], h[picked])
    sides4 = np.stack([turn(k) for k in pair for turn in (next_halfedge, prev_halfedge)], axis=1)
    sides3 = 3 * single[:, None] + np.arange(3)
    sides = np.concatenate([sides4.reshape(-1), sides3.reshape(-1)])
    start = np.cumsum([0] + [4] * len(picked) + [3] * len(single)).astype(np.int64)
    corner = np.full(3 * mesh.n_faces, -1, dtype=np.int64)
    corner[sides] = np.arange(len(sides))
    other = mesh.twin[sides]
    twin = np.where(other >= 0, corner[other], -1)
    return PolygonMesh(mesh.vertices, mesh.tail[sides], start, twin)


def _pair_score(vertices: Floats, quad: Ints, directions: Floats | None) -> Floats:
    """Least scaled Jacobian of each quad, plus up to ALIGNMENT_WEIGHT for following the cross."""
    p = vertices[quad]
    forward = np.roll(p, -1, axis=1) - p
    normal = unit(cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]))
    length = np.linalg.norm(forward, axis=2)
    area = np.einsum("kci,ki->kc", cross(forward, -np.roll(forward, 1, axis=1)), normal)
    scale = length * np.roll(length, 1, axis=1)
    jacobian = np.divide(area, scale, out=np.full_like(area, -1.0), where=scale > 0)
    score = np.asarray(jacobian.min(axis=1))
    if directions is None:
        return score
    d = directions[quad]
    d = d - np.einsum("kci,ki->kc", d, normal)[..., None] * normal[:, None]
    turn = np.arctan2(
        np.einsum("kci,ki->kc", cross(d, forward), normal), np.einsum("kci,kci->kc", d, forward)
    )
    return np.asarray(score + ALIGNMENT_WEIGHT * np.cos(4 * turn).mean(axis=1))


def _vertex_crosses(mesh: TriMesh, angle: Floats) -> Floats:
    """A direction of the cross in some face at each vertex; (n, 3)."""
    x = unit(mesh.vertices[mesh.faces[:, 1]] - mesh.vertices[mesh.faces[:, 0]])
    y = cross(mesh.face_normals, x)
    direction = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    out = np.zeros((mesh.n_vertices, 3))
    out[mesh.faces] = direction[:, None, :]
    return out


# ---- boundary and surface -------------------------------------------------------------------


def boundary_curves(mesh: TriMesh) -> CurveConstraints:
    """The boundary loops as closed curves, in their order of travel, bound to the mesh's vertices.

    Vertices of the mesh get the loop on which they lie (one of them if loops touch).
    """
    curve = np.full(mesh.n_vertices, -1, dtype=np.int64)
    lines = []
    for i, loop in enumerate(mesh.boundary_loops):  # loops are few
        curve[mesh.tail[loop]] = i
        lines.append(mesh.vertices[mesh.tail[loop]])
    return CurveConstraints(lines, [True] * len(lines), curve)


def _corners(mesh: TriMesh) -> Bools:
    """Boundary vertices where the boundary turns sharply; (n,)."""
    border = np.flatnonzero(mesh.twin < 0)
    angle = np.bincount(mesh.tail, mesh.corner_angles.reshape(-1), mesh.n_vertices)
    flag = np.zeros(mesh.n_vertices, dtype=bool)
    tail = mesh.tail[border]
    flag[tail] = np.abs(np.pi - angle[tail]) > CORNER_TURN
    return flag


def _on_boundary(mesh: TriMesh, source: Ints, curves: CurveConstraints) -> tuple[Ints, Floats]:
    """Curve and arc length of the coarse vertices, exactly at the input's vertices."""
    place = np.zeros(mesh.n_vertices)
    for i, loop in enumerate(mesh.boundary_loops):  # loops are few
        place[mesh.tail[loop]] = curves.arc[curves.start[i] : curves.start[i + 1] - 1]
    return curves.curve[source], place[source]


def _split_boundary(
    before: PolygonMesh, after: PolygonMesh, curves: CurveConstraints, curve: Ints, arc: Floats
) -> tuple[Ints, Floats]:
    """Carry curves and arc lengths through a midpoint split: new ones halfway along the curve."""
    n, extra = len(before.vertices), len(after.vertices) - len(before.vertices)
    new_curve = np.concatenate([curve, np.full(extra, -1, dtype=np.int64)])
    new_arc = np.concatenate([arc, np.zeros(extra)])
    h = np.flatnonzero(before.twin < 0)
    tail, head = before.corners[h], before.corners[before.next[h]]
    c = curve[tail]
    total = curves.arc[curves.start[c + 1] - 1] - curves.arc[curves.start[c]]
    ahead = np.mod(arc[head] - arc[tail], total)
    middle = n + before.edge[h]
    new_curve[middle] = c
    new_arc[middle] = curves.bind(new_curve).wrap(middle, arc[tail] + 0.5 * ahead)
    return new_curve, new_arc


def _on_surface(
    mesh: PolygonMesh,
    n_old: int,
    surface: ClosestPoints,
    curves: CurveConstraints,
    curve: Ints,
    arc: Floats,
) -> PolygonMesh:
    """Bring the vertices from ``n_old`` on to the surface, those on curves to their places.

    A vertex whose closest point faces away from its polygons is pulled towards an old neighbour,
    which is on the right side, until it no longer does.
    """
    x = mesh.vertices.copy()
    q = mesh.corners.reshape(-1, 4)
    normal = np.zeros_like(x)
    p = x[q]
    facing = cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    for k in range(4):
        np.add.at(normal, q[:, k], facing)
    anchor = np.arange(len(x))
    for k in (1, 2, 3):  # corner 0 of each quad is old
        anchor[q[:, k]] = q[:, 0]
    free = np.flatnonzero((np.arange(len(x)) >= n_old) & (curve < 0))
    wanted = x.copy()
    for share in (1.0, 0.5, 0.2, 0.0):
        hits = surface.query(x[anchor[free]] + share * (wanted[free] - x[anchor[free]]))
        x[free] = hits.point
        away = np.einsum("vi,vi->v", surface.mesh.face_normals[hits.face], normal[free]) < 0
        free = free[away]
        if free.size == 0:
            break
    bound = curves.bind(curve)
    line = np.flatnonzero(curve >= 0)
    x[line] = bound.position(line, arc[line])
    return PolygonMesh(x, mesh.corners, mesh.start, mesh.twin)
