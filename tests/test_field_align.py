"""align_field: guarantees on every mesh of the suite, with smooth, noisy and random fields."""

from __future__ import annotations

import numpy as np
import pytest

from tests.field_checks import check_aligned
from tests.meshes import CLOSED, EVERY, Case, grid, icosphere, torus
from vhquad.errors import ConfigError, FieldError
from vhquad.field.align import AlignSettings, align_field
from vhquad.field.cross import CrossField
from vhquad.field.smooth import smoothest
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.triangle import TriMesh


def random_field(mesh: TriMesh, seed: int) -> CrossField:
    rng = np.random.default_rng(seed)
    return CrossField("faces", np.exp(1j * rng.uniform(0, 2 * np.pi, mesh.n_faces)))


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_guarantees_hold_for_the_smoothest_field(case: Case) -> None:
    aligned = align_field(case.mesh, CrossField("faces", smoothest(case.mesh)))
    check_aligned(case.mesh, aligned)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_guarantees_hold_for_random_fields_taken_as_they_are(case: Case) -> None:
    settings = AlignSettings(smoothing=0.0, cancel=0.0)
    check_aligned(case.mesh, align_field(case.mesh, random_field(case.mesh, 1), None, settings))


@pytest.mark.parametrize("case", CLOSED, ids=str)
def test_guarantees_hold_for_noisy_fields(case: Case) -> None:
    rng = np.random.default_rng(2)
    z = smoothest(case.mesh) * np.exp(0.5j * rng.normal(size=case.mesh.n_faces))
    check_aligned(case.mesh, align_field(case.mesh, CrossField("faces", z)))


def test_truth_on_sphere_torus_and_flat_grid() -> None:
    sphere, ring, flat = icosphere(3), torus(48, 24), grid()
    # 1. eight valence-3 vertices: the smoothest cross field of a sphere
    aligned = align_field(sphere, CrossField("faces", smoothest(sphere)))
    assert aligned.report.singularities == {3: 8}
    # 2. a torus needs none: the field of its circles about the z axis
    about = np.cross([0.0, 0.0, 1.0], ring.vertices[ring.faces].mean(axis=1))
    circles = CrossField("faces", from_3d(about, face_axes(ring)) ** 4)
    assert align_field(ring, circles).report.singularities == {}
    # 3. the rectangle: four corners of one quad, nothing else
    aligned = align_field(flat, CrossField("faces", np.zeros(flat.n_faces)))
    assert aligned.report.singularities == {}
    feature = aligned.sector_is_feature
    assert np.bincount(aligned.sector_quads[feature]).tolist() == [0, 4, 24]


def test_what_does_not_fit_is_refused() -> None:
    mesh = icosphere(1)
    with pytest.raises(FieldError, match="80 faces"):
        align_field(mesh, CrossField("faces", np.ones(3)))
    with pytest.raises(FieldError, match="on vertices"):
        align_field(mesh, CrossField("vertices", np.ones(80)))
    with pytest.raises(ConfigError, match="edge_length"):
        AlignSettings(edge_length=0.0)
