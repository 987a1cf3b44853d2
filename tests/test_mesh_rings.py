"""Rings of faces: squares about a square of a lattice, none without a start."""

from __future__ import annotations

import numpy as np

from tests.quad_meshes import quad_grid
from vhquad.mesh.rings import within_rings


def test_rings_are_squares_on_a_lattice() -> None:
    _, quads = quad_grid(9, 9)
    inside = np.zeros(81, dtype=bool)
    inside[40] = True  # the middle
    for rings in range(5):
        assert within_rings(quads, inside, rings).sum() == (2 * rings + 1) ** 2
    assert within_rings(quads, inside, 9).all()
    assert inside.sum() == 1  # what was given stays
    assert not within_rings(quads, np.zeros(81, dtype=bool), 3).any()
