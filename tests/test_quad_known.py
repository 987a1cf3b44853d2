"""known_parts: which components a field is sure of, by their quads."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import grid, merge, moved
from vhquad.field.cross import CrossField
from vhquad.quad.known import known_parts


@pytest.mark.parametrize(("share", "is_known"), [(0.7, False), (0.9, True)])
def test_four_fifths_of_the_quads_make_a_part_known(share: float, is_known: bool) -> None:
    part = grid(20, 20, 1.0, 1.0)
    mesh = merge(part, moved(part, (3.0, 0.0, 0.0), 5.0))
    x = mesh.vertices[mesh.faces].mean(axis=1)[:, 0]
    sure = (x < share) | (x > 2.0)  # so much of the first, all of the second
    field = CrossField("faces", np.ones(mesh.n_faces), None, np.where(sure, 0.96, 0.94))
    assert known_parts(mesh, field, np.ones(mesh.n_faces)).tolist() == [is_known, True]
    # Quads count, not areas: half as long on the right half of the first, where field ends.
    size = np.where((x > 0.5) & (x < 2.0), 0.5, 1.0)
    share = (0.5 + 4 * (share - 0.5)) / 2.5
    assert known_parts(mesh, field, size).tolist() == [share > 0.8, True]


def test_a_field_that_does_not_say_how_sure_it_is_knows_nothing() -> None:
    mesh = grid(4, 4)
    field = CrossField("faces", np.ones(mesh.n_faces))
    assert not known_parts(mesh, field, np.ones(mesh.n_faces)).any()
