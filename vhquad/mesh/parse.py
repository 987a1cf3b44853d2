"""Polygons out of the text of OBJ and OFF files.

Of an OBJ only ``v``, ``f`` and ``l`` count: a face's texture and normal indices are left aside, so
seams in them do not cut the surface. Groups and objects make one soup.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.mesh.polygons import PolygonSoup

__all__ = ["check_indices", "parse_obj", "parse_off"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_NO_INTEGER = re.compile(r"[^\d\s-]|\d-|\d{18}")


def parse_obj(text: str) -> PolygonSoup:
    """Polygons of a Wavefront OBJ text.

    Raises
    ------
    MeshError
        If a vertex or a face cannot be read, naming the line.
    """
    text = text.replace("\\\r\n", " ").replace("\\\n", " ")
    lines = [line.strip() for line in text.replace("\r", "\n").split("\n")]
    kind = [line[:2].replace("\t", " ") for line in lines]
    points = [i for i, k in enumerate(kind) if k == "v "]
    faces = [i for i, k in enumerate(kind) if k == "f "]
    strips = [i for i, k in enumerate(kind) if k == "l "]
    vertices = _numbers([lines[i][2:] for i in points], points, "vertex")
    corners, sizes = _references(lines, faces, points, len(vertices), "face")
    chain, lengths = _references(lines, strips, points, len(vertices), "line")
    inner = np.ones(len(chain), dtype=bool)
    inner[np.cumsum(lengths)[lengths > 0] - 1] = False
    first = np.flatnonzero(inner)
    pairs = np.stack([chain[first], chain[first + 1]], axis=1)
    return PolygonSoup(vertices, corners, sizes, lines=pairs)


def _table(rows: list[str], dtype: type, columns: range | None = None) -> NDArray[Any] | None:
    """Rows of as many numbers each as an array; None if they are anything else."""
    if not rows:
        return None
    try:
        found: NDArray[Any] = np.loadtxt(rows, dtype=dtype, usecols=columns, comments=None, ndmin=2)
    except ValueError:
        return None
    return found if len(found) == len(rows) else None


def _numbers(texts: list[str], places: Sequence[int], what: str) -> Floats:
    """The first three numbers of each row; `places` are the 0-based lines, for the message."""
    found = _table(texts, np.float64, range(3))
    if found is not None:
        return found
    rows = [text.split()[:3] for text in texts]
    try:
        flat = np.array([float(x) for row in rows for x in row], dtype=np.float64)
        if len(flat) == 3 * len(rows) and all(len(row) == 3 for row in rows):
            return flat.reshape(-1, 3)
    except ValueError:
        pass
    for row, place in zip(rows, places, strict=True):
        try:
            good = len([float(x) for x in row]) == 3
        except ValueError:
            good = False
        if not good:
            raise MeshError(f"line {place + 1} is not a {what}: {' '.join(row)[:60]!r}")
    return np.zeros((0, 3))


def _references(
    lines: list[str], places: list[int], points: list[int], n: int, what: str
) -> tuple[Ints, Ints]:
    """Vertices named by the lines at `places`, 0-based, and how many each names."""
    joined = "\n".join(lines[i][2:] for i in places)
    if "/" in joined:
        joined = re.sub(r"/\S*", "", joined)
    even = None
    if places and not _NO_INTEGER.search(joined):
        even = _table(joined.split("\n"), np.int64)
    if even is not None:
        sizes = np.full(len(even), even.shape[1], dtype=np.int64)
        return _zero_based(even.reshape(-1), sizes, places, points, n), sizes
    rows = [row.split() for row in joined.split("\n")] if places else []
    sizes = np.array([len(row) for row in rows], dtype=np.int64)
    try:
        index = np.array([int(x) for row in rows for x in row], dtype=np.int64)
    except (ValueError, OverflowError):
        for row, place in zip(rows, places, strict=True):
            if not all(re.fullmatch(r"[+-]?\d{1,18}", x) for x in row):
                raise MeshError(
                    f"line {place + 1} is not a {what}: {lines[place][:60]!r}"
                ) from None
        raise
    return _zero_based(index, sizes, places, points, n), sizes


def _zero_based(index: Ints, sizes: Ints, places: list[int], points: list[int], n: int) -> Ints:
    """Vertices counted from 0, where a file counts from 1, or from the last one read down."""
    line_of = np.repeat(np.array(places, dtype=np.int64), sizes)
    # Negative indices count back from the vertices read so far.
    known = np.searchsorted(np.array(points, dtype=np.int64), line_of)
    zero_based = np.where(index < 0, known + index, index - 1)
    bad = np.flatnonzero((index == 0) | (zero_based < 0) | (zero_based >= n))
    if len(bad):
        raise MeshError(
            f"line {line_of[bad[0]] + 1} names vertex {index[bad[0]]}, but there are {n}"
            f" ({len(bad)} such corners)"
        )
    return zero_based


def parse_off(text: str) -> PolygonSoup:
    """Polygons of an OFF text; colours and normals behind the positions are left aside.

    Raises
    ------
    MeshError
        If the text ends early or a row cannot be read, naming the line.
    """
    rows = [(i, line.split("#")[0].split()) for i, line in enumerate(text.splitlines())]
    rows = [(i, row) for i, row in rows if row]
    if rows and re.fullmatch(r"(ST|C|N)*OFF", rows[0][1][0]):
        rows[0] = (rows[0][0], rows[0][1][1:])
        rows = rows if rows[0][1] else rows[1:]
    elif rows and rows[0][1][0].endswith("OFF"):
        raise MeshError(f"this kind of OFF file ({rows[0][1][0]}) is not supported")
    try:
        n, m = (int(x) for x in rows[0][1][:2])
    except (IndexError, ValueError):
        raise MeshError("the line with the counts of vertices and faces is missing") from None
    if n < 0 or m < 0 or len(rows) < 1 + n + m:
        raise MeshError(f"{n} vertices and {m} faces are announced, but the file ends early")
    places = [i for i, _ in rows[1 : 1 + n]]
    vertices = _numbers([" ".join(row) for _, row in rows[1 : 1 + n]], places, "vertex")
    corners: list[int] = []
    sizes = []
    for place, row in rows[1 + n : 1 + n + m]:
        try:
            size = int(row[0])
            face = [int(x) for x in row[1 : 1 + size]]
        except ValueError:
            size, face = 0, []
        if size < 1 or len(face) != size:
            raise MeshError(f"line {place + 1} is not a face: {' '.join(row)[:60]!r}")
        corners.extend(face)
        sizes.append(size)
    index = np.array(corners, dtype=np.int64)
    check_indices(index, n)
    return PolygonSoup(vertices, index, np.array(sizes, dtype=np.int64))


def check_indices(index: Ints, n: int) -> None:
    """Refuse corners that name no vertex of 0..n-1."""
    bad = np.flatnonzero((index < 0) | (index >= n))
    if len(bad):
        raise MeshError(
            f"{len(bad)} face corners name vertices outside 0..{n - 1}, such as {index[bad[0]]}"
        )
