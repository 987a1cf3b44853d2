"""Polygons to quads with as few edits as possible; the topology is kept.

Doublets (inside vertices with two edges) are dropped, odd polygons get a side more by paths of
split edges between them (a T-join of the dual graph), even ones are cut into quads. Edges that
repeat another's two vertices are split along their whole strip of quads. If a valid quad mesh does
not come out so, every polygon is split from its centre, once or twice.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.quad import QuadMesh
from vhquad.quad.cells import Cells
from vhquad.quad.distortion import corner_jacobians, quad_normals
from vhquad.quad.ragged import PolygonMesh, midpoint_split

__all__ = ["Quadrangulation", "quads_from_polygons"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STRIP_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Quadrangulation:
    """Quads made of polygons.

    Attributes
    ----------
    quads : QuadMesh
        Valid: manifold, no quad degenerate.
    source : (n,) int64
        Polygon vertex that each vertex is, -1 for new ones (middles of edges, centres).
    n_edited : int
        Polygons that are no quads of the result; 0 if the polygons were fine as they were.
    resorted : bool
        Whether everything had to be split from the centres.
    """

    quads: QuadMesh
    source: Ints
    n_edited: int
    resorted: bool


def quads_from_polygons(mesh: PolygonMesh) -> Quadrangulation:
    """Make a valid quad mesh of polygons on a manifold surface.

    Parameters
    ----------
    mesh : PolygonMesh
        Polygons of two sides or more; edges may repeat each other's vertices.

    Returns
    -------
    Quadrangulation
        Of the same Euler characteristic, boundary loops and components.
    """
    n = len(mesh.vertices)
    if (mesh.sides == 4).all():
        found = _packed(mesh, n, 0, False)
        if found.quads.is_manifold and len(found.quads.doublets) == 0:
            return found
    cells = Cells(mesh)
    _drop_doublets(cells)
    _make_even(cells)
    for f in cells.alive():
        if len(cells.faces[f]) != 4:
            _cut_even(cells, f)
    for _ in range(STRIP_ROUNDS):
        if any(len(cells.faces[f]) != 4 for f in cells.alive()):
            break
        doubled = _doubled_edges(cells)
        if not doubled:
            _drop_doublets(cells)
            edited = len(set(map(frozenset, mesh.polygons())) - _as_sets(cells))
            found = _packed(cells.mesh(), n, edited, False)
            if found.quads.is_manifold:
                return found
            break
        _split_strips(cells, doubled)
    split = midpoint_split(mesh)
    found = _packed(split, n, mesh.n_polygons, True)
    if found.quads.is_manifold:
        return found
    return _packed(midpoint_split(split), n, mesh.n_polygons, True)


def _as_sets(cells: Cells) -> set[frozenset[int]]:
    return {frozenset(cells.corners(f)) for f in cells.alive()}


def _packed(mesh: PolygonMesh, n_old: int, n_edited: int, resorted: bool) -> Quadrangulation:
    used, local = np.unique(mesh.corners, return_inverse=True)
    quads = QuadMesh(mesh.vertices[used], local.reshape(-1, 4))
    return Quadrangulation(quads, np.where(used < n_old, used, -1), n_edited, resorted)


# ---- doublets -------------------------------------------------------------------------------


def _drop_doublets(cells: Cells) -> None:
    """Join the two faces around each inside vertex of two edges, while that leaves a face."""
    leaving: dict[int, list[int]] = {}
    rim = set()
    for f in cells.alive():
        for h in cells.faces[f]:
            leaving.setdefault(cells.tail[h], []).append(h)
            if cells.twin[h] < 0:
                rim |= {cells.tail[h], cells.head(h)}
    todo = [v for v, out in leaving.items() if len(out) == 2 and v not in rim]
    while todo:
        v = todo.pop()
        out = [h for h in leaving[v] if cells.tail[h] == v and _has(cells, h)]
        if len(out) != 2:
            continue
        f, g = (cells.face[h] for h in out)
        ends = [cells.head(h) for h in out]
        rest = [a for a in (*cells.corners(f), *cells.corners(g)) if a != v]
        # Both faces hold the two ends; all else must be different, and enough be left.
        if f == g or ends[0] == ends[1] or len(set(rest)) != len(rest) - 2 or len(rest) < 6:
            continue
        cells.prune(cells.merge(out[0]))
        leaving[v] = []
        for a in ends:
            leaving[a] = [h for h in leaving[a] if _has(cells, h)]
            if len(leaving[a]) == 2 and a not in rim:
                todo.append(a)


def _has(cells: Cells, h: int) -> bool:
    return h in cells.faces[cells.face[h]]


# ---- parity ---------------------------------------------------------------------------------


def _make_even(cells: Cells) -> None:
    """Split edges along paths between odd faces, or from the last one to the boundary."""
    odd = {f for f in cells.alive() if len(cells.faces[f]) % 2}
    crossed: set[int] = set()
    while odd:
        f = odd.pop()
        path, end = _path_to_odd(cells, f, odd)
        odd.discard(end)
        for h in path:
            crossed ^= {min(h, cells.twin[h]) if cells.twin[h] >= 0 else h}
    for h in sorted(crossed):
        cells.split_edge(h)


def _path_to_odd(cells: Cells, f: int, odd: set[int]) -> tuple[list[int], int]:
    """Halfedges crossed on the shortest way to another odd face, else to the boundary (end -1)."""
    came: dict[int, int] = {f: -1}
    outlet: tuple[int, int] | None = None
    queue = deque([f])
    while queue:
        g = queue.popleft()
        if g in odd:
            return _trace(cells, came, g), g
        for h in cells.faces[g]:
            t = cells.twin[h]
            if t < 0:
                outlet = outlet or (g, h)
            elif cells.face[t] not in came:
                came[cells.face[t]] = h
                queue.append(cells.face[t])
    if outlet is None:  # cannot be: a closed surface has an even number of odd faces
        return [], -1
    return [*_trace(cells, came, outlet[0]), outlet[1]], -1


def _trace(cells: Cells, came: dict[int, int], g: int) -> list[int]:
    path = []
    while came[g] >= 0:
        path.append(came[g])
        g = cells.face[came[g]]
    return path


# ---- cutting --------------------------------------------------------------------------------


def _cut_even(cells: Cells, f: int) -> None:
    """Cut a face of 6, 8... sides into quads: by good diagonals, else by a star."""
    while len(cells.faces[f]) > 4:
        corners = cells.corners(f)
        n = len(corners)
        best, place = 0.0, -1
        for i in range(n - 3):
            if len(set(corners)) == n and not _joined(cells, f, i, i + 3):
                pieces = [corners[i : i + 4]]
                if n == 6:
                    pieces.append([*corners[: i + 1], *corners[i + 3 :]])
                score = _worst(cells, pieces)
                if score > best:
                    best, place = score, i
        if place < 0:
            _star(cells, f)
            return
        cells.cut(f, place, place + 3)


def _joined(cells: Cells, f: int, i: int, j: int) -> bool:
    """Whether an edge of the faces around corner i of a face leads to corner j."""
    face = cells.faces[f]
    a, b = cells.tail[face[i]], cells.tail[face[j]]
    seen, todo = set(), [face[i]]
    while todo:
        h = todo.pop()
        if h < 0 or h in seen:
            continue
        seen.add(h)
        around = cells.faces[cells.face[h]]
        before = around[around.index(h) - 1]
        if b in (cells.head(h), cells.tail[before]):
            return True
        todo.append(cells.twin[before])
        if cells.twin[h] >= 0:
            other = cells.faces[cells.face[cells.twin[h]]]
            todo.append(other[(other.index(cells.twin[h]) + 1) % len(other)])
    return a == b


def _worst(cells: Cells, pieces: list[list[int]]) -> float:
    """Least scaled Jacobian of some quads."""
    x = np.array([[cells.points[v] for v in piece] for piece in pieces]).reshape(-1, 3)
    q = np.arange(len(x)).reshape(-1, 4)
    return float(corner_jacobians(x, q, quad_normals(x, q)).min())


def _star(cells: Cells, f: int) -> None:
    """Cut by a star from every other corner, those that repeat a vertex the least."""
    corners = cells.corners(f)
    repeats = [len(corners) // 2 - len(set(corners[k::2])) for k in (0, 1)]
    if len(corners) >= 6:
        cells.star(f, int(repeats[1] < repeats[0]))


# ---- edges that repeat others ---------------------------------------------------------------


def _doubled_edges(cells: Cells) -> list[int]:
    """All but one of the edges that join the same two vertices, and edges that are loops."""
    seen: set[tuple[int, int]] = set()
    out = []
    for h, a, b in cells.edges():
        if a == b or (a, b) in seen:
            out.append(h)
        seen.add((a, b))
    return out


def _split_strips(cells: Cells, edges: list[int]) -> None:
    """Cut every quad of the strips across some edges in two, lengthwise."""
    strip: set[int] = set()
    todo = list(edges)
    while todo:
        h = todo.pop()
        if h < 0 or h in strip:
            continue
        strip.add(h)
        face = cells.faces[cells.face[h]]
        todo += [cells.twin[h], face[(face.index(h) + 2) % 4]]
    count = {f: sum(h in strip for h in cells.faces[f]) for f in cells.alive()}
    old = len(cells.points)
    for h in [h for h in sorted(strip) if cells.twin[h] < 0 or h < cells.twin[h]]:
        cells.split_edge(h)
    for f, crossed in count.items():
        middles = [i for i, v in enumerate(cells.corners(f)) if v >= old]
        if crossed == 2:
            cells.cut(f, *middles)
        elif crossed == 4:
            cells.star(f, middles[0])
