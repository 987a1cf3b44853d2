"""The bundle of operators and its cache."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from tests import meshes
from vhquad.errors import ConfigError, MeshError
from vhquad.geometry import operators
from vhquad.geometry.operators import (
    Operators,
    OperatorSettings,
    build_operators,
    default_cache_dir,
    load_or_build,
)
from vhquad.mesh.triangle import TriMesh

SMALL = OperatorSettings(k=16)


def same(a: Operators, b: Operators) -> bool:
    names = ("mass", "eigenvalues", "eigenvectors", "features")
    return all(np.array_equal(getattr(a, n), getattr(b, n)) for n in names)


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by one with every build."""
    calls: list[int] = []
    original = operators.build_operators

    def counted(mesh: TriMesh, settings: OperatorSettings | None = None) -> Operators:
        calls.append(mesh.n_vertices)
        return original(mesh, settings)

    monkeypatch.setattr(operators, "build_operators", counted)
    return calls


@pytest.mark.parametrize("case", meshes.EVERY, ids=str)
def test_build_on_the_suite(case: meshes.Case) -> None:
    o = build_operators(case.mesh, SMALL)
    n, k = case.mesh.n_vertices, min(16, case.mesh.n_vertices)
    # 1. Shapes and types.
    assert (o.mass.shape, o.eigenvalues.shape) == ((n,), (k,))
    assert o.eigenvectors.shape == (n, k)
    assert o.features.shape == (n, 30)
    assert o.eigenvectors.dtype == o.features.dtype == np.complex128
    # 2. Area, positive mass.
    assert o.mass.min() > 0
    assert o.area == pytest.approx(case.mesh.area, rel=1e-9)
    # 3. M-orthonormal.
    gram = o.eigenvectors.conj().T @ (o.mass[:, None] * o.eigenvectors)
    np.testing.assert_allclose(gram, np.eye(k), atol=1e-11)
    # 4. Everything finite.
    assert all(np.isfinite(a).all() for a in (o.eigenvalues, o.eigenvectors, o.features))


def test_settings() -> None:
    mesh = meshes.torus(12, 8)
    assert (
        build_operators(mesh, OperatorSettings(features="mean", turned=False)).features.shape[1]
        == 1
    )
    # On a sphere the smallest eigenvalue of order N is N (unit radius).
    for order in (1, 2, 4):
        o = build_operators(meshes.icosphere(3), OperatorSettings(k=4, order=order))
        assert o.eigenvalues[0] == pytest.approx(order, rel=0.02)
    with pytest.raises(ConfigError, match="k must"):
        OperatorSettings(k=0)
    with pytest.raises(ConfigError, match="unknown features 'wks'"):
        OperatorSettings(features="wks")
    with pytest.raises(ConfigError, match="order must be 1, 2 or 4"):
        OperatorSettings(order=3)


def test_unused_vertices_are_refused() -> None:
    mesh = meshes.tetrahedron()
    loose = TriMesh(np.vstack([mesh.vertices, [[9.0, 9.0, 9.0]]]), mesh.faces)
    with pytest.raises(MeshError, match=r"1 vertices belong to no face.*4.*repair"):
        build_operators(loose)


def test_cache(tmp_path: Path, builds: list[int]) -> None:
    mesh = meshes.torus(12, 8)
    first = load_or_build(mesh, SMALL, tmp_path / "new")
    # 1. The second time nothing is built; the arrays are the same to the bit.
    again = load_or_build(TriMesh(mesh.vertices, mesh.faces), SMALL, tmp_path / "new")
    assert len(builds) == 1
    assert same(first, again)
    assert again.settings == SMALL
    # 2. One file, no leftovers.
    assert [p.suffix for p in (tmp_path / "new").iterdir()] == [".npz"]
    # 3. Other settings and other content are other entries.
    load_or_build(mesh, OperatorSettings(k=17), tmp_path / "new")
    load_or_build(meshes.moved(mesh, (0, 0, 0), 1.0 + 1e-15), SMALL, tmp_path / "new")
    assert len(builds) == 3
    assert len(list((tmp_path / "new").iterdir())) == 3
    # 4. Not asked, not used.
    load_or_build(mesh, SMALL, tmp_path / "new", cache=False)
    assert len(builds) == 4


@pytest.mark.parametrize("damage", ["cut", "empty", "garbage", "flip", "shape", "pickle", "nan"])
def test_damaged_entries_are_rebuilt(tmp_path: Path, builds: list[int], damage: str) -> None:
    mesh = meshes.torus(12, 8)
    good = load_or_build(mesh, SMALL, tmp_path)
    (entry,) = tmp_path.iterdir()
    data = entry.read_bytes()
    arrays = {n: getattr(good, n) for n in ("mass", "eigenvalues", "eigenvectors", "features")}
    if damage == "shape":
        np.savez(entry, **{**arrays, "mass": good.mass[1:]})
    elif damage == "nan":
        np.savez(entry, **{**arrays, "mass": good.mass * np.nan})
    elif damage == "pickle":
        np.savez(entry, **{**arrays, "mass": np.array([print, None], dtype=object)})
    else:
        middle = len(data) // 2
        flipped = data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :]
        entry.write_bytes(
            {"cut": data[:middle], "empty": b"", "garbage": b"x" * 99}.get(damage, flipped)
        )
    assert same(load_or_build(mesh, SMALL, tmp_path), good)
    assert len(builds) == 2
    # And the new entry is good.
    assert same(load_or_build(mesh, SMALL, tmp_path), good)
    assert len(builds) == 2


def test_a_cache_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    assert load_or_build(meshes.tetrahedron(), SMALL, blocked).mass.shape == (4,)


def test_default_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path))
    assert default_cache_dir() == tmp_path
    load_or_build(meshes.tetrahedron(), SMALL)
    assert len(list(tmp_path.glob("*.npz"))) == 1
    monkeypatch.delenv("VHQUAD_CACHE")
    for platform, name, value in (
        ("linux", "XDG_CACHE_HOME", "/c"),
        ("win32", "LOCALAPPDATA", "/c"),
    ):
        monkeypatch.setattr(sys, "platform", platform)
        monkeypatch.setenv(name, value)
        assert default_cache_dir() == Path("/c/vhquad")
    monkeypatch.setattr(sys, "platform", "darwin")
    assert default_cache_dir() == Path("~/Library/Caches/vhquad").expanduser()
