"""Editing an embedded graph given as darts: unfold it, and read off its faces.

``turn`` goes counter-clockwise around a point, ``across`` to the other end of the arc; the face to
the left of dart d continues with the dart clockwise-next to ``across[d]``. All edits keep the
topology of the surface as long as faces are disks.

A point at which the map turns over has sign -1, and so have its darts. Around any point the
direction of the darts in the map goes on by a quarter turn from one positive dart to the next, and
back by one between negative ones. Arcs between darts of unlike sign have no length in the map.
They are contracted; then neighbouring darts of unlike sign leave one point in the same direction
of the map, to one and the same grid point: they are taken off the point and joined to a single
arc, which again has no length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.quad.isolines import IsolineGraph

__all__ = ["Darts", "face_orbits"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(eq=False)
class Darts:
    """An embedded graph that is edited in place; arrays as in ``IsolineGraph``."""

    point: Ints
    turn: Ints
    across: Ints
    outer: Bools
    sign: Ints
    rim: Bools
    """(p,) points on the boundary; two of them are never contracted into one across the inside."""
    pinned: Bools
    """(p,) points on the boundary that stay."""
    keep: Ints
    """(p,) which of two contracted points stays: the one of higher value."""
    back: Ints
    """Inverse of ``turn``."""
    alive: Bools

    def __init__(self, graph: IsolineGraph, corner: Bools) -> None:
        self.point, self.turn = graph.point.copy(), graph.turn.copy()
        self.across, self.outer, self.sign = graph.across.copy(), graph.outer, graph.sign
        self.rim, self.pinned = corner | (graph.halfedge >= 0), corner
        positive = np.zeros(len(corner), dtype=bool)
        positive[graph.point[graph.sign > 0]] = True
        self.keep = np.select([corner, self.rim, graph.vertex >= 0, positive], [4, 3, 2, 1], 0)
        self.back = np.zeros_like(self.turn)
        self.back[self.turn] = np.arange(len(self.turn))
        self.alive = np.ones(len(self.turn), dtype=bool)

    # ---- edits ----------------------------------------------------------------------------

    def after(self, d: int) -> int:
        """The next dart of the face to the left of d."""
        return int(self.back[self.across[d]])

    def drop(self, d: int) -> list[int]:
        """Delete the arc of d; darts whose faces changed."""
        e = int(self.across[d])
        touched = []
        for a in (d, e):
            before, behind = int(self.back[a]), int(self.turn[a])
            self._chain(before, behind)
            touched += [before, behind]
        self.alive[[d, e]] = False
        return touched

    def contract(self, d: int) -> list[int]:
        """Join the two ends of the arc of d, different points, into one; darts to look at again."""
        e = int(self.across[d])
        stay, go = int(self.point[d]), int(self.point[e])
        if self.keep[go] > self.keep[stay]:
            stay, go = go, stay
            a = d
        else:
            a = e
        walk = int(self.turn[a])
        while walk != a:
            self.point[walk] = stay
            walk = int(self.turn[walk])
        p, n, q, m = (int(i) for i in (self.back[d], self.turn[d], self.back[e], self.turn[e]))
        # Clockwise before d comes what follows e, and the other way round.
        if p == d and q == e:
            pass
        elif p == d:
            self._chain(q, m)
        elif q == e:
            self._chain(p, n)
        else:
            self._chain(p, m)
            self._chain(q, n)
        self.alive[[d, e]] = False
        return [p, n, q, m]

    def _chain(self, a: int, b: int) -> None:
        self.turn[a], self.back[b] = b, a

    def pull(self, d: int, n: int) -> list[int]:
        """Take darts d and n = turn[d] off their point, joining their far ends to one arc."""
        before, behind = int(self.back[d]), int(self.turn[n])
        e, f = int(self.across[d]), int(self.across[n])
        self._chain(before, behind)
        self.across[e], self.across[f] = f, e
        self.alive[[d, n]] = False
        return [before, behind, e, f]

    # ---- unfolding ------------------------------------------------------------------------

    def unfold(self) -> int:
        """Undo folds as far as they can be; the number of arcs contracted.

        Besides, arcs that dangle or bound a monogon are dropped, and in the end one of two arcs
        around a bigon.
        """
        contracted = 0
        unlike = (self.sign != self.sign[self.across]) | (self.sign != self.sign[self.turn])
        seen = np.flatnonzero(unlike).tolist()
        last_resort = False
        while True:
            # An edit may free another one far away: go over all places again until nothing moves.
            later = [d for d in dict.fromkeys(seen) if self.alive[d]]
            work: list[int] = []
            seen, edits = list(later), 0
            while work or later:
                d = work.pop() if work else later.pop()
                if not self.alive[d]:
                    continue
                if self._is_empty(d):
                    touched = self.contract(d)
                    contracted += 1
                else:
                    touched = self._tidy(d) or (self._drop_bigon(d) if last_resort else [])
                edits += len(touched)
                later += touched
                seen += touched
                work += [t for t in touched if self.alive[t] and self._is_empty(t)]
            if edits == 0 and last_resort:
                return contracted
            last_resort = last_resort or edits == 0

    def _is_empty(self, d: int) -> bool:
        """Whether the arc of d has no length, joins two points, and may be contracted."""
        e = self.across[d]
        a, b = self.point[d], self.point[e]
        if self.sign[d] == self.sign[e] or a == b:
            return False
        return bool(not (self.rim[a] and self.rim[b]) or self.outer[d] or self.outer[e])

    def _tidy(self, d: int) -> list[int]:
        """One edit at dart d if one is due; darts to look at again."""
        e = int(self.across[d])
        if self._on_rim(d):
            return self._tidy_rim(e if self.outer[d] else d) or self._tidy_rim(self.after(d))
        if self.turn[d] == d or self.turn[e] == e or self.after(d) == d or self.after(e) == e:
            return self.drop(d)
        for a, b in ((d, int(self.turn[d])), (int(self.back[d]), d)):
            if (
                self.sign[a] != self.sign[b]
                and not self._on_rim(a)
                and not self._on_rim(b)
                and self.across[a] != b
                and not self._one_face(a, b)
            ):
                return self.pull(a, b)
        return []

    def _tidy_rim(self, ahead: int) -> list[int]:
        """Shorten the boundary where it runs on and back, at the point from which a dart leaves."""
        behind = int(self.turn[ahead])
        if (
            not self.outer[self.across[ahead]]
            or not self.outer[behind]
            or self.sign[ahead] == self.sign[behind]
            or self.across[ahead] == behind
            or self.pinned[self.point[ahead]]
        ):
            return []
        return self.pull(ahead, behind)

    def _drop_bigon(self, d: int) -> list[int]:
        """Drop the arc of d, or the other one if d is on the boundary, where the two are alike."""
        for f in (d, int(self.across[d])):
            other = self.after(f)
            if self.outer[f] or other == self.across[f] or self.after(other) != f:
                continue
            gone, stays = (other, f) if self._on_rim(f) else (f, other)
            if not self._on_rim(gone):
                return [*self.drop(gone), stays]
        return []

    def _one_face(self, a: int, b: int) -> bool:
        """Whether the faces before a and after b = turn[a] are one, the point having more darts."""
        end = int(self.back[a])
        if end == b:
            return False
        walk = self.after(b)
        while walk not in (b, end):
            walk = self.after(walk)
        return walk == end

    def _on_rim(self, d: int) -> bool:
        return bool(self.outer[d] or self.outer[self.across[d]])


def face_orbits(turn: Ints, across: Ints, alive: Bools) -> tuple[Ints, Ints]:
    """Darts of each face, face after face, and the first place of each face (one more at the end).

    Faces start at their lowest dart, in the order of these.
    """
    back = np.zeros_like(turn)
    darts = np.flatnonzero(alive)
    back[turn[darts]] = darts
    after = np.where(alive, back[across], -1)
    # Rounds of pointer doubling find the lowest dart of each orbit.
    low, jump = np.arange(len(turn)), after.copy()
    while darts.size:
        fresh = np.minimum(low[darts], low[jump[darts]])
        if np.array_equal(fresh, low[darts]):
            break
        low[darts], jump[darts] = fresh, jump[jump[darts]]
    first = darts[low[darts] == darts]
    rank = np.zeros(len(turn), dtype=np.int64)
    walk, home, step = after[first], first, 0
    while walk.size:
        go = walk != home
        walk, home = walk[go], home[go]
        step += 1
        rank[walk] = step
        walk = after[walk]
    order = darts[np.lexsort((rank[darts], low[darts]))]
    if len(order) == 0:
        return order, np.zeros(1, dtype=np.int64)
    opens = np.flatnonzero(np.append(True, low[order][1:] != low[order][:-1]))
    return order, np.append(opens, len(order)).astype(np.int64)
