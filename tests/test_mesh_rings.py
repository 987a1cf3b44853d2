"""Rings of faces: squares about a square of a lattice, none without a start."""

from __future__ import annotations

import numpy as np

from tests.quad_meshes import quad_grid
from vhquad.mesh.rings import separate_parts, within_rings


def test_rings_are_squares_on_a_lattice() -> None:
    _, quads = quad_grid(9, 9)
    inside = np.zeros(81, dtype=bool)
    inside[40] = True  # the middle
    for rings in range(5):
        assert within_rings(quads, inside, rings).sum() == (2 * rings + 1) ** 2
    assert within_rings(quads, inside, 9).all()
    assert inside.sum() == 1  # what was given stays
    assert not within_rings(quads, np.zeros(81, dtype=bool), 3).any()


def test_parts_share_no_vertex() -> None:
    """Two squares that touch at a corner are one part, one with a gap of a square another."""
    _, quads = quad_grid(9, 9)
    chosen = np.zeros(len(quads), dtype=bool)
    middle = quads.reshape(9, 9, 4)
    number = np.arange(81).reshape(9, 9)
    chosen[number[[0, 1, 1], [0, 1, 3]]] = True
    parts = separate_parts(quads, chosen)
    assert sorted(sorted(part.tolist()) for part in parts) == [[0, 10], [12]]
    assert set(middle[0, 0]) & set(middle[1, 1])
    assert not set(middle[1, 1]) & set(middle[1, 3])
    assert separate_parts(quads, np.zeros(len(quads), dtype=bool)) == []
