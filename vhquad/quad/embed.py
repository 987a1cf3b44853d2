"""Positions of the quads of a layout on the surface, by transfinite interpolation in the map.

Points of an arc are spread evenly over it. The inner points of a patch are interpolated between
its four sides in the map (Gordon & Hall 1973), where the patch is a rectangle, and carried to the
surface by the triangles that cover the rectangle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.field.align import AlignedField
from vhquad.quad.layout import Layout, side_length
from vhquad.quad.seamless_map import SeamlessMap, rotate
from vhquad.quad.tmesh import Patch, TMesh

__all__ = ["embed_layout"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEAR_TRIANGLES = 12
CHUNK = 64  # points compared with every triangle of a patch at a time


def embed_layout(layout: Layout, aligned: AlignedField, seamless: SeamlessMap) -> Floats:
    """Position of each vertex of a layout; (n_vertices, 3).

    Vertices on features lie on their polylines and special vertices keep their place; others may
    be a little off the surface where several points fell together.
    """
    tmesh = layout.tmesh
    points = np.zeros((layout.n_points, 3))
    points[: len(tmesh.node_points)] = tmesh.node_points
    rank = np.zeros(layout.n_points, dtype=np.int64)  # who decides in a class
    rank[: len(tmesh.node_points)] = np.where(
        tmesh.node_fixed,
        4,
        np.where(tmesh.node_feature >= 0, 3, np.where(tmesh.node_vertex >= 0, 2, 1)),
    )
    for a, arc in enumerate(tmesh.arcs):
        n = int(layout.lengths[a])
        if n < 2:
            continue
        inner = layout.arc_offset[a] + np.arange(n - 1)
        at = arc.length * np.arange(1, n) / n
        for axis in range(3):
            points[inner, axis] = np.interp(at, arc.at, arc.points[:, axis])
        rank[inner] = 3 if arc.feature >= 0 else 1
    cover = _cover(tmesh, aligned, seamless, layout)
    for number, patch in enumerate(tmesh.patches):
        _fill(layout, number, patch, cover.get(number), aligned, points, rank)

    # The highest rank in a class decides; equals are averaged, but not on features.
    best = np.zeros(layout.n_vertices, dtype=np.int64)
    np.maximum.at(best, layout.vertex_of, rank)
    decides = rank == best[layout.vertex_of]
    first = np.full(layout.n_vertices, layout.n_points)
    np.minimum.at(first, layout.vertex_of[decides], np.flatnonzero(decides))
    decides &= (best[layout.vertex_of] < 3) | (first[layout.vertex_of] == np.arange(len(rank)))
    out = np.zeros((layout.n_vertices, 3))
    np.add.at(out, layout.vertex_of[decides], points[decides])
    count = np.bincount(layout.vertex_of[decides], minlength=layout.n_vertices)
    return np.asarray(out / count[:, None])


def _side_parameters(layout: Layout, side: tuple[int, ...]) -> Floats:
    """Place of the lattice points along a side, from 0 to 1."""
    tmesh = layout.tmesh
    places: list[list[float]] = [[0.0]]
    travelled = 0.0
    for h in side:
        length = tmesh.arcs[h >> 1].length
        n = int(layout.lengths[h >> 1])
        if n == 0:
            travelled += length
            places[-1].append(travelled)
            continue
        places.extend([travelled + length * i / n] for i in range(1, n + 1))
        travelled += length
    middle = np.array([0.5 * (p[0] + p[-1]) for p in places])
    middle[0], middle[-1] = 0.0, travelled
    return np.asarray(middle / max(travelled, 1e-300))


def _has_inner_points(layout: Layout, patch: Patch) -> bool:
    """Whether a patch is more than one quad wide and high."""
    return all(side_length(layout.lengths, side) > 1 for side in patch.sides[:2])


_Cover = tuple[Ints, NDArray[np.complex128]]


def _fill(
    layout: Layout,
    number: int,
    patch: Patch,
    cover: _Cover | None,
    aligned: AlignedField,
    points: Floats,
    rank: Ints,
) -> None:
    """Place the inner points of one patch."""
    if not _has_inner_points(layout, patch):
        return
    inner = layout.grid(number)[1:-1, 1:-1]
    bottom, right, top, left = (_side_parameters(layout, side) for side in patch.sides)
    top, left = 1.0 - top[::-1], 1.0 - left[::-1]
    # On a line from bottom[i] to top[i] and one from left[j] to right[j], in the unit square.
    b, t = bottom[1:-1, None], top[1:-1, None]
    lo, r = left[None, 1:-1], right[None, 1:-1]
    det = 1.0 - (t - b) * (r - lo)
    x = (b + (t - b) * lo) / np.maximum(det, 1e-3)
    y = (lo + (r - lo) * b) / np.maximum(det, 1e-3)
    width = sum(layout.tmesh.arcs[h >> 1].length for h in patch.sides[0])
    height = sum(layout.tmesh.arcs[h >> 1].length for h in patch.sides[1])
    wanted = (np.clip(x, 0, 1) * width + 1j * np.clip(y, 0, 1) * height).ravel()
    flat = inner.ravel()
    rank[flat] = 1
    assert cover is not None
    faces, corners = cover
    mesh = aligned.mesh
    # The triangles with the nearest centres nearly always include the one around a point.
    centre = corners.mean(axis=1)
    near = min(NEAR_TRIANGLES, len(faces))
    tree = cKDTree(np.column_stack([centre.real, centre.imag]))
    found = tree.query(np.column_stack([wanted.real, wanted.imag]), k=near)[1]
    place, weights = _containing(corners, wanted, found.reshape(len(wanted), near))
    astray = np.flatnonzero(weights.min(axis=1) < -1e-9)
    everything = np.arange(len(faces))[None]
    for low in range(0, len(astray), CHUNK):
        q = astray[low : low + CHUNK]
        place[q], weights[q] = _containing(corners, wanted[q], everything.repeat(len(q), axis=0))
    weights = np.maximum(weights, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    at = mesh.vertices[mesh.faces[faces[place]]]
    points[flat] = np.einsum("qk,qki->qi", weights, at)


def _containing(
    corners: NDArray[np.complex128], q: NDArray[np.complex128], candidates: Ints
) -> tuple[Ints, Floats]:
    """The candidate triangle that holds each point best, and barycentric coordinates in it."""
    weights = _barycentric(corners[candidates], q)
    best = np.argmax(weights.min(axis=2), axis=1)
    rows = np.arange(len(q))
    return candidates[rows, best], weights[rows, best]


def _barycentric(corners: NDArray[np.complex128], q: NDArray[np.complex128]) -> Floats:
    """Barycentric coordinates of each point in its candidate triangles; (q, t, 3)."""
    a, b, c = corners[..., 0], corners[..., 1], corners[..., 2]
    e, g = b - a, c - a
    det = (e.conj() * g).imag
    d = q[:, None] - a
    s = (d.conj() * g).imag / det
    t = (e.conj() * d).imag / det
    return np.stack([1 - s - t, s, t], axis=2)


def _cover(
    tmesh: TMesh, aligned: AlignedField, seamless: SeamlessMap, layout: Layout
) -> dict[int, _Cover]:
    """Triangles over each patch with inner points, unfolded into the patch's rectangle.

    All patches are flooded at once, a ring of triangles a round, across every edge that meets the
    open rectangle. A triangle may lie in one patch more than once, in different places.
    """
    mesh = aligned.mesh
    wanted = [p for p, patch in enumerate(tmesh.patches) if _has_inner_points(layout, patch)]
    size = np.zeros((len(tmesh.patches), 2))
    start: list[tuple[int, int, int, int, int]] = []
    for p in wanted:
        patch = tmesh.patches[p]
        h = patch.sides[0][0]
        arc = tmesh.arcs[h >> 1]
        face, direction, u, v = arc.back_chart if h & 1 else arc.chart
        turn = -direction % 4
        z = rotate(np.array([[round(u), round(v)]], dtype=np.int64), np.array([turn]))[0]
        start.append((p, face, turn, -int(z[0]), -int(z[1])))
        size[p] = [
            sum(tmesh.arcs[h >> 1].length for h in patch.sides[i]) / seamless.unit for i in (0, 1)
        ]
    if not start:
        return {}
    front = np.array(start, dtype=np.int64)
    seen = {tuple(row) for row in front.tolist()}
    layers = [front]
    while len(front):
        owner, f, spin = front[:, 0], front[:, 1], front[:, 2]
        shift = front[:, 3:5]
        following = []
        for side in range(3):
            halves = 3 * f + side
            a = rotate(seamless.uv[f, side], spin) + shift
            b = rotate(seamless.uv[f, (side + 1) % 3], spin) + shift
            ok = (mesh.twin[halves] >= 0) & ~aligned.feature[halves] & _meets(a, b, size[owner])
            h_in, q = halves[ok], owner[ok]
            # z_patch = i^turn z_f + shift and z_g = i^r z_f + t give the neighbour's placement.
            new_turn = (spin[ok] - seamless.rotation[h_in]) % 4
            new_shift = shift[ok] - rotate(seamless.translation[h_in], new_turn)
            following.append(
                np.column_stack(
                    [q, mesh.twin[h_in] // 3, new_turn, new_shift[:, 0], new_shift[:, 1]]
                )
            )
        rows = np.concatenate(following).tolist()
        fresh = []
        for row in rows:
            key = tuple(row)
            if key not in seen:
                seen.add(key)
                fresh.append(row)
        front = np.array(fresh, dtype=np.int64).reshape(-1, 5)
        layers.append(front)
    rows_all = np.concatenate(layers)
    rows_all = rows_all[np.argsort(rows_all[:, 0], kind="stable")]
    corners = (
        np.stack(
            [
                rotate(seamless.uv[rows_all[:, 1], k], rows_all[:, 2]) + rows_all[:, 3:5]
                for k in range(3)
            ],
            axis=1,
        )
        * seamless.unit
    )
    z = corners[..., 0] + 1j * corners[..., 1]
    cut = np.searchsorted(rows_all[:, 0], np.arange(len(tmesh.patches) + 1))
    return {p: (rows_all[cut[p] : cut[p + 1], 1], z[cut[p] : cut[p + 1]]) for p in wanted}


def _meets(a: Ints, b: Ints, size: Floats) -> NDArray[np.bool_]:
    """Whether segments ab meet the open rectangles [0, width] x [0, height] (Liang & Barsky)."""
    p, d = a.astype(np.float64), (b - a).astype(np.float64)
    enter, leave = np.zeros(len(a)), np.ones(len(a))
    inside = np.ones(len(a), dtype=bool)
    margin = 0.5
    for axis in (0, 1):
        low, high = margin - p[:, axis], size[:, axis] - margin - p[:, axis]
        step = d[:, axis]
        flat = step == 0
        inside &= ~flat | ((low < 0) & (high > 0))
        safe = np.where(flat, 1.0, step)
        t0, t1 = low / safe, high / safe
        enter = np.where(flat, enter, np.maximum(enter, np.minimum(t0, t1)))
        leave = np.where(flat, leave, np.minimum(leave, np.maximum(t0, t1)))
    return inside & (enter < leave)
