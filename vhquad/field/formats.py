"""The text of field files, as arrays: .ffield, .vfield, .rosy, .rawfield, .dmat and NeurCross .txt.

Nothing here knows a mesh. Reading gives ``directions (n, d, 3)``: d vectors of each of n elements
as they stand in the file. Writing takes the four vectors of each element, counter-clockwise.

Read off the programs that use them: vcglib (``wrap/io_trimesh/import_field.h``: .ffield, .vfield,
.rosy), Directional (``write_raw_field.h``), libigl (``readDMAT.cpp``), NeurCross
(``utils/utils.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import FieldError

__all__ = ["READERS", "WRITERS", "Rows"]

Floats = NDArray[np.float64]

COLUMNS = "k1\t k2\t k1v_x\t k1v_y\t k1v_z\t k2v_x\t k2v_y\t k2v_z"


@dataclass(frozen=True, eq=False)
class Rows:
    """What a file holds.

    Attributes
    ----------
    directions : (n, d, 3) float64
    line : int
        Line in which the file says how many elements it has; 0 if it does not say.
    element : (n,) int64 or None
        Which element each row is of, where the file says so.
    """

    directions: Floats
    line: int
    element: NDArray[np.int64] | None = None


# ---- reading -------------------------------------------------------------------------------


def read_ffield(path: Path) -> Rows:
    """.ffield and .vfield: a comment, a title, the count, column names, then eight numbers a row.

    One more title line is tolerated. The two principal values at the start of a row mean nothing.
    """
    lines = _lines(path)
    if not lines or not lines[0].lstrip().startswith("#"):
        raise FieldError(f"{path}, line 1: a field file starts with '#'")
    at = 2 if len(lines) > 2 and _is_count(lines[2]) else 3
    count = _count(path, lines, at)
    numbers = _table(path, lines, at + 2, count, 8)
    return Rows(numbers[:, 2:].reshape(-1, 2, 3), at + 1)


def read_rosy(path: Path) -> Rows:
    """.rosy: the count, the order 4, then one vector a row."""
    lines = _lines(path)
    count, order = _count(path, lines, 0), _count(path, lines, 1)
    if order != 4:
        raise FieldError(f"{path}, line 2: a cross field has order 4, not {order}")
    return Rows(_table(path, lines, 2, count, 3).reshape(-1, 1, 3), 1)


def read_rawfield(path: Path) -> Rows:
    """.rawfield: the number N of directions and the count, then 3 N numbers a row."""
    lines = _lines(path)
    head = lines[0].split() if lines else []
    if len(head) != 2 or not all(_is_count(word) for word in head):
        raise FieldError(
            f"{path}, line 1: a .rawfield starts with two numbers, directions and rows"
        )
    n, count = int(head[0]), int(head[1])
    if n not in (1, 2, 4):
        raise FieldError(f"{path}, line 1: a cross has 1, 2 or 4 directions in a file, not {n}")
    return Rows(_table(path, lines, 1, count, 3 * n).reshape(-1, n, 3), 1)


def read_dmat(path: Path) -> Rows:
    """.dmat: a matrix by columns, ASCII or binary, of 3, 6, 7 or 12 columns.

    Seven columns are the index of the element and two directions, as libigl's constraint files.
    """
    data = path.read_bytes()
    first, _, rest = data.partition(b"\n")
    if first.split() == [b"0", b"0"]:
        shape, _, rest = rest.partition(b"\n")
        columns, rows = _shape(path, shape, 2)
        if len(rest) != 8 * columns * rows:
            raise FieldError(
                f"{path}, line 3: {rows} x {columns} numbers take {8 * columns * rows} bytes, "
                f"not {len(rest)}"
            )
        matrix = np.frombuffer(rest, dtype="<f8").reshape(columns, rows).T
        line = 2
    else:
        columns, rows = _shape(path, first, 1)
        lines = _lines(path)
        matrix = _table(path, lines, 1, columns, rows).T
        line = 1
    if columns not in (3, 6, 7, 12):
        raise FieldError(f"{path}, line {line}: a field has 3, 6, 7 or 12 columns, not {columns}")
    element = None
    if columns == 7:
        with np.errstate(invalid="ignore"):
            element = np.nan_to_num(matrix[:, 0], nan=-1, posinf=-1, neginf=-1).astype(np.int64)
        matrix = matrix[:, 1:]
    directions = np.ascontiguousarray(matrix, dtype=np.float64)
    return Rows(directions.reshape(rows, -1, 3), line, element)


def read_neurcross(path: Path) -> Rows:
    """NeurCross .txt: two directions a row, no header."""
    lines = _lines(path)
    count = sum(1 for line in lines if line.strip())
    return Rows(_table(path, lines, 0, count, 6).reshape(-1, 2, 3), 0)


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8", errors="replace").splitlines()


def _is_count(text: str) -> bool:
    word = text.strip()
    return word.isascii() and word.isdigit() and len(word) < 13


def _count(path: Path, lines: list[str], at: int) -> int:
    text = lines[at].strip() if at < len(lines) else ""
    if not _is_count(text):
        raise FieldError(
            f"{path}, line {at + 1}: expected a number of elements, found {text[:40]!r}"
        )
    return int(text)


def _shape(path: Path, text: bytes, line: int) -> tuple[int, int]:
    words = text.decode("ascii", errors="replace").split()
    if len(words) != 2 or not all(_is_count(word) for word in words):
        raise FieldError(f"{path}, line {line}: a .dmat starts with two numbers, columns and rows")
    return int(words[0]), int(words[1])


def _table(path: Path, lines: list[str], start: int, rows: int, columns: int) -> Floats:
    """The numbers from a line on, however they are spread over lines; (rows, columns)."""
    words = " ".join(lines[start:]).split()
    if len(words) != rows * columns:
        raise FieldError(
            f"{path}, line {start + 1} on: {rows} times {columns} make {rows * columns} numbers, "
            f"the file has {len(words)}"
        )
    try:
        return np.array(words, dtype=np.float64).reshape(rows, columns)
    except ValueError:
        for number, line in enumerate(lines[start:], start + 1):
            for word in line.split():
                try:
                    float(word)
                except ValueError:
                    raise FieldError(f"{path}, line {number}: {word[:40]!r} is no number") from None
        raise


# ---- writing -------------------------------------------------------------------------------


def write_ffield(directions: Floats) -> str:
    """.ffield or .vfield; the first and second direction of each element."""
    head = f"# cross field by vhquad\ntarget_frame\n{len(directions)}\n{COLUMNS}\n"
    pair = directions[:, :2].reshape(-1, 6)
    return head + _text(np.column_stack([np.ones((len(pair), 2)), _unit(pair)]))


def write_rosy(directions: Floats) -> str:
    """.rosy; the first direction of each element."""
    first = directions[:, 0] / np.linalg.norm(directions[:, 0], axis=1, keepdims=True)
    return f"{len(directions)}\n4\n" + _text(first)


def write_rawfield(directions: Floats) -> str:
    """.rawfield; four directions with their lengths."""
    return f"4 {len(directions)}\n" + _text(directions.reshape(-1, 12))


def write_dmat(directions: Floats) -> str:
    """.dmat of seven columns: index, first and second direction with their lengths."""
    n = len(directions)
    matrix = np.column_stack([np.arange(n, dtype=np.float64), directions[:, :2].reshape(-1, 6)])
    return f"7 {n}\n" + _text(matrix.T.reshape(-1, 1))


def _unit(pairs: Floats) -> Floats:
    split = pairs.reshape(-1, 2, 3)
    return (split / np.linalg.norm(split, axis=2, keepdims=True)).reshape(-1, 6)


def _text(rows: Floats) -> str:
    """One line a row, 17 significant digits: doubles come back as they were."""
    line = " ".join(["%.17g"] * rows.shape[1])
    return "".join(line % tuple(row) + "\n" for row in rows.tolist())


READERS: dict[str, Callable[[Path], Rows]] = {
    ".ffield": read_ffield,
    ".vfield": read_ffield,
    ".rosy": read_rosy,
    ".rawfield": read_rawfield,
    ".dmat": read_dmat,
    ".txt": read_neurcross,
}
WRITERS: dict[str, Callable[[Floats], str]] = {
    ".ffield": write_ffield,
    ".vfield": write_ffield,
    ".rosy": write_rosy,
    ".rawfield": write_rawfield,
    ".dmat": write_dmat,
}
