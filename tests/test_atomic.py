"""Atomic files: whole, or as before."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from vhquad.atomic import atomic_path, write_atomic


def test_a_file_is_made_and_replaced(tmp_path: Path) -> None:
    target = tmp_path / "new" / "mesh.obj"
    write_atomic(target, "one\n")
    write_atomic(target, b"two\n")
    assert target.read_bytes() == b"two\n"
    assert [p.name for p in target.parent.iterdir()] == ["mesh.obj"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_the_old_file(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "mesh.ply"
    write_atomic(target, "old")

    def fail_half_way() -> None:
        with atomic_path(target) as temporary:
            assert temporary.suffix == ".ply"
            assert temporary.parent == tmp_path
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        fail_half_way()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.skipif(os.name == "nt", reason="POSIX permissions")
def test_permissions_are_those_of_an_ordinary_file(tmp_path: Path) -> None:
    plain, ours = tmp_path / "plain", tmp_path / "ours"
    plain.write_text("x")
    write_atomic(ours, "x")
    assert ours.stat().st_mode == plain.stat().st_mode
    ours.chmod(0o640)
    write_atomic(ours, "y")
    assert ours.stat().st_mode & 0o777 == 0o640


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError, match="name a file"):
        write_atomic(tmp_path, "x")
