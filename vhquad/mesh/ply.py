"""Polygons out of PLY files, text or binary, either byte order.

A text body is first turned into one row of float64 numbers, so that one reader serves all kinds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.mesh.parse import check_indices
from vhquad.mesh.polygons import PolygonSoup

__all__ = ["parse_ply", "read_tables"]

Ints = NDArray[np.int64]

# fmt: off
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}
# fmt: on
_ORDER = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class _Property:
    name: str
    item: str
    count: str = ""  # type of the length in front of a list, empty for a single value


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]

    @property
    def names(self) -> list[str]:
        return [p.name for p in self.properties]


def parse_ply(data: bytes) -> PolygonSoup:
    """Polygons of a PLY file's bytes.

    Raises
    ------
    MeshError
        If the header or the body is not as the format has it, or there are no vertices or faces.
    """
    tables = read_tables(data)
    point = tables.get("vertex", {})
    if not {"x", "y", "z"} <= set(point):
        raise MeshError("there are no vertices with x, y and z")
    vertices = np.stack([np.asarray(point[c], dtype=np.float64) for c in "xyz"], axis=1)
    face = tables.get("face", {})
    lists = face.get("vertex_indices", face.get("vertex_index"))
    if lists is None:
        if "tristrips" in tables:
            raise MeshError("the faces are stored as triangle strips; save it as plain triangles")
        return PolygonSoup(vertices, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    corners, sizes = lists
    check_indices(corners, len(vertices))
    return PolygonSoup(vertices, corners, sizes)


def read_tables(data: bytes) -> dict[str, dict[str, Any]]:
    """Columns by element and property: an array, or (flat values, lengths) for a list.

    Raises
    ------
    MeshError
        If the header or the body is not as the format has it.
    """
    elements, kind, body = _header(data)
    if kind == "ascii":
        try:
            data, body = np.array([float(x) for x in data[body:].split()]).tobytes(), 0
        except ValueError:
            raise MeshError("the text body holds something that is not a number") from None
    tables: dict[str, dict[str, Any]] = {}
    for element in elements:
        tables[element.name], body = _read(data, body, element)
    return tables


def _header(data: bytes) -> tuple[list[_Element], str, int]:
    """Elements, kind of body, and where the body starts."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise MeshError("it does not have the header of a PLY file")
    body = end + len(b"end_header")
    body += 2 if data[body : body + 2] == b"\r\n" else 1
    kind = ""
    elements: list[_Element] = []
    for line in data[:end].decode("ascii", "replace").replace("\r", "\n").split("\n"):
        word = line.split()
        try:
            if word[:1] == ["format"]:
                kind = word[1]
                if kind not in _ORDER:
                    raise ValueError
            elif word[:1] == ["element"]:
                elements.append(_Element(word[1], int(word[2]), ()))
                if elements[-1].count < 0:
                    raise ValueError
            elif word[:1] == ["property"]:
                last = elements.pop()
                new = _Property(word[-1], *(_type(t, kind) for t in word[-2:-4:-1] if t in _TYPES))
                if bool(new.count) != (word[1] == "list") or word[-1] in last.names:
                    raise ValueError
                elements.append(_Element(last.name, last.count, (*last.properties, new)))
        except (IndexError, KeyError, ValueError, TypeError):
            raise MeshError(f"the header line {line.strip()[:60]!r} is not understood") from None
    if not kind:
        raise MeshError("the header does not name a format")
    return elements, kind, body


def _type(word: str, kind: str) -> str:
    """numpy's name of a type; all numbers of a text body are float64 by now."""
    return "=f8" if kind == "ascii" else _ORDER[kind] + _TYPES[word]


def _read(data: bytes, start: int, element: _Element) -> tuple[dict[str, Any], int]:
    """Columns of an element, (flat values, lengths) for lists, and where the next one starts."""
    if element.count == 0 or not element.properties:
        empty = np.zeros(0, dtype=np.int64)
        return {p.name: (empty, empty) if p.count else empty for p in element.properties}, start
    row = _row_type(data, start, element)
    if start + row.itemsize * element.count <= len(data):
        table = np.frombuffer(data, dtype=row, count=element.count, offset=start)
        fits = all(
            (table[f"{p.name} length"] == row[p.name].shape[0]).all()
            for p in element.properties
            if p.count
        )
        if fits:
            columns: dict[str, Any] = {}
            for p in element.properties:
                columns[p.name] = table[p.name]
                if p.count:
                    lengths = table[f"{p.name} length"].astype(np.int64)
                    columns[p.name] = (_integers(table[p.name].reshape(-1)), lengths)
            return columns, start + row.itemsize * element.count
    return _read_ragged(data, start, element)


def _row_type(data: bytes, start: int, element: _Element) -> np.dtype[Any]:
    """Layout of the first row, which fits all rows if their lists are of one length."""
    fields: list[Any] = []
    at = start
    for p in element.properties:
        if p.count:
            length = _length(data, at, p, element)
            fields += [(f"{p.name} length", p.count), (p.name, p.item, (length,))]
            at += np.dtype(p.count).itemsize + length * np.dtype(p.item).itemsize
        else:
            fields.append((p.name, p.item))
            at += np.dtype(p.item).itemsize
    return np.dtype(fields)


def _read_ragged(data: bytes, start: int, element: _Element) -> tuple[dict[str, Any], int]:
    """Row by row, for lists of unlike lengths."""
    values: dict[str, list[Any]] = {p.name: [] for p in element.properties}
    at = start
    for _ in range(element.count):
        for p in element.properties:
            length = 1
            if p.count:
                length = _length(data, at, p, element)
                at += np.dtype(p.count).itemsize
            size = length * np.dtype(p.item).itemsize
            if at + size > len(data):
                raise _early(element)
            values[p.name].append(np.frombuffer(data, p.item, length, at))
            at += size
    columns: dict[str, Any] = {}
    for p in element.properties:
        flat = np.concatenate(values[p.name])
        if p.count:
            lengths = np.array([len(x) for x in values[p.name]], dtype=np.int64)
            columns[p.name] = (_integers(flat), lengths)
        else:
            columns[p.name] = flat
    return columns, at


def _length(data: bytes, at: int, p: _Property, element: _Element) -> int:
    size = np.dtype(p.count).itemsize
    if at + size > len(data):
        raise _early(element)
    length = int(_integers(np.frombuffer(data, p.count, 1, at))[0])
    if length < 0 or at + size + length * np.dtype(p.item).itemsize > len(data):
        raise _early(element)
    return length


def _integers(values: NDArray[Any]) -> Ints:
    """As int64; what is no integer becomes -1."""
    if values.dtype.kind != "f":
        return values.astype(np.int64)
    good = np.isfinite(values) & (np.abs(values) < 2.0**62)
    return np.where(good, values, -1.0).astype(np.int64)


def _early(element: _Element) -> MeshError:
    return MeshError(
        f"{element.count} entries of {element.name!r} are announced, but the file ends early"
    )
