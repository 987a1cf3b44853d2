"""Judge an OBJ of quads without vhquad, numpy or any other library.

    python .ci/quads.py quad.obj --like head.obj --about 4000

Fails unless every face is a quad of four distinct vertices, every edge has at most two faces, wound
in opposite directions, every vertex one fan of faces, no quad is folded (each corner's triangle
faces the quad's way), the Euler characteristic and the boundary loops are those of the other mesh,
and the count is within 10 %.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict

Point = tuple[float, float, float]


def read(path: str) -> tuple[list[Point], list[list[int]]]:
    points: list[Point] = []
    faces: list[list[int]] = []
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                points.append((float(words[1]), float(words[2]), float(words[3])))
            elif words[:1] == ["f"]:
                faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    return points, faces


def sides(face: list[int]) -> list[tuple[int, int]]:
    return list(zip(face, face[1:] + face[:1], strict=True))


def loops(faces: list[list[int]]) -> int:
    """Closed chains of edges with one face; chains that touch at a vertex count apart or as one."""
    count = Counter(frozenset(side) for face in faces for side in sides(face))
    after = {a: b for face in faces for a, b in sides(face) if count[frozenset((a, b))] == 1}
    found = 0
    while after:
        found += 1
        _, vertex = after.popitem()
        while vertex in after:
            vertex = after.pop(vertex)
    return found


def euler(faces: list[list[int]]) -> int:
    edges = {frozenset(side) for face in faces for side in sides(face)}
    return len({v for face in faces for v in face}) - len(edges) + len(faces)


def fans(faces: list[list[int]]) -> int:
    """Vertices at which several fans of faces meet."""
    around: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for face in faces:
        for k, v in enumerate(face):
            around[v].append((face[k - 1], face[(k + 1) % len(face)]))
    bad = 0
    for corners in around.values():
        group = {v: v for corner in corners for v in corner}

        def root(v: int, group: dict[int, int] = group) -> int:
            while group[v] != v:
                v = group[v]
            return v

        for a, b in corners:
            group[root(a)] = root(b)
        bad += len({root(v) for v in group}) > 1
    return bad


def cross(a: Point, b: Point) -> Point:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def less(a: Point, b: Point) -> Point:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def folded(points: list[Point], face: list[int]) -> bool:
    p = [points[v] for v in face]
    normal = cross(less(p[2], p[0]), less(p[3], p[1]))
    return any(
        dot(normal, cross(less(p[(k + 1) % 4], p[k]), less(p[k - 1], p[k]))) <= 0 for k in range(4)
    )


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("quads")
    parser.add_argument("--like", required=True)
    parser.add_argument("--about", type=int)
    options = parser.parse_args()
    points, faces = read(options.quads)
    _, other = read(options.like)

    directed = Counter(side for face in faces for side in sides(face))
    undirected = Counter(frozenset(side) for face in faces for side in sides(face))
    checks = {
        "there are faces": len(faces) > 0,
        "all faces are quads": all(len(f) == 4 == len(set(f)) for f in faces),
        "no edge has more than two faces": max(undirected.values(), default=0) <= 2,
        "neighbours are wound alike": max(directed.values(), default=0) <= 1,
        "every vertex has one fan": fans(faces) == 0,
        "no vertex is unused": len({v for f in faces for v in f}) == len(points),
        "no quad is folded": not any(folded(points, f) for f in faces if len(f) == 4),
        "same Euler characteristic": euler(faces) == euler(other),
        "same boundary loops": loops(faces) == loops(other),
    }
    if options.about:
        checks["count within 10 %"] = abs(len(faces) - options.about) <= 0.1 * options.about
    for name, holds in checks.items():
        print(f"{'ok  ' if holds else 'FAIL'} {name}")
    print(f"{len(faces)} faces")
    return 0 if all(checks.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
