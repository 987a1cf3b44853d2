"""Exact elimination of linear links between the coordinates of a seamless map.

Coordinates of the wedges are linked in pairs, ``x_b = +-x_a + t``, by the transitions across the
cut and by the features. A spanning forest over the links leaves one free coordinate a tree; every
link off the forest is a relation between free coordinates and shifts t, and these few relations
are solved in rational arithmetic.
"""

from __future__ import annotations

from collections import deque
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

__all__ = ["Link", "eliminate"]

Link = tuple[int, int, int, int]
"""(a, b, sign, t): scalar b = sign * scalar a + shift t; t < 0: no shift."""

_Number = int | Fraction  # whole numbers, nearly all, stay ints: ten times as fast
_Row = dict[int, _Number]


def eliminate(
    n_scalars: int, links: list[Link]
) -> tuple[csr_matrix, int, NDArray[np.bool_], NDArray[np.bool_]]:
    """Basis of all scalars that satisfy the links.

    Parameters
    ----------
    n_scalars : int
    links : list of Link

    Returns
    -------
    basis : (n_scalars, d) csr_matrix of int64
        The scalars are ``basis @ x / denominator``.
    denominator : int
    plain : (n_scalars,) bool
        Scalars that a link without a shift, that is a feature, ties to another.
    shifts : (d,) bool
        Unknowns of the basis that are shifts.
    """
    adjacency: dict[int, list[int]] = {}
    for number, (a, b, _, _) in enumerate(links):
        adjacency.setdefault(a, []).append(number)
        adjacency.setdefault(b, []).append(number)
    root: dict[int, int] = {}
    sign: dict[int, int] = {}
    shift: dict[int, dict[int, int]] = {}
    in_tree = [False] * len(links)
    plain = np.zeros(n_scalars, dtype=bool)
    for start in adjacency:
        if start in root:
            continue
        root[start], sign[start], shift[start] = start, 1, {}
        queue = deque([start])
        while queue:
            x = queue.popleft()
            for number in adjacency[x]:
                a, b, s, t = links[number]
                y = b if x == a else a
                if y in root:
                    continue
                in_tree[number] = True
                root[y], sign[y] = root[x], sign[x] * s
                if t < 0:
                    shift[y] = {k: s * c for k, c in shift[x].items()}
                elif x == a:  # y = s x + t
                    shift[y] = _plus({k: s * c for k, c in shift[x].items()}, t, 1)
                else:  # x = s y + t, so y = s x - s t
                    shift[y] = _plus({k: s * c for k, c in shift[x].items()}, t, -s)
                queue.append(y)
    for a, b, _, t in links:
        if t < 0:
            plain[a] = plain[b] = True

    # Variables: scalars 0..n_scalars-1, then shifts. Every link off the forest is a relation.
    relations: list[_Row] = []
    for number, (a, b, s, t) in enumerate(links):
        if in_tree[number]:
            continue
        row: dict[int, int] = {}
        for k, c in shift[b].items():
            row = _plus(row, n_scalars + k, c)
        for k, c in shift[a].items():
            row = _plus(row, n_scalars + k, -s * c)
        if t >= 0:
            row = _plus(row, n_scalars + t, -1)
        row = _plus(row, root[b], sign[b] - s * sign[a])
        if row:
            relations.append(dict(row))
    solved = _solve(relations)

    rows: list[int] = []
    cols: list[int] = []
    values: list[_Number] = []
    for x, base in root.items():
        terms: _Row = {}
        _add(terms, solved, base, sign[x])
        for k, c in shift[x].items():
            _add(terms, solved, n_scalars + k, c)
        for k, value in terms.items():
            rows.append(x)
            cols.append(k)
            values.append(value)
    denominator = int(np.lcm.reduce([v.denominator for v in values])) if values else 1
    free = np.setdiff1d(np.arange(n_scalars), np.array(list(root), dtype=np.int64))
    row_index = np.concatenate([free, np.array(rows, dtype=np.int64)])
    col_index = np.concatenate([free, np.array(cols, dtype=np.int64)])
    entry = np.concatenate(
        [
            np.full(len(free), denominator, dtype=np.int64),
            np.array([int(v * denominator) for v in values], dtype=np.int64),
        ]
    )
    used, packed = np.unique(col_index, return_inverse=True)
    basis = csr_matrix((entry, (row_index, packed)), shape=(n_scalars, len(used)))
    return basis, denominator, plain, used >= n_scalars


def _plus(row: dict[int, int], key: int, amount: int) -> dict[int, int]:
    """A copy of a sparse integer row with ``amount`` added at ``key``; zeros are dropped."""
    out = dict(row)
    value = out.get(key, 0) + amount
    if value:
        out[key] = value
    else:
        out.pop(key, None)
    return out


def _add(row: _Row, solved: dict[int, _Row], key: int, factor: _Number) -> None:
    """Add ``factor`` times a variable to a row in place, written in unsolved variables."""
    if not factor:
        return
    for k, c in solved.get(key, {key: 1}).items():
        value = row.get(k, 0) + factor * c
        if value:
            row[k] = value
        else:
            row.pop(k, None)


def _solve(relations: list[_Row]) -> dict[int, _Row]:
    """Reduced elimination: some variables as combinations of the others."""
    solved: dict[int, _Row] = {}
    uses: dict[int, set[int]] = {}
    for relation in sorted(relations, key=len):
        row: _Row = {}
        for k, c in relation.items():
            _add(row, solved, k, c)
        if not row:
            continue
        # Units first (they keep the lattice integral), then rare variables (they keep it sparse).
        pivot = min(row, key=lambda k: (abs(row[k]) != 1, abs(row[k]), len(uses.get(k, ())), k))
        divisor = row.pop(pivot)
        scale = -divisor if abs(divisor) == 1 else Fraction(-1) / divisor
        value = {k: c * scale for k, c in row.items()}
        for user in uses.pop(pivot, set()):
            factor = solved[user].pop(pivot)
            for k, c in value.items():
                total = solved[user].get(k, 0) + factor * c
                if total:
                    solved[user][k] = total
                    uses.setdefault(k, set()).add(user)
                else:
                    solved[user].pop(k, None)
                    uses.get(k, set()).discard(user)
        solved[pivot] = value
        for k in value:
            uses.setdefault(k, set()).add(pivot)
    return solved
