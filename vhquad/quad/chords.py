"""Vertices on curves moved to where the edges between them keep nearest to the curve.

An edge between two vertices of a curve is a chord, and what lies between curve and chord is lost.
Evenly spread vertices pass over the kinks of a polyline and are too few where it bends. Within
some of the way to its neighbours each vertex of a curve has several places to go to, kinks first;
of all choices on the curve at once, dynamic programming (Perez & Vidal 1994) finds the one of the
least area between curve and chords, plus a price for uneven steps and long moves.

The squared distance of a curve x(s) to the chord from x(a) in the unit direction d, integrated over
s, is ``tr(Y) - d . Y d`` with ``Y = int (x - x(a)) (x - x(a))^T ds``; integrals of x and x x^T from
the curve's start give it for any two ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.quad.curves import CurveConstraints

__all__ = ["Polyline", "fit_chords"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ROUNDS = 4  # each moves a vertex by at most WINDOW of the way to its neighbours
WINDOW = 0.35
PLACES = 15  # of a vertex, its own in the middle
UNEVEN = 0.1  # price of a step that changes by its length, in squared steps
MOVED = 0.02  # price of a move by a step


class Polyline:
    """A curve by arc length, with the integrals that tell how far it is from a chord.

    Parameters
    ----------
    points : (p, 3) float64
        In order; a closed curve ends at its first point, and may go round several times.
    """

    def __init__(self, points: Floats) -> None:
        points = points - points.mean(axis=0)  # small numbers: the integrals lose no digits
        step = np.diff(points, axis=0)
        length = np.linalg.norm(step, axis=1)
        keep = length > 0
        self.points = np.concatenate([points[:1], points[1:][keep]])
        self.direction = step[keep] / length[keep, None]
        self.arc = np.concatenate([[0.0], np.cumsum(length[keep])])
        p, d, t = self.points[:-1], self.direction, length[keep][:, None]
        first = p * t + d * t**2 / 2
        self.first = np.concatenate([np.zeros((1, 3)), np.cumsum(first, axis=0)])
        second = self._second(p, d, t[..., None])
        self.second = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(second, axis=0)])

    @staticmethod
    def _second(p: Floats, d: Floats, t: Floats) -> Floats:
        """Integrals of x x^T over the first t of segments from p along d; (..., 3, 3)."""
        pp, pd = p[..., :, None] * p[..., None, :], p[..., :, None] * d[..., None, :]
        dd = d[..., :, None] * d[..., None, :]
        return np.asarray(pp * t + (pd + np.swapaxes(pd, -1, -2)) * t**2 / 2 + dd * t**3 / 3)

    def at(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """Points at arc lengths, and the integrals of x and x x^T from the start to them."""
        k = np.clip(np.searchsorted(self.arc, s, side="right") - 1, 0, len(self.direction) - 1)
        p, d, t = self.points[k], self.direction[k], (s - self.arc[k])[..., None]
        first = self.first[k] + p * t + d * t**2 / 2
        return p + d * t, first, self.second[k] + self._second(p, d, t[..., None])

    def off(self, a: Floats, b: Floats) -> Floats:
        """Area between the curve and its chords from a to b, from the root mean square distance.

        Parameters
        ----------
        a, b : (..., i) and (..., j) float64
            Arc lengths, a below b.

        Returns
        -------
        (..., i, j) float64
        """
        xa, fa, sa = (np.expand_dims(values, a.ndim) for values in self.at(a))
        xb, fb, sb = (np.expand_dims(values, a.ndim - 1) for values in self.at(b))
        length = (b[..., None, :] - a[..., :, None])[..., None]
        chord = xb - xa
        span = np.linalg.norm(chord, axis=-1, keepdims=True)
        d = np.divide(chord, span, out=np.zeros_like(chord), where=span > 0)
        first, second = fb - fa, sb - sa
        whole = np.trace(second, axis1=-2, axis2=-1) - 2 * (xa * first).sum(axis=-1)
        whole += ((xa**2).sum(axis=-1, keepdims=True) * length)[..., 0]
        along, start = np.einsum("...i,...ij,...j->...", d, second, d), (d * xa).sum(axis=-1)
        along += start**2 * length[..., 0] - 2 * start * (d * first).sum(axis=-1)
        return np.asarray(np.sqrt(np.maximum(whole - along, 0.0) * length[..., 0]))

    def places(self, s: Floats, low: Floats, high: Floats) -> Floats:
        """Places for vertices at s between low and high, on kinks where one is near; (q, k)."""
        half = np.arange(1, PLACES // 2 + 1) / (PLACES // 2)
        below = s[:, None] - half[::-1] * (s - low)[:, None]
        above = s[:, None] + half * (high - s)[:, None]
        grid = np.concatenate([below, s[:, None], above], axis=1)
        k = np.clip(np.searchsorted(self.arc, grid), 1, len(self.arc) - 1)
        left, right = self.arc[k - 1], self.arc[k]
        kink = np.where(grid - left < right - grid, left, right)
        step = np.concatenate([s - low, high - s]).reshape(2, -1).max(axis=0) / (PLACES // 2)
        near = np.abs(kink - grid) <= 0.5 * step[:, None]
        near &= (kink >= low[:, None]) & (kink <= high[:, None])
        near[:, PLACES // 2] = False  # it may stay
        return np.asarray(np.where(near, kink, grid))


@dataclass(frozen=True)
class _Chain:
    """Vertices between two ends that stay: arc lengths before anything moved, ends included.

    ``free`` says which vertices between the ends may move.
    """

    line: Polyline
    start: Floats
    free: Bools

    def fitted(self, s: Floats) -> Floats:
        """One round: the best choice of places, all vertices at once."""
        gap = np.diff(s)
        reach = WINDOW * self.free
        low, high = s[1:-1] - reach * gap[:-1], s[1:-1] + reach * gap[1:]
        # All in all by half a step: the sizes along the curve are not for chords to decide.
        gap = 0.5 * np.diff(self.start)
        low = np.maximum(low, self.start[1:-1] - gap[:-1])
        high = np.minimum(high, self.start[1:-1] + gap[1:])
        grid = self.line.places(s[1:-1], low, high)
        ends = np.repeat(s[[0, -1]][:, None], PLACES, axis=1)
        grid = np.concatenate([ends[:1], grid, ends[1:]])
        # In units of each step as it was: on a circle the steps that sizes ask for then stay.
        unit = np.diff(self.start)[:, None, None]
        price = self.line.off(grid[:-1], grid[1:]) / unit**2
        step = grid[1:, None, :] - grid[:-1, :, None]
        price += UNEVEN * (step / unit - 1) ** 2
        price += MOVED * ((grid[1:] - self.start[1:, None])[:, None, :] / unit) ** 2
        least, before = np.zeros(PLACES), []
        for cost in price:
            total = least[:, None] + cost
            before.append(total.argmin(axis=0))
            least = total.min(axis=0)
        choice = [int(least.argmin())]
        for back in reversed(before):
            choice.append(int(back[choice[-1]]))
        return np.asarray(grid[np.arange(len(grid)), choice[::-1]])

    def best(self, s: Floats) -> Floats:
        """Arc lengths after all rounds."""
        for _ in range(ROUNDS):
            last, s = s, self.fitted(s)
            if np.array_equal(s, last):
                break
        return s


def fit_chords(
    curves: CurveConstraints, vertices: Ints, arc: Floats, free: Bools | None = None
) -> Floats:
    """Better arc lengths for vertices that slide on curves; the ends of open curves stay.

    Parameters
    ----------
    curves : CurveConstraints
    vertices : (q,) int64
        All that slide, on any curve.
    arc : (q,) float64
        Their arc lengths.
    free : (q,) bool, optional
        Those that may move. Default: all.

    Returns
    -------
    (q,) float64
    """
    out = arc.copy()
    may = np.ones(len(arc), dtype=bool) if free is None else free
    for c in np.unique(curves.curve[vertices]):  # curves are few
        own = np.flatnonzero(curves.curve[vertices] == c)
        own = own[np.argsort(arc[own], kind="stable")]
        points = curves.points[curves.start[c] : curves.start[c + 1]]
        first, last = curves.arc[curves.start[c]], curves.arc[curves.start[c + 1] - 1]
        s = arc[own] - first
        if not curves.closed[c]:
            s = np.concatenate([[0.0], s, [last - first]])
            if (np.diff(s) > 0).all():
                out[own] = first + _Chain(Polyline(points), s, may[own]).best(s)[1:-1]
        elif len(own) > 2 and (np.diff(s) > 0).all():
            # Twice round, from one vertex that stays and then from the one opposite.
            line, total = Polyline(np.concatenate([points, points[1:]])), last - first
            given = s
            for turn in (0, len(own) // 2):
                s, start = (_unrolled(a, turn, total) for a in (s, given))
                shift = np.rint((start[0] - s[0]) / total) * total
                chain = _Chain(line, start - shift, np.roll(may[own], -turn)[1:])
                s = np.roll(np.mod(chain.best(s)[:-1], total), turn)
            out[own] = first + s
    return out


def _unrolled(s: Floats, turn: int, total: float) -> Floats:
    """Arc lengths once round a closed curve from one vertex to itself, rising."""
    s = np.roll(s, -turn)
    s = np.append(s[0] + np.mod(s - s[0], total), s[0] + total)
    return np.asarray(s)
