"""Integer arc lengths: as close to the wanted ones as a valid quad mesh allows.

Minimise ``sum_a w_a (n_a - s l_a)^2`` over integers ``n_a >= 0`` such that opposite sides of every
patch agree and nothing falls together that must stay apart (Campen, Bommes & Kobbelt 2015; Lyon,
Campen & Kobbelt 2021). The square is linear between integers, so this is a linear program; its
solution is almost always half-integral (Heistermann, Warnett & Bommes 2023), and a small integer
program around it finishes. Conditions of separation are added when they are found violated. Where
many arcs would round up all at once and the count jumps past the wanted one, a condition on the
count itself makes some of them grow.
"""

from __future__ import annotations

from dataclasses import dataclass

import highspy
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, hstack
from scipy.sparse.csgraph import connected_components

from vhquad.errors import ParametrizationError
from vhquad.quad.highs import silent_solver
from vhquad.quad.layout import Layout, build_layout, side_length
from vhquad.quad.separation import Condition, loop_conditions, separation_conditions
from vhquad.quad.tmesh import TMesh

__all__ = ["Quantisation", "quantise"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COUNT_TOLERANCE = 0.03  # stop adjusting the scale once the count is this near
MOST_SCALES = 6
MOST_BUDGETS = 3
HOPELESS = np.log(1.5)  # surplus after two tries at which smaller scales are not worth a third
MOST_ROUNDS = 40
MOST_DIVES = 60
MIP_SECONDS = 20.0


@dataclass(frozen=True, eq=False)
class Quantisation:
    """The layout chosen, the scale it was made for and how many conditions it needed."""

    layout: Layout
    scale: float
    conditions: int
    rounds: int

    @property
    def n_quads(self) -> int:
        """Quads of the layout."""
        return len(self.layout.quads)


def quantise(tmesh: TMesh, target_quads: float, area: float) -> Quantisation:
    """Choose integer arc lengths for a wanted number of quads.

    Parameters
    ----------
    tmesh : TMesh
    target_quads : float
        Wanted number of quads; the scale is adjusted until the count is within 3 % or stops
        improving.
    area : float
        Parametric area of the T-mesh, which sets the first scale.

    Raises
    ------
    ParametrizationError
        If no valid layout is found.
    """
    program = _Program(tmesh)
    scale = float(np.sqrt(target_quads / area))
    conditions: dict[Condition, None] = {}
    results: list[Quantisation] = []
    tried: list[tuple[float, float]] = []
    for _ in range(MOST_SCALES):
        results.append(_separated(program, scale, conditions))
        tried.append((np.log(scale), np.log(results[-1].n_quads / target_quads)))
        if abs(tried[-1][1]) <= np.log1p(COUNT_TOLERANCE):
            return results[-1]
        if len(tried) == 2 and min(m for _, m in tried) > HOPELESS:
            break  # what must stay apart takes more quads than that
        following = _next_scale(tried)
        if any(abs(following - s) < 1e-3 for s, _ in tried):
            break
        scale = float(np.exp(following))
    results += _between(program, results, target_quads, conditions)
    return min(results, key=lambda r: abs(np.log(r.n_quads / target_quads)))


def _between(
    program: _Program,
    results: list[Quantisation],
    target: float,
    conditions: dict[Condition, None],
) -> list[Quantisation]:
    """More results, from the largest with too few quads: the count is asked for as a condition.

    Between two results the count changes by ``sum_p (h dw + w dh)``, exactly so with the means of
    the two of each patch's width and height; that is linear in the arc lengths.
    """
    fewer = [r for r in results if r.n_quads < target]
    more = [r for r in results if r.n_quads > target]
    made: list[Quantisation] = []
    while fewer and more and len(made) < MOST_BUDGETS:
        low = max(fewer, key=lambda r: r.n_quads)
        high = min(more, key=lambda r: r.n_quads)
        if min(abs(np.log(r.n_quads / target)) for r in (low, high)) <= np.log1p(COUNT_TOLERANCE):
            break
        form = _count_form(program.tmesh, low.layout.lengths + high.layout.lengths)
        have = sum(factor * int(low.layout.lengths[arc]) for arc, factor in form)
        # Conditions are whole: everything is counted four times.
        budget = Condition(form, have + int(4 * (target - low.n_quads)))
        program.add([budget])
        try:
            made.append(_separated(program, low.scale, conditions))
        except ParametrizationError:
            break  # the lengths in between are not to be had
        if not low.n_quads < made[-1].n_quads < high.n_quads:
            break
        (fewer if made[-1].n_quads < target else more).append(made[-1])
    return made


def _count_form(tmesh: TMesh, lengths: Ints) -> tuple[tuple[int, int], ...]:
    """Four times the derivative of the number of quads at half of the lengths, as a form."""
    factor = np.zeros(len(tmesh.arcs), dtype=np.int64)
    for patch in tmesh.patches:
        for i, side in enumerate(patch.sides):
            across = side_length(lengths, patch.sides[(i + 1) % 4])
            for half in side:
                factor[half >> 1] += across
    return tuple((int(arc), int(factor[arc])) for arc in np.flatnonzero(factor))


def _next_scale(tried: list[tuple[float, float]]) -> float:
    """Log of the next scale: between bracketing tries, else beyond the last, ever further."""
    below = [t for t in tried if t[1] < 0]
    above = [t for t in tried if t[1] > 0]
    if below and above:
        (s0, m0), (s1, m1) = max(below, key=lambda t: t[1]), min(above, key=lambda t: t[1])
        return s0 + (s1 - s0) * min(max(-m0 / (m1 - m0), 0.15), 0.85)
    scale, miss = max(tried) if below else min(tried)
    return scale - 0.6 * miss * 1.5 ** (len(tried) - 1)


class _Program:
    """The linear program of a T-mesh, kept warm between solves.

    An arc's length is ``base + up_1 + up_2 - down_1 - down_2`` with ``base`` the wanted length
    rounded down; the first steps are bounded by one quad, and convexity fills them in order.
    """

    def __init__(self, tmesh: TMesh) -> None:
        self.tmesh = tmesh
        self.lengths = tmesh.lengths
        self.size = len(tmesh.arcs)
        rows, cols, values = [], [], []
        row = 0
        across = np.zeros(self.size)  # mean extent, across each arc, of its two patches
        for patch in tmesh.patches:
            extent = [sum(self.lengths[h >> 1] for h in side) for side in patch.sides]
            for i in range(4):
                for h in patch.sides[i]:
                    across[h >> 1] += 0.5 * extent[(i + 1) % 4]
            for i in (0, 1):
                for side, sign in ((patch.sides[i], 1), (patch.sides[i + 2], -1)):
                    for h in side:
                        rows.append(row)
                        cols.append(h >> 1)
                        values.append(sign)
                row += 1
        self.across = across
        shape = (row, self.size)
        places = (np.array(rows), np.array(cols))
        entries = np.array(values, dtype=np.float64)
        self.sides = coo_matrix((entries, places), shape=shape).tocsr()
        self.sides.sum_duplicates()
        self.known: list[Condition] = []
        self.solver = silent_solver()
        self.wanted = self.lengths
        self.base = np.floor(self.wanted)
        self._load()

    def _load(self) -> None:
        full = _steps(self.sides)
        lp = highspy.HighsLp()
        lp.num_col_, lp.num_row_ = full.shape[1], full.shape[0]
        lp.col_cost_ = np.zeros(full.shape[1])
        lp.col_lower_ = np.zeros(full.shape[1])
        lp.col_upper_ = np.full(full.shape[1], highspy.kHighsInf)
        lp.row_lower_ = np.zeros(full.shape[0])
        lp.row_upper_ = np.zeros(full.shape[0])
        lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
        lp.a_matrix_.start_ = full.indptr
        lp.a_matrix_.index_ = full.indices
        lp.a_matrix_.value_ = full.data
        self.solver.passModel(lp)

    def rescale(self, wanted: Floats) -> None:
        """Set the wanted arc lengths."""
        self.wanted = wanted
        base = np.floor(wanted)
        self.base = base
        rest = wanted - base
        scale = wanted.sum() / self.lengths.sum()
        weight = (self.across * scale + 0.1) / np.maximum(wanted, 0.5)
        # Cost of the first and of each further step up and down from the base.
        steps = [
            (1 - rest) ** 2 - rest**2,
            (2 - rest) ** 2 - (1 - rest) ** 2,
            (1 + rest) ** 2 - rest**2,
            (2 + rest) ** 2 - (1 + rest) ** 2,
        ]
        cost = np.concatenate([weight * step for step in steps])
        columns = np.arange(len(cost), dtype=np.int32)
        self.solver.changeColsCost(len(cost), columns, cost)
        self._bound(np.zeros(self.size), np.full(self.size, np.inf))
        right = -np.asarray(self.sides @ base)
        for row in range(len(right)):
            self.solver.changeRowBounds(row, float(right[row]), float(right[row]))
        for number, condition in enumerate(self.known):
            self.solver.changeRowBounds(
                self.sides.shape[0] + number, self._bound_of(condition), highspy.kHighsInf
            )

    def _bound_of(self, condition: Condition) -> float:
        return condition.bound - float(sum(c * self.base[k] for k, c in condition.form))

    def add(self, conditions: list[Condition]) -> None:
        """Add conditions for this and all later scales."""
        for condition in conditions:
            arcs = np.array([k for k, _ in condition.form])
            factors = np.array([c for _, c in condition.form], dtype=np.float64)
            index = np.concatenate([arcs + part * self.size for part in range(4)])
            value = np.concatenate([factors, factors, -factors, -factors])
            self.solver.addRow(
                self._bound_of(condition),
                highspy.kHighsInf,
                len(index),
                index.astype(np.int32),
                value,
            )
            self.known.append(condition)

    def _bound(self, low: Floats, high: Floats, arcs: Ints | None = None) -> None:
        """Bounds on the lengths of some arcs (all by default)."""
        arcs = np.arange(self.size) if arcs is None else arcs
        base = self.base[arcs]
        above, below = np.maximum(high - base, 0), np.maximum(base - low, 0)
        least_up, least_down = np.maximum(low - base, 0), np.maximum(base - high, 0)
        lower = [
            np.minimum(least_up, 1),
            np.maximum(least_up - 1, 0),
            np.minimum(least_down, 1),
            np.maximum(least_down - 1, 0),
        ]
        upper = [
            np.minimum(above, 1),
            np.maximum(above - 1, 0),
            np.minimum(below, 1),
            np.maximum(below - 1, 0),
        ]
        columns = np.concatenate([arcs + part * self.size for part in range(4)]).astype(np.int32)
        self.solver.changeColsBounds(
            len(columns), columns, np.concatenate(lower), np.concatenate(upper)
        )

    def _run(self) -> Floats | None:
        self.solver.run()
        if self.solver.getModelStatus() not in (
            highspy.HighsModelStatus.kOptimal,
            highspy.HighsModelStatus.kTimeLimit,
        ):
            return None
        x = np.array(self.solver.getSolution().col_value).reshape(4, self.size)
        return np.asarray(self.base + x[0] + x[1] - x[2] - x[3])

    def solve(self) -> Ints:
        """Best integer lengths found under the conditions.

        By rounding towards the wanted lengths; where conditions then cannot be met any more, up,
        which most of them ask for; else by the integer program.
        """
        real = self._run()
        if real is None:
            raise ParametrizationError("the arc lengths of the T-mesh contradict each other")
        for up in (False, True):
            whole = self._rounded(real, up)
            self._bound(np.zeros(self.size), np.full(self.size, np.inf))
            if whole is not None:
                return whole
        return self._search()

    def _rounded(self, real: Floats, up: bool) -> Ints | None:
        """Integer lengths near real ones, or None; leaves bounds on the lengths.

        Lengths that come out fractional hang together in chains; one of each chain is rounded and
        the program solved again, until all are whole.
        """
        for _ in range(MOST_DIVES):
            off = np.abs(real - np.round(real)) > 1e-6
            if not off.any():
                return np.round(real).astype(np.int64)
            pick = self._one_a_chain(off)
            for batch in (pick, pick[:1]):
                # A half can go either way.
                down = (self.wanted[batch] < real[batch]) & (not up)
                value = np.where(down, np.floor(real[batch]), np.ceil(real[batch]))
                self._bound(value, value, batch)
                following = self._run()
                if following is not None:
                    break
                self._bound(np.zeros(len(batch)), np.full(len(batch), np.inf), batch)
            else:
                other = np.floor(real[batch]) + np.ceil(real[batch]) - value
                self._bound(other, other, batch)
                following = self._run()
                if following is None:
                    return None
            real = following
        return None

    def _one_a_chain(self, off: NDArray[np.bool_]) -> Ints:
        """The weightiest fractional arc of each chain of fractional arcs."""
        row = np.repeat(np.arange(self.sides.shape[0]), np.diff(self.sides.indptr))
        col = self.sides.indices
        keep = off[col]
        graph = coo_matrix(
            (np.ones(int(keep.sum())), (row[keep], self.sides.shape[0] + col[keep])),
            shape=(self.sides.shape[0] + self.size,) * 2,
        )
        label = connected_components(graph, directed=False)[1][self.sides.shape[0] :]
        arcs = np.flatnonzero(off)
        order = arcs[np.lexsort((arcs, -self.across[arcs]))]
        return order[np.unique(label[order], return_index=True)[1]]

    def _search(self) -> Ints:
        """The integer program itself: slow, and seldom needed."""
        columns = np.arange(4 * self.size, dtype=np.int32)
        kinds = np.full(4 * self.size, highspy.HighsVarType.kInteger)
        self.solver.changeColsIntegrality(len(columns), columns, kinds)
        self.solver.setOptionValue("time_limit", self.solver.getRunTime() + MIP_SECONDS)
        self.solver.setOptionValue("mip_rel_gap", 0.02)
        real = self._run()
        self.solver.setOptionValue("time_limit", highspy.kHighsInf)
        kinds = np.full(4 * self.size, highspy.HighsVarType.kContinuous)
        self.solver.changeColsIntegrality(len(columns), columns, kinds)
        if real is None or np.abs(real - np.round(real)).max() > 1e-5:
            raise ParametrizationError("no integer arc lengths were found for the T-mesh")
        return np.round(real).astype(np.int64)


def _steps(rows: csr_matrix) -> csr_matrix:
    """Rows over arcs as rows over their steps: two up, two down."""
    return hstack([rows, rows, -rows, -rows], format="csr")


def _separated(program: _Program, scale: float, conditions: dict[Condition, None]) -> Quantisation:
    """Solve, look for what fell together, add conditions, and solve again until nothing does."""
    wanted = program.lengths * scale
    program.rescale(wanted)
    for number in range(1, MOST_ROUNDS + 1):
        lengths = program.solve()
        layout = build_layout(program.tmesh, lengths)
        found = separation_conditions(layout, wanted) or loop_conditions(layout, wanted)
        new = [c for c in found if c not in conditions]
        if not found:
            return Quantisation(layout, scale, len(conditions), number)
        if not new:
            break
        conditions.update(dict.fromkeys(new))
        program.add(new)
    raise ParametrizationError("parts of the surface cannot be kept apart at this density")
