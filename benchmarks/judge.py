"""Judge one mesh of quads against the triangles it was made from, whoever made it.

    python benchmarks/judge.py QUADS.obj INPUT.obj [REPORT.json]

prints one JSON object. Topology, folds, borders and creases are computed here with numpy alone
(libigl for distances to segments), not by vhquad, which is judged too; distances between the
surfaces, quads facing the wrong way and self-intersections are those of ``vhquad check``, or, the
same thing, of the report that ``vhquad remesh --json`` wrote.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CREASE = 40.0  # degrees
SAMPLES = 4000  # along all creases
ON_CREASE = 1e-6  # of the diagonal


def read(path: Path) -> tuple[Floats, list[list[int]]]:
    """Vertices and faces of an OBJ file."""
    points: list[list[float]] = []
    faces: list[list[int]] = []
    with path.open(encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    return np.array(points).reshape(-1, 3), faces


def sides(faces: list[list[int]]) -> Ints:
    """Directed edges (s, 2), face by face."""
    pairs = [pair for f in faces for pair in zip(f, f[1:] + f[:1], strict=True)]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def pieces(pairs: Ints, count: int) -> tuple[int, Ints]:
    """Number of connected pieces among `count` things joined in pairs, and the piece of each."""
    joined = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (count, count))
    number, label = connected_components(joined, directed=False)
    return int(number), label.astype(np.int64)


def border(faces: list[list[int]]) -> Ints:
    """Directed edges with one face, (b, 2)."""
    directed = sides(faces)
    _, index, count = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return directed[count[index.reshape(-1)] == 1]


def topology(faces: list[list[int]], n_vertices: int) -> dict[str, int]:
    """Components, Euler characteristic, loops, and what keeps it from being a manifold."""
    directed = sides(faces)
    undirected, count = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    used = np.unique(directed)
    number, _ = pieces(undirected, n_vertices)
    # A fan is a run of corners joined across shared sides: corners meet at both ends of an edge.
    size = np.array([len(f) for f in faces])
    first = np.cumsum(size) - size
    face = np.repeat(np.arange(len(faces)), size)
    corner = np.arange(len(directed))
    following = first[face] + (corner - first[face] + 1) % size[face]
    order = np.lexsort((directed.max(axis=1), directed.min(axis=1)))
    key = np.sort(directed, axis=1)[order]
    same = np.flatnonzero((key[1:] == key[:-1]).all(axis=1))
    a, b = order[same], order[same + 1]
    opposite = directed[a, 0] == directed[b, 1]
    other_a = np.where(opposite, following[b], b)
    other_b = np.where(opposite, b, following[b])
    joined = np.concatenate([np.stack([a, other_a], 1), np.stack([following[a], other_b], 1)])
    _, fan = pieces(joined, len(directed))
    # Boundary edges join the fans at their two ends to loops.
    alone = np.ones(len(directed), dtype=bool)
    alone[np.concatenate([a, b])] = False
    rim = np.flatnonzero(alone)
    _, loop = pieces(np.stack([fan[rim], fan[following[rim]]], 1), len(directed))
    fans = len(np.unique(np.stack([directed[:, 0], fan], 1), axis=0))
    _, repeats = np.unique(directed, axis=0, return_counts=True)
    return {
        "components": number - (n_vertices - len(used)),
        "euler": len(used) - len(undirected) + len(faces),
        "loops": len(np.unique(loop[fan[rim]])),
        "nonmanifold_edges": int((count > 2).sum()),
        "nonmanifold_vertices": fans - len(used),
        "misoriented_edges": int((repeats > 1).sum()),
        "unused_vertices": n_vertices - len(used),
    }


def shape(points: Floats, quads: Ints) -> dict[str, float]:
    """Scaled Jacobians: sines of the corners, signed against the quad's own normal."""
    p = points[quads]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    a, b = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    part = np.einsum("qki,qi->qk", np.cross(a, b), normal)
    whole = np.linalg.norm(a, axis=2) * np.linalg.norm(b, axis=2)
    whole = whole * np.linalg.norm(normal, axis=1)[:, None]
    sine = np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
    return {
        "folded": int((sine <= 0).any(axis=1).sum()),
        "jacobian_min": float(sine.min()),
        "jacobian_mean": float(sine.min(axis=1).mean()),
    }


def irregular(faces: list[list[int]], n_vertices: int) -> tuple[Ints, Ints]:
    """Interior vertices of valence other than 4, and their valences."""
    directed = sides(faces)
    edges = np.unique(np.sort(directed, axis=1), axis=0)
    valence = np.bincount(edges.reshape(-1), minlength=n_vertices)
    inside = np.ones(n_vertices, dtype=bool)
    inside[border(faces).reshape(-1)] = False
    odd = np.flatnonzero(inside & (valence > 0) & (valence != 4))
    return odd, valence[odd]


def tally(valences: Ints) -> dict[str, int]:
    """How many there are of each."""
    return {str(v): int(n) for v, n in sorted(Counter(valences.tolist()).items())}


def segment_distance(queries: Floats, points: Floats, edges: Ints) -> Floats:
    """From each query to the nearest of some segments."""
    squared, _, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(queries), np.ascontiguousarray(points), np.ascontiguousarray(edges)
    )
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def sharp_edges(points: Floats, triangles: Ints) -> Ints:
    """Edges whose faces turn by more than CREASE degrees, (e, 2).

    A triangle without height has no normal, and its edges no angle: they are left out.
    """
    p = points[triangles]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    area = np.linalg.norm(normal, axis=1)
    longest = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2).max(axis=1)
    flat = area <= ON_CREASE * np.linalg.norm(np.ptp(points, axis=0)) * longest
    normal /= np.maximum(area, 1e-300)[:, None]
    directed = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    face = np.repeat(np.arange(len(triangles)), 3)
    key = np.sort(directed, axis=1)
    order = np.lexsort(key.T)
    same = np.flatnonzero((key[order][1:] == key[order][:-1]).all(axis=1))
    a, b = order[same], order[same + 1]
    turn = np.einsum("ei,ei->e", normal[face[a]], normal[face[b]])
    sharp = (turn < np.cos(np.radians(CREASE))) & ~flat[face[a]] & ~flat[face[b]]
    return key[a][sharp]


def spread(points: Floats, edges: Ints) -> Floats:
    """Points spread evenly along edges."""
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    length = np.linalg.norm(end - start, axis=1)
    count = np.maximum(np.rint(SAMPLES * length / length.sum()), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(edges)), count)
    place = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    t = ((place + 0.5) / count[edge])[:, None]
    return np.asarray(start[edge] + t * (end - start)[edge])


def judge(quads_path: Path, input_path: Path) -> dict[str, Any]:
    """All figures; lengths in % of the diagonal of the input's box."""
    points, faces = read(quads_path)
    surface, triangles = read(input_path)
    wanted = topology(triangles, len(surface))
    diagonal = float(np.linalg.norm(np.ptp(surface, axis=0)))
    found: dict[str, Any] = {"faces": len(faces)}
    found["non_quads"] = sum(len(set(f)) != 4 or len(f) != 4 for f in faces)
    if not faces:
        return found
    found.update(topology(faces, len(points)))
    found["input"] = {k: wanted[k] for k in ("components", "euler", "loops")}
    found["kept"] = all(found[k] == wanted[k] for k in ("components", "euler", "loops"))
    odd, valence = irregular(faces, len(points))
    found["irregular"] = tally(valence)
    quads = np.array([f for f in faces if len(f) == 4 == len(set(f))]).reshape(-1, 4)
    if len(quads):
        found.update(shape(points, quads))
    rim, own_rim = border(triangles), border(faces)
    if len(rim) and len(own_rim):
        off = segment_distance(points[np.unique(own_rim)], surface, rim)
        found["border_off"] = 100.0 * float(off.max()) / diagonal
    sharp = sharp_edges(surface, np.array(triangles))
    if len(sharp):
        near = segment_distance(points[odd], surface, sharp) <= ON_CREASE * diagonal
        found["irregular_off_creases"] = tally(valence[~near])
        off = segment_distance(spread(surface, sharp), points, np.sort(sides(faces), axis=1))
        found["crease_off"] = 100.0 * float(off.mean()) / diagonal
        found["crease_off_max"] = 100.0 * float(off.max()) / diagonal
    return found


def by_vhquad(quads_path: Path, input_path: Path) -> dict[str, Any]:
    """What ``vhquad check`` finds."""
    from vhquad.api import check

    return check(quads_path, input_path).quality.to_dict()


def main() -> None:
    quads, surface = Path(sys.argv[1]), Path(sys.argv[2])
    found = judge(quads, surface)
    if len(sys.argv) > 3:
        quality = json.loads(Path(sys.argv[3]).read_text())["quality"]
    else:
        quality = by_vhquad(quads, surface)
    found["flipped"] = quality["flipped_quads"]
    found["self_intersections"] = quality["self_intersections"]
    if quality["distance"] is not None:
        found["hausdorff"] = quality["distance"]["hausdorff"]
        found["mean_distance"] = quality["distance"]["mean"]
    print(json.dumps(found))


if __name__ == "__main__":
    main()
