"""What a model sees in a mesh, with the curvature's help; kept by content, and found without torch.

Answers of the network about proxies are kept too: all stand-ins of a mesh ask about the same.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vhquad.cache import code_digest, content_key, default_cache_dir, read_arrays, write_arrays
from vhquad.field.cross import CrossField
from vhquad.learn.blend import lean_on_curvature
from vhquad.learn.proxy import Resolution, by_components
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.files import model_file

if TYPE_CHECKING:
    from vhquad.nn.checkpoint import Model

__all__ = ["predicted_field"]

_ARRAYS = ("z", "size", "confidence")
_KINDS = (np.dtype(np.complex128), np.dtype(np.float64), np.dtype(np.float64))


def predicted_field(
    mesh: TriMesh,
    model: Model | Path | str | None = None,
    *,
    resolution: Resolution = "auto",
    device: str = "auto",
    cache: bool = True,
    of: TriMesh | None = None,
    on_component: Callable[[int, int], None] | None = None,
) -> CrossField:
    """The network's field, leaning on the curvature's where it is not sure.

    Parameters are those of :func:`vhquad.api.predict`.
    """

    @functools.cache
    def loaded() -> Model:
        from vhquad.nn.checkpoint import load_model

        return load_model(model) if model is None or isinstance(model, str | Path) else model

    def ask(surface: TriMesh) -> CrossField:
        from vhquad.learn.predict import predict_field

        return predict_field(surface, loaded(), "full", device, cache=cache)

    def keep(
        surface: TriMesh, what: str, make: Callable[[], CrossField], of: TriMesh | None = None
    ) -> CrossField:
        if cache and (model is None or isinstance(model, str | Path)):
            return _kept(surface, model, f"{what} {device}", make, of)
        return make()

    def ask_once(proxy: TriMesh) -> CrossField:
        return keep(proxy, "network", lambda: ask(proxy))

    def make() -> CrossField:
        field = by_components(mesh, ask, ask_once, resolution, of, on_component)
        return lean_on_curvature(mesh, field)

    return keep(mesh, resolution, make, of)


def _kept(
    mesh: TriMesh,
    model: Path | str | None,
    how: str,
    make: Callable[[], CrossField],
    of: TriMesh | None = None,
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
    of : TriMesh, optional
        What else the prediction saw: the mesh that this one stands for.
    """
    weights = model_file(model)
    about = weights.with_suffix(".json")
    if not (weights.is_file() and about.is_file()):
        return make()  # which says what is wrong
    seen = [mesh.vertices, mesh.faces]
    if of is not None:
        seen += [of.vertices, of.faces]
    key = content_key([code_digest(), how], weights.read_bytes(), about.read_bytes(), *seen)
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
