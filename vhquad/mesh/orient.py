"""Two-colouring: turn faces over so that all that are glued agree, and cut where they cannot.

A Moebius strip cannot be coloured; the glue that contradicts a breadth-first tree is given up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order

from vhquad.mesh.weld import components

__all__ = ["Colouring", "Sides", "colour"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Colouring:
    """Connected parts of a graph, the nodes to turn over, and the pairs that then agree."""

    part: Ints
    """(n,) part of each node."""
    turned: Bools
    """(n,) whether the node is turned over; never the lowest of a part."""
    agrees: Bools
    """(p,) whether a pair is satisfied; the others are to be cut."""


def colour(n: int, a: Ints, b: Ints, odd: Bools) -> Colouring:
    """Turn nodes so that the pairs (a, b) agree: exactly one of two turned where `odd`.

    Parameters
    ----------
    n : int
    a, b : (p,) int64
    odd : (p,) bool
    """
    part = components(n, a, b)
    apart = a != b
    # Twice the graph: node x upright and node x + n turned over.
    cover = components(
        2 * n,
        np.concatenate([a[apart], a[apart] + n]),
        np.concatenate([b[apart] + n * odd[apart], b[apart] + n * ~odd[apart]]),
    )
    lowest = np.full(int(part.max()) + 1 if n else 0, n, dtype=np.int64)
    np.minimum.at(lowest, part, np.arange(n))
    turned = cover[:n] != cover[lowest[part]]
    twisted = np.unique(part[cover[:n] == cover[n:]])
    for one in twisted.tolist():  # as a rule there is none
        _colour_twisted(int(lowest[one]), n, a, b, odd, turned)
    agrees = (turned[a] ^ turned[b]) == odd
    return Colouring(part, turned, agrees)


def _colour_twisted(start: int, n: int, a: Ints, b: Ints, odd: Bools, turned: Bools) -> None:
    """Colour, in place, one part that has no colouring along its breadth-first tree."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    _, first = np.unique(low * np.int64(n) + high, return_index=True)
    first = first[low[first] != high[first]]
    sign = np.where(odd[first], 2, 1)
    table = coo_matrix((sign, (low[first], high[first])), shape=(n, n)).tocsr()
    table = table + table.T
    order, before = breadth_first_order(table, start, directed=False)
    ahead = order[1:]
    flips = np.asarray(table[before[ahead], ahead]).reshape(-1) == 2
    turned[start] = False
    for node, flip in zip(ahead.tolist(), flips.tolist(), strict=True):
        turned[node] = turned[before[node]] ^ flip


class Sides:
    """Parts that are joined one pair after another, each with its side: union-find with parity."""

    def __init__(self, n: int) -> None:
        self._parent = list(range(n))
        self._odd = [False] * n

    def find(self, x: int) -> tuple[int, bool]:
        """Root of x, and whether x is turned over against it."""
        path = []
        while self._parent[x] != x:
            path.append(x)
            x = self._parent[x]
        odd = False
        for y in reversed(path):
            odd ^= self._odd[y]
            self._parent[y], self._odd[y] = x, odd
        return x, odd

    def join(self, x: int, y: int, odd: bool) -> bool:
        """Make x and y one, turned against each other if `odd`; False if that contradicts."""
        (rx, ox), (ry, oy) = self.find(x), self.find(y)
        if rx == ry:
            return (ox ^ oy) == odd
        low, high = min(rx, ry), max(rx, ry)
        self._parent[high] = low
        self._odd[high] = ox ^ oy ^ odd
        return True
