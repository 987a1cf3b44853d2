"""`import vhquad`: the names that scripts use."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vhquad
from tests.command_line import write_obj
from tests.meshes import icosphere
from tests.soups import unwelded
from vhquad.errors import ConfigError, FieldError


def test_public_names_are_there() -> None:
    assert len(vhquad.__all__) <= 12
    for name in vhquad.__all__:
        assert getattr(vhquad, name) is not None
        assert name in dir(vhquad)


def test_unknown_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = vhquad.nothing


def test_load_predict_remesh(tmp_path: Path, small_model: Path) -> None:
    ball = icosphere(3)
    path = write_obj(tmp_path / "ball.obj", ball.vertices, ball.faces)
    mesh = vhquad.load(path).mesh
    field = vhquad.predict(mesh, small_model, cache=False)
    assert isinstance(field, vhquad.CrossField)
    assert (field.domain, len(field)) == ("vertices", mesh.n_vertices)
    result = vhquad.remesh(mesh.vertices, mesh.faces, target_quads=150, field=field)
    assert isinstance(result.quads, vhquad.QuadMesh)
    assert result.quads.is_manifold
    assert result.report.made == result.quads.n_quads


def test_remesh_repairs_and_reports(tmp_path: Path) -> None:
    """Progress is told, steps are timed, repairs are listed, inputs stay as they are."""
    vertices, faces = unwelded(icosphere(2))
    before = vertices.copy(), faces.copy()
    steps: list[tuple[str, float]] = []
    result = vhquad.remesh(
        vertices,
        faces,
        target_quads=100,
        method="curvature",
        progress=lambda what, share: steps.append((what, share)),
    )
    assert result.report.topology_kept
    assert any("welded" in line for line in result.report.repair)
    assert {"repair", "field"} <= set(result.report.seconds)
    assert all(0.0 <= share <= 1.0 for _, share in steps)
    assert steps
    np.testing.assert_array_equal(vertices, before[0])
    np.testing.assert_array_equal(faces, before[1])


def test_errors_name_what_is_wrong(small_model: Path) -> None:
    ball = icosphere(1)
    with pytest.raises(ConfigError, match="method"):
        vhquad.predict(ball, method="magic")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="curvature uses none"):
        vhquad.predict(ball, small_model, method="curvature")
    field = vhquad.CrossField("faces", np.ones(3))
    with pytest.raises(FieldError, match="3 crosses, the mesh 80 faces"):
        vhquad.remesh(ball.vertices, ball.faces, field=field)
    with pytest.raises(vhquad.VhquadError):
        vhquad.remesh(ball.vertices, ball.faces, target_quads=-1)
