"""Integer arc lengths: as close to the wanted ones as a valid quad mesh allows.

Minimise ``sum_a w_a (n_a - s l_a)^2`` over integers ``n_a >= 0`` such that opposite sides of every
patch agree and nothing falls together that must stay apart (Campen, Bommes & Kobbelt 2015; Lyon,
Campen & Kobbelt 2021). The square is linear between integers, so this is a linear program; its
solution is almost always half-integral (Heistermann, Warnett & Bommes 2023), and a small integer
program around it finishes. Conditions of separation are added when they are found violated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_matrix, csr_matrix, hstack, identity

from vhquad.errors import ParametrizationError
from vhquad.quad.layout import Layout, build_layout
from vhquad.quad.separation import Condition, loop_conditions, separation_conditions
from vhquad.quad.tmesh import TMesh

__all__ = ["Quantisation", "quantise"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COUNT_TOLERANCE = 0.03  # stop adjusting the scale once the count is this near
MOST_SCALES = 6
MOST_ROUNDS = 40
MIP_SECONDS = 10.0


@dataclass(frozen=True, eq=False)
class Quantisation:
    """The layout chosen, the scale it was made for and how many conditions it needed."""

    layout: Layout
    scale: float
    conditions: int
    rounds: int


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
    best: tuple[float, Quantisation] | None = None
    conditions: dict[Condition, None] = {}
    tried: list[tuple[float, float]] = []
    for _ in range(MOST_SCALES):
        result = _separated(program, scale, conditions)
        count = len(result.layout.quads)
        miss = abs(np.log(count / target_quads))
        if best is None or miss < best[0]:
            best = (miss, result)
        if miss <= np.log1p(COUNT_TOLERANCE):
            break
        tried.append((np.log(scale), np.log(count / target_quads)))
        following = _next_scale(tried)
        if any(abs(following - s) < 1e-3 for s, _ in tried):
            break
        scale = float(np.exp(following))
    assert best is not None
    return best[1]


def _next_scale(tried: list[tuple[float, float]]) -> float:
    """Log of the next scale: between bracketing tries, else by the slope of two."""
    below = [t for t in tried if t[1] < 0]
    above = [t for t in tried if t[1] > 0]
    if below and above:
        (s0, m0), (s1, m1) = max(below, key=lambda t: t[1]), min(above, key=lambda t: t[1])
        return s0 + (s1 - s0) * min(max(-m0 / (m1 - m0), 0.15), 0.85)
    scale, miss = min(tried, key=lambda t: abs(t[1]))
    return scale - 0.6 * miss


class _Program:
    """The part of the program that does not depend on the scale."""

    def __init__(self, tmesh: TMesh) -> None:
        self.tmesh = tmesh
        rows, cols, values = [], [], []
        row = 0
        for patch in tmesh.patches:
            for i in (0, 1):
                for side, sign in ((patch.sides[i], 1), (patch.sides[i + 2], -1)):
                    for h in side:
                        rows.append(row)
                        cols.append(h >> 1)
                        values.append(sign)
                row += 1
        size = len(tmesh.arcs)
        self.sides = coo_matrix((values, (rows, cols)), shape=(row, size)).tocsr()
        self.lengths = tmesh.lengths
        across = np.zeros(size)  # mean extent, across each arc, of its two patches
        for patch in tmesh.patches:
            extent = [sum(self.lengths[h >> 1] for h in side) for side in patch.sides]
            for i in range(4):
                for h in patch.sides[i]:
                    across[h >> 1] += 0.5 * extent[(i + 1) % 4]
        self.across = across

    def solve(self, wanted: Floats, conditions: list[Condition]) -> Ints:
        """Best integer lengths under the conditions."""
        size = len(wanted)
        scale = wanted.sum() / self.lengths.sum()
        weight = (self.across * scale + 0.1) / np.maximum(wanted, 0.5)
        base = np.floor(wanted)
        rest = wanted - base
        # Cost of the first and of each further step up and down from the floor.
        up = [(1 - rest) ** 2 - rest**2, (2 - rest) ** 2 - (1 - rest) ** 2]
        down = [(1 + rest) ** 2 - rest**2, (2 + rest) ** 2 - (1 + rest) ** 2]
        cost = np.concatenate([np.zeros(size), *(weight * step for step in (*up, *down))])
        one = identity(size, format="csr")
        nothing = csr_matrix((self.sides.shape[0], 4 * size))
        constraints = [
            LinearConstraint(hstack([self.sides, nothing], format="csr"), 0, 0),
            LinearConstraint(hstack([one, -one, -one, one, one], format="csr"), base, base),
        ]
        if conditions:
            rows = np.repeat(np.arange(len(conditions)), [len(c.form) for c in conditions])
            cols = [k for c in conditions for k, _ in c.form]
            values = [v for c in conditions for _, v in c.form]
            form = coo_matrix((values, (rows, cols)), shape=(len(conditions), 5 * size)).tocsr()
            bounds = np.array([c.bound for c in conditions], dtype=np.float64)
            constraints.append(LinearConstraint(form, bounds, np.inf))
        step = np.concatenate([np.ones(size), np.full(size, np.inf)])
        upper = np.concatenate([np.full(size, np.inf), step, step])
        whole = np.concatenate([np.ones(size), np.zeros(4 * size)])
        relaxed = milp(cost, bounds=Bounds(0, upper), constraints=constraints)
        if relaxed.x is None:
            raise ParametrizationError("the arc lengths of the T-mesh contradict each other")
        real = relaxed.x[:size]
        if np.abs(real - np.round(real)).max() < 1e-6:
            return np.round(real).astype(np.int64)
        for slack in (0, 1, 3):
            low = np.concatenate([np.maximum(np.floor(real + 1e-6) - slack, 0), np.zeros(4 * size)])
            high = np.concatenate([np.ceil(real - 1e-6) + slack, upper[size:]])
            near = milp(
                cost,
                integrality=whole,
                bounds=Bounds(low, high),
                constraints=constraints,
                options={"mip_rel_gap": 0.01, "time_limit": MIP_SECONDS},
            )
            if near.x is not None:
                return np.round(near.x[:size]).astype(np.int64)
        raise ParametrizationError("no integer arc lengths were found for the T-mesh")


def _separated(program: _Program, scale: float, conditions: dict[Condition, None]) -> Quantisation:
    """Solve, look for what fell together, add conditions, and solve again until nothing does."""
    wanted = program.lengths * scale
    for number in range(1, MOST_ROUNDS + 1):
        lengths = program.solve(wanted, list(conditions))
        layout = build_layout(program.tmesh, lengths)
        found = separation_conditions(layout, wanted) or loop_conditions(layout, wanted)
        new = [c for c in found if c not in conditions]
        if not found:
            return Quantisation(layout, scale, len(conditions), number)
        if not new:
            break
        conditions.update(dict.fromkeys(new))
    raise ParametrizationError("parts of the surface cannot be kept apart at this density")
