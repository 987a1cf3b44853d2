"""align_field: guarantees on every mesh of the suite, with smooth, noisy and random fields."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.data_paths import data_file
from tests.field_checks import check_aligned
from tests.meshes import CLOSED, EVERY, Case, grid, icosphere, torus
from vhquad.errors import ConfigError, FieldError
from vhquad.field.align import AlignSettings, align_field
from vhquad.field.cross import CrossField
from vhquad.field.features import sharp_edges
from vhquad.field.smooth import smoothest
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.load import load
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


@given(
    case=st.sampled_from(EVERY),
    seed=st.integers(0, 2**32 - 1),
    edge_length=st.floats(0.02, 2.0),
    smoothing=st.floats(0.0, 2.0),
    cancel=st.floats(0.0, 2.0),
    degrees=st.sampled_from([None, 15.0, 40.0]),
)
def test_guarantees_hold_whatever_the_settings(
    case: Case,
    seed: int,
    edge_length: float,
    smoothing: float,
    cancel: float,
    degrees: float | None,
) -> None:
    mesh = case.mesh
    creases = None if degrees is None else mesh.edges[sharp_edges(mesh, degrees)]
    rng = np.random.default_rng(seed)
    trust = rng.uniform(0, 1, mesh.n_faces) * (rng.random(mesh.n_faces) < 0.7)
    size = rng.uniform(0.5, 2.0, mesh.n_faces)
    field = CrossField("faces", random_field(mesh, seed).z, size, trust)
    settings = AlignSettings(edge_length, smoothing, cancel)
    aligned = align_field(mesh, field, creases, settings)
    check_aligned(mesh, aligned)
    np.testing.assert_array_equal(aligned.size, size[aligned.parent_face])
    np.testing.assert_array_equal(aligned.trust, field.trust[aligned.parent_face])


@pytest.mark.parametrize(
    "name", ["head_remeshed", "mountain", "demosthenes", "plane_holes", "head_noisy"]
)
def test_scans_with_boundaries(name: str) -> None:
    mesh = load(data_file("tris", f"{name}.obj")).mesh
    aligned = align_field(mesh, CrossField("faces", np.zeros(mesh.n_faces)))
    check_aligned(mesh, aligned)


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
