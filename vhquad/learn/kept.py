"""Predicted fields, kept by the content of the mesh and the model, and found without torch."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vhquad.cache import code_digest, content_key, default_cache_dir, read_arrays, write_arrays
from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.files import model_file

__all__ = ["kept_field"]

_ARRAYS = ("z", "size", "confidence")


def kept_field(
    mesh: TriMesh, model: Path | str | None, how: str, make: Callable[[], CrossField]
) -> CrossField:
    """The field that was made before of this mesh, with this model, by this code; else made now.

    Parameters
    ----------
    mesh : TriMesh
    model : path, optional
        As :func:`vhquad.nn.checkpoint.load_model` takes it.
    how : str
        Options of the prediction.
    make : callable
        Predicts the field, on the vertices with sizes and confidence. Others are not kept.
    """
    weights = model_file(model)
    about = weights.with_suffix(".json")
    if not (weights.is_file() and about.is_file()):
        return make()  # which says what is wrong
    key = content_key(
        [code_digest(), how], weights.read_bytes(), about.read_bytes(), mesh.vertices, mesh.faces
    )
    path = default_cache_dir() / f"field-{key}.npz"
    found = read_arrays(path, _ARRAYS)
    if found is not None:
        z, size, confidence = found
        n = mesh.n_vertices
        kinds = (z.dtype, size.dtype, confidence.dtype)
        if z.shape == size.shape == confidence.shape == (n,) and kinds == _KINDS:
            return CrossField("vertices", z, size, confidence)
    field = make()
    if field.domain == "vertices" and field.size is not None and field.confidence is not None:
        arrays = {"z": field.z, "size": field.size, "confidence": field.confidence}
        write_arrays(path, arrays)
    return field


_KINDS = (np.dtype(np.complex128), np.dtype(np.float64), np.dtype(np.float64))
