"""From a mesh to the cross field that a trained network sees in it.

Each connected component is predicted by itself. The answers for the mesh and for its mirror image
are averaged, which makes a symmetric shape's field symmetric, and how far they agree makes the
confidence. Components above some size are predicted on a decimated proxy and the field is carried
back (``resolution="full"`` prevents that).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from vhquad.errors import ModelError
from vhquad.field.cross import CrossField
from vhquad.geometry.operators import OperatorSettings, load_or_build
from vhquad.learn.confidence import agreement, confidence
from vhquad.learn.device import choose_device
from vhquad.learn.proxy import Resolution, by_components
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import Model, load_model
from vhquad.nn.heads import LENGTH_UNIT
from vhquad.nn.inputs import NetworkInput, network_input, unstack
from vhquad.nn.network import VectorHeatNet
from vhquad.nn.settings import ModelSettings

__all__ = ["Prediction", "predict_field", "predict_input"]

SMALLEST = 5e-4  # quad edge over sqrt(area): four million quads
LARGEST = 10.0  # quad edge over the median of the mesh: more than any that an artist drew


@dataclass(frozen=True, eq=False)
class Prediction:
    """Raw answer at the vertices of one mesh.

    Attributes
    ----------
    z : (n,) complex128
        N-th power of the direction, not normalised.
    size : (n,) float64
        Length in units of the mesh, at most ``LARGEST`` times the median.
    agreement : (n,) float64
        cos of the angle between the answers for the mesh and for its mirror image, in [-1, 1];
        1 for a network that cannot tell one from the other.
    """

    z: NDArray[np.complex128]
    size: NDArray[np.float64]
    agreement: NDArray[np.float64]


def predict_field(
    mesh: TriMesh,
    model: Model | Path | str | None = None,
    resolution: Resolution = "auto",
    device: str = "auto",
    cache_dir: Path | str | None = None,
    cache: bool = True,
    on_component: Callable[[int, int], None] | None = None,
) -> CrossField:
    """Predict a cross field with quad sizes.

    Parameters
    ----------
    mesh : TriMesh
        Manifold, without unused vertices (see :mod:`vhquad.mesh.repair`).
    model : Model or path, optional
        The shipped model if not given.
    resolution : "auto" or "full"
        "auto" predicts large components on a proxy, see :func:`vhquad.learn.proxy.by_components`.
    device : str
        "auto" takes CUDA where there is one.
    cache_dir, cache
        Where operators are kept, and whether; see :func:`vhquad.geometry.operators.load_or_build`.
    on_component : callable, optional
        Called with (components done, components) after each.

    Returns
    -------
    CrossField
        On the vertices, with the confidence of :mod:`vhquad.learn.confidence`. All is 0 on
        components without area.

    Raises
    ------
    ModelError
        If the model cannot be read or does not predict crosses.
    MeshError
        If the mesh is not manifold.
    ConfigError
        If an option is unknown or the device does not exist.
    """
    chosen = model if isinstance(model, Model) else load_model(model)
    if chosen.settings.order != 4:
        raise ModelError(
            f"the model predicts fields of order {chosen.settings.order}; crosses need order 4"
        )
    target = choose_device(device)
    network = chosen.network.to(target)

    def on_surface(surface: TriMesh) -> CrossField:
        settings = operator_settings(chosen.settings)
        operators = load_or_build(surface, settings, cache_dir, cache)
        given = network_input(
            operators.mass,
            operators.eigenvalues,
            operators.eigenvectors,
            operators.features,
            operators.lines,
            k=chosen.settings.k,
        )
        answer = predict_input(network, given.to(target))
        trusted = confidence(surface, answer.agreement)
        return CrossField("vertices", answer.z, answer.size, trusted)

    return by_components(mesh, on_surface, on_surface, resolution, on_component=on_component)


def predict_input(network: VectorHeatNet, mesh: NetworkInput) -> Prediction:
    """The network's answer for a prepared mesh, averaged with that for its mirror image."""
    network.eval()
    with torch.inference_mode():
        own, other = network(mesh), network(mesh.mirror_image())
    size = torch.sqrt(own.size * other.size).cpu().double().numpy()
    # A sphere has no features, and an untrained network then no size either: take a common one.
    size = np.where(size > SMALLEST, size, LENGTH_UNIT) * mesh.length
    # On shapes that it does not know the network may exceed all bounds.
    size = np.minimum(size, LARGEST * np.median(size))
    z, mirrored = unstack(own.z), unstack(other.z)
    return Prediction(0.5 * (z + mirrored), size, agreement(z, mirrored))


def operator_settings(settings: ModelSettings) -> OperatorSettings:
    """The operators that a model takes."""
    return OperatorSettings(k=settings.k, features=settings.features, turned=settings.turned)
