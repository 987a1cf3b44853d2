"""Dataclasses as plain JSON and back, led by their type hints."""

from __future__ import annotations

import json
import math
import os
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from vhquad.atomic import write_atomic
from vhquad.errors import ConfigError

__all__ = ["from_plain", "plain", "write_json"]


def plain(value: Any) -> Any:
    """Dataclasses, tuples, paths and numpy values as plain JSON values; NaN becomes null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def from_plain(kind: Any, value: Any, late: Mapping[str, Any] | None = None) -> Any:
    """The inverse of :func:`plain`, led by type hints.

    Parameters
    ----------
    kind : type
        A dataclass, or what may stand in its hints: a tuple, list, mapping, optional or number.
    value : object
        Plain JSON values.
    late : dict, optional
        Types named in hints that their module imports for type checking only.

    Raises
    ------
    ConfigError
        If the value does not fit.
    """
    origin, inner = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        return _dataclass_from(kind, value, late)
    if origin in (Union, types.UnionType):
        if value is None:
            return math.nan if type(None) not in inner else None
        return from_plain(next(k for k in inner if k is not type(None)), value, late)
    if origin in (tuple, list):
        made = [from_plain(inner[0] if inner else Any, item, late) for item in value]
        return made if origin is list else tuple(made)
    if origin is not None and issubclass(origin, Mapping):
        key_kind, item_kind = inner
        as_key = int if key_kind is int else str
        return {as_key(k): from_plain(item_kind, item, late) for k, item in value.items()}
    if kind is float:
        return math.nan if value is None else float(value)
    return value


def _dataclass_from(kind: type, value: Any, late: Mapping[str, Any] | None) -> Any:
    if not isinstance(value, Mapping):
        raise ConfigError(f"{kind.__name__}: a JSON object was expected, not {value!r}")
    hints = get_type_hints(kind, localns=dict(late or {}))
    try:
        return kind(
            **{name: from_plain(hints.get(name, Any), v, late) for name, v in value.items()}
        )
    except TypeError as error:
        raise ConfigError(f"{kind.__name__} does not fit: {error}") from None


def write_json(path: str | os.PathLike[str], value: Any) -> None:
    """Write a value, by its `to_dict` or :func:`plain`, as indented JSON, whole or not at all.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    content = value.to_dict() if hasattr(value, "to_dict") else plain(value)
    write_atomic(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")
