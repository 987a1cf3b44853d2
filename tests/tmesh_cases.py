"""T-meshes made by hand: a row of rectangles in the plane."""

from __future__ import annotations

import numpy as np

from vhquad.quad.tmesh import Arc, Patch, TMesh


def row(k: int, width: float = 1.0, height: float = 1.0) -> TMesh:
    """k rectangles side by side, their outline a feature but for corners nothing special.

    Nodes 0..k along the bottom, k + 1..2 k + 1 along the top; arcs 0..k-1 along the bottom,
    k..2k-1 along the top, both to the right, then k + 1 uprights from left to right.
    """
    bottom = [[width * i, 0.0, 0.0] for i in range(k + 1)]
    points = np.array([*bottom, *([x, height, 0.0] for x, _, _ in bottom)])
    ends = [(i, i + 1) for i in range(k)]
    ends += [(k + 1 + i, k + 2 + i) for i in range(k)] + [(i, k + 1 + i) for i in range(k + 1)]
    curve = [0] * k + [1] * k + [2, *([-1] * (k - 1)), 3]
    arcs = []
    for number, (a, b) in enumerate(ends):
        length = float(np.linalg.norm(points[b] - points[a]))
        here = (0, 0, 0.0, 0.0)
        track = -1 if curve[number] >= 0 else number - 2 * k - 1
        at, line = np.array([0.0, length]), points[[a, b]]
        arcs.append(Arc(a, b, curve[number], track, at, line, here, here))
    patches = [
        Patch(((2 * i,), (2 * (2 * k + i + 1),), (2 * (k + i) + 1,), (2 * (2 * k + i) + 1,)))
        for i in range(k)
    ]
    n = len(points)
    vertex = np.full(n, -1)
    vertex[[0, k, k + 1, n - 1]] = [0, 1, 2, 3]
    feature = np.array([0] * (k + 1) + [1] * (k + 1))
    feature[[0, k + 1]], feature[[k, n - 1]] = 2, 3
    outline = [points[: k + 1], points[k + 1 :], points[[0, k + 1]], points[[k, n - 1]]]
    none = [np.zeros(0, dtype=np.int64)] * 4
    return TMesh(points, vertex, feature, vertex >= 0, outline, none, arcs, patches)


def lengths(k: int, widths: list[int], height: int) -> np.ndarray:
    """Arc lengths of a row for the widths of its rectangles and their height."""
    return np.array([*widths, *widths, *([height] * (k + 1))], dtype=np.int64)
