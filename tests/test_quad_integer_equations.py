"""Equations between arc lengths and unknowns: met by the map they come from, and decisive."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from tests.map_stages import NAMES, Stages, stages
from vhquad.errors import ParametrizationError
from vhquad.quad.integer_equations import MapEquations, map_equations, solve_integers


@cache
def equations(name: str) -> MapEquations:
    s = stages(name)
    return map_equations(s.aligned, s.seamless, s.space, s.tracing, s.tmesh)


def scalars(s: Stages) -> np.ndarray:
    """Coordinates of the wedges of the continuous map, in units; (2 w,)."""
    flat = np.zeros((s.space.n_wedges, 2))
    flat[s.space.wedge.reshape(-1)] = s.seamless.uv.reshape(-1, 2)
    return flat.reshape(-1)


@pytest.mark.parametrize("name", NAMES)
def test_the_map_meets_its_own_equations(name: str) -> None:
    s, e = stages(name), equations(name)
    z = scalars(s)
    basis = (s.space.basis / s.space.denominator).tocsc()
    x = splu((basis.T @ basis).tocsc()).solve(basis.T @ z)
    right = e.lengths @ (s.tmesh.lengths / s.seamless.unit)
    right[-len(e.anchors) :] += z[e.anchors]
    # Arc lengths are float64 over coordinates up to 2^28: exact to 1e-6 units, of 2^20 an edge.
    off = e.forms @ x / s.space.denominator - right
    assert np.abs(off).max() < 1e-5
    # Ordinary vertices take no part, and the rest is decided: full rank.
    dense = e.forms.toarray()
    assert not dense[:, ~s.space.even].any()
    assert np.linalg.matrix_rank(dense[:, s.space.even].astype(float)) == s.space.even.sum()


@pytest.mark.parametrize("name", NAMES)
def test_a_known_map_is_found_again(name: str) -> None:
    # The map stretched by a whole number: lengths in its units are integers again.
    s, e = stages(name), equations(name)
    z = scalars(s)
    lengths = np.rint(s.tmesh.lengths / s.seamless.unit).astype(np.int64)
    x = solve_integers(e, s.space, lengths, z[e.anchors].astype(np.int64))
    assert not x[~s.space.even].any()
    on = s.space.basis @ s.space.even.astype(np.int64) != 0
    plain = (abs(s.space.basis) @ (~s.space.even).astype(np.int64)) > 0
    found = (s.space.basis @ x)[on & ~plain] / s.space.denominator
    np.testing.assert_array_equal(found, z[on & ~plain])


def test_anchors_shift_the_map() -> None:
    s, e = stages("pretzel"), equations("pretzel")
    lengths = s.quantise(200).layout.lengths
    a = solve_integers(e, s.space, lengths, np.array([0, 0]))
    b = solve_integers(e, s.space, lengths, np.array([5, -3]))
    assert (a != b).any()
    for x, place in ((a, [0, 0]), (b, [5, -3])):
        assert ((s.space.basis @ x)[e.anchors] / s.space.denominator).tolist() == place


@pytest.mark.parametrize("name", ["blob", "grid", "plate"])
def test_wrong_lengths_are_refused(name: str) -> None:
    s, e = stages(name), equations(name)
    lengths = s.quantise(200).layout.lengths
    anchors = np.zeros(len(e.anchors), dtype=np.int64)
    solve_integers(e, s.space, lengths, anchors)
    for a in range(min(len(lengths), 12)):
        wrong = lengths.copy()
        wrong[a] += 1
        with pytest.raises(ParametrizationError, match="do not belong"):
            solve_integers(e, s.space, wrong, anchors)
