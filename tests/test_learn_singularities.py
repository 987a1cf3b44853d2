"""Singularities against the artist's: counted, and paired by place and sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.meshes import icosphere, torus
from vhquad.field.cross import CrossField
from vhquad.field.smooth import smoothest
from vhquad.field.transport import to_vertices
from vhquad.learn.polished import polished
from vhquad.learn.singularities import SingularPoints, artists, singular_points, singularity_row

BALL = icosphere(4)
SIZE = np.full(BALL.n_vertices, 0.15)


def ball_field() -> CrossField:
    """The smoothest field of a ball, which has eight singularities of index 1/4."""
    z = to_vertices(BALL, CrossField("faces", smoothest(BALL))).z
    return CrossField("vertices", z, SIZE)


def test_a_ball_has_eight() -> None:
    """1. The same eight before and after a remesh's smoothing; they are paired."""
    field = ball_field()
    wanted = artists(BALL, field)
    assert wanted.quarters.tolist() == [1] * 8
    assert wanted.edge_length == np.float64(0.15)
    aligned = polished(BALL, field, wanted.edge_length)
    assert aligned is not None
    found = singular_points(aligned)
    row = singularity_row("m", "all", [(found, wanted)])
    assert (row.meshes, row.count, row.artists, row.matched) == (1, 8, 8, 8)


def test_unknown_surroundings_hide_a_singularity() -> None:
    """2. Where the truth is not known it has none."""
    field = ball_field()
    vertex = int(np.linalg.norm(BALL.vertices - artists(BALL, field).points[0], axis=1).argmin())
    z = field.z.copy()
    z[vertex] = 0.0
    assert len(artists(BALL, replace(field, z=z))) == 7


def test_without_sizes_quads_are_those_of_2000() -> None:
    ring = torus()
    field = CrossField("vertices", np.ones(ring.n_vertices))
    assert np.isclose(artists(ring, field).edge_length, np.sqrt(ring.area / 2000))


def test_pairs_by_hand() -> None:
    """3. Each is paired once, within two quads, with one of its own sign."""
    wanted = replace(
        artists(BALL, ball_field()),
        points=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
        quarters=np.array([1, -1, 1]),
        size=np.array([0.1, 0.1, 0.5]),
    )
    points = np.array([[0.15, 0.0, 0.0], [-0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [2.9, 0.0, 0.0]])
    found = SingularPoints(points, np.array([1, 1, 1, 2]))
    row = singularity_row("m", "g", [(found, wanted), (None, wanted)])
    assert (row.meshes, row.count, row.artists, row.matched) == (1, 4, 3, 2)
