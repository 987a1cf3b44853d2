"""Kept results: found by content alone, never used if damaged, fields without any prediction."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests import meshes
from vhquad import api, cache
from vhquad.cache import code_digest, content_key, read_arrays, write_arrays
from vhquad.learn import proxy
from vhquad.mesh.triangle import TriMesh

ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "b": np.array([1, 2])}


def test_keys_follow_the_content() -> None:
    a = np.arange(6.0)
    assert content_key("x", a) == content_key("x", a.copy())
    others = [content_key("y", a), content_key("x", a + 1e-16), content_key("x", a.reshape(2, 3))]
    others.append(content_key("x", a, [1]))
    assert content_key("x", a + 1e-300) != content_key("x", a + 1.0)
    assert len({content_key("x", a), *others[:1], *others[2:]}) == 4
    assert len(code_digest()) == 64


def test_arrays_come_back_and_damage_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "new" / "entry.npz"
    write_arrays(path, ARRAYS)
    found = read_arrays(path, ["b", "a"])
    assert found is not None
    assert np.array_equal(found[0], ARRAYS["b"])
    assert np.array_equal(found[1], ARRAYS["a"])
    assert read_arrays(path, ["a", "c"]) is None
    assert read_arrays(tmp_path / "none.npz", ["a"]) is None
    whole = path.read_bytes()
    for place in range(0, len(whole) - 8, 16):  # every place: other values are never returned
        path.write_bytes(whole[:place] + b"\xff" * 8 + whole[place + 8 :])
        got = read_arrays(path, ["a", "b"])
        assert got is None or all(map(np.array_equal, got, ARRAYS.values()))
    path.write_bytes(whole[:-30])
    assert read_arrays(path, ["a"]) is None


def test_infinite_values_are_refused(tmp_path: Path) -> None:
    write_arrays(tmp_path / "x.npz", {"a": np.array([1.0, np.inf])})
    assert read_arrays(tmp_path / "x.npz", ["a"]) is None


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    write_arrays(tmp_path / "file" / "x.npz", ARRAYS)


@pytest.fixture
def weights(tmp_path: Path, small_model: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path / "cache"))
    for suffix in (".safetensors", ".json"):
        shutil.copy(small_model.with_suffix(suffix), tmp_path)
    return tmp_path / "model.safetensors"


def test_fields_are_predicted_once(
    weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = meshes.blob(3)
    first = api.predict(mesh, weights)
    (entry,) = (tmp_path / "cache").glob("field-*.npz")

    def never(*args: object, **kwargs: object) -> None:
        raise AssertionError("predicted again")

    with monkeypatch.context() as patch:
        patch.setattr("vhquad.learn.predict.predict_field", never)
        second = api.predict(mesh, tmp_path)  # the same model by its folder
        for name in ("z", "size", "confidence"):
            assert np.array_equal(getattr(first, name), getattr(second, name))
        moved = TriMesh(mesh.vertices * 1.5, mesh.faces)
        for other in (
            lambda: api.predict(moved, weights),
            lambda: api.predict(mesh, weights, resolution="full"),
            lambda: api.predict(mesh, weights, cache=False),
        ):
            with pytest.raises(AssertionError, match="predicted again"):
                other()
        weights.with_suffix(".json").write_text(
            weights.with_suffix(".json").read_text().replace("\n", " \n")
        )
        with pytest.raises(AssertionError, match="predicted again"):
            api.predict(mesh, weights)
    whole = entry.read_bytes()
    entry.write_bytes(whole[: len(whole) // 2])
    again = api.predict(mesh, weights)
    assert np.array_equal(first.z, again.z)


def test_the_network_is_asked_once_for_all_stand_ins(
    weights: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proxy, "PROXY_ABOVE", 2000)
    monkeypatch.setattr(proxy, "PROXY_VERTICES", 900)
    mesh = meshes.blob(4)
    copies = [proxy.make_proxy(mesh, count) for count in (1800, 1400)]
    first = [api.predict(copy, weights, of=mesh, cache=False) for copy in copies]
    assert np.array_equal(api.predict(copies[0], weights, of=mesh).z, first[0].z)

    def never(*args: object, **kwargs: object) -> None:
        raise AssertionError("predicted again")

    monkeypatch.setattr("vhquad.learn.predict.predict_field", never)
    second = api.predict(copies[1], weights, of=mesh)
    for name in ("z", "size", "confidence"):
        assert np.array_equal(getattr(second, name), getattr(first[1], name))
    with pytest.raises(AssertionError, match="predicted again"):
        api.predict(copies[1], weights)


def test_what_was_used_longest_ago_goes_and_nothing_that_is_not_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    block = {"a": np.zeros(1000)}  # 8 kB and a header
    other = tmp_path / "measurements.npz"
    np.savez(other, a=np.zeros(5000))
    paths = [tmp_path / f"{'mesh-' * (i % 2)}{content_key(i)}.npz" for i in range(4)]
    for age, path in enumerate(paths[:3]):
        write_arrays(path, block)
        os.utime(path, (1e9 + age, 1e9 + age))
    assert read_arrays(paths[0], ("a",)) is not None  # the oldest is used again
    monkeypatch.setattr(cache, "MOST_BYTES", 3 * paths[0].stat().st_size)
    write_arrays(paths[3], block)
    assert [path.exists() for path in paths] == [True, False, True, True]
    assert other.exists()
    monkeypatch.setattr(cache, "MOST_BYTES", 0)
    write_arrays(paths[1], block)
    assert [path.exists() for path in paths] == [False, True, False, False]  # the newest stays
