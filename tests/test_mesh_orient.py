"""Two-colouring of glued faces, with and without contradictions."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vhquad.mesh.orient import Sides, colour

links = st.lists(st.tuples(st.integers(0, 7), st.integers(0, 7), st.booleans()), max_size=24)


def arrays(pairs: list[tuple[int, int, bool]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    table = np.array(pairs, dtype=np.int64).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2].astype(bool)


@given(links)
def test_what_is_cut_had_to_be_cut_somewhere(pairs: list[tuple[int, int, bool]]) -> None:
    a, b, odd = arrays(pairs)
    result = colour(8, a, b, odd)
    assert ((result.turned[a] ^ result.turned[b]) == odd)[result.agrees].all()
    assert (result.part[a] == result.part[b]).all()
    # The pairs that agree still hold every part together, so no more was cut than a tree forces.
    again = colour(8, a[result.agrees], b[result.agrees], odd[result.agrees])
    assert again.agrees.all()
    apart = a != b
    np.testing.assert_array_equal(
        colour(8, a[apart], b[apart], odd[apart]).part[a[apart]],
        again.part[a[apart]],
    )
    for part in np.unique(result.part):
        assert not result.turned[np.flatnonzero(result.part == part)[0]]


@given(links)
def test_a_colouring_that_exists_is_found(pairs: list[tuple[int, int, bool]]) -> None:
    a, b, _ = arrays(pairs)
    truth = np.array([0, 1, 1, 0, 1, 0, 0, 1], dtype=bool)
    assert colour(8, a, b, truth[a] ^ truth[b]).agrees.all()


@given(links)
def test_sides_join_what_fits(pairs: list[tuple[int, int, bool]]) -> None:
    sides = Sides(8)
    taken = [p for p in pairs if sides.join(*p)]
    for a, b, odd in taken:
        (ra, oa), (rb, ob) = sides.find(a), sides.find(b)
        assert ra == rb
        assert (oa ^ ob) == odd
    a, b, odd = arrays(taken)
    assert colour(8, a, b, odd).agrees.all()
