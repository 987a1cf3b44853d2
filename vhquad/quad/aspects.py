"""How much longer than wide quads are, and are to stay: what rows of quads along a field need.

The rows between two lines of a field are as wide as the lines are apart, whatever the length of
their quads, so quads that follow the field are oblong, and to square them is to bend the rows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.quad.corners import ahead, corners, dot

__all__ = ["smoothed_aspects"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROUNDS = 2  # of averaging: rounding to whole quads makes neighbouring rows uneven
MOST = 2.0  # longest quad to ask for, of its width
FLAT = 1e-9  # of the longest edge: shorter ones tell no aspect

_SIGN = np.array([[1.0], [-1.0], [1.0], [-1.0]])  # edges 1 and 3 run across: there length is width


def smoothed_aspects(vertices: Floats, quads: Ints, rounds: int = ROUNDS) -> Floats:
    """Length of edges 0 and 2 of each quad over that of edges 1 and 3, averaged over neighbours.

    Logarithms are averaged, seen along the shared edge: what is long for one quad may be wide for
    the next. Around an irregular vertex the aspects contradict each other and go to 1.

    Parameters
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
        Corners of a manifold mesh.
    rounds : int
        How often to average.

    Returns
    -------
    (k,) float64
        Between 1/2 and 2.
    """
    p = corners(vertices, quads)
    edge = ahead(p) - p
    length = np.sqrt(dot(edge, edge))
    length = np.maximum(length[:2] + length[2:], FLAT * max(float(length.max()), 1e-300))
    value = np.clip(np.log(length[0] / length[1]), -np.log(MOST), np.log(MOST))
    tail = quads.T
    ends = np.sort(np.stack([tail, np.roll(tail, -1, axis=0)]).reshape(2, -1), axis=0)
    _, shared = np.unique(ends[0] * len(vertices) + ends[1], return_inverse=True)
    shared = shared.reshape(-1)
    count = np.bincount(shared)
    for _ in range(rounds):
        along = np.bincount(shared, (value * _SIGN).reshape(-1)) / count
        value = (along[shared].reshape(4, -1) * _SIGN).mean(axis=0)
    return np.asarray(np.exp(value))
