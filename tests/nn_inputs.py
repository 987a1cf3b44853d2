"""Network inputs made from small meshes, and how to compare fields in unlike frames."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from tests.meshes import blob
from vhquad.geometry.frames import build_frames
from vhquad.geometry.operators import Operators, OperatorSettings, build_operators
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.inputs import NetworkInput, network_input, unstack
from vhquad.nn.network import VectorHeatNet
from vhquad.nn.settings import ModelSettings

K = 40

Complexes = NDArray[np.complex128]


def small_settings(**changes: object) -> ModelSettings:
    """A network that runs in milliseconds."""
    values: dict[str, object] = {"channels": 16, "blocks": 2, "times": 3, "k": K, "head_terms": 3}
    return ModelSettings(**{**values, **changes})  # type: ignore[arg-type]


def random_network(settings: ModelSettings, dtype: torch.dtype = torch.float64) -> VectorHeatNet:
    """All weights random, the head's gates too."""
    torch.manual_seed(7)
    network = VectorHeatNet(settings)
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            if "gates" in name:
                parameter.normal_(std=0.2)
    return network.to(dtype).eval()


LOCAL: dict[str, object] = {"features": "local", "in_channels": 72, "in_lines": 6}
"""Settings of a network that takes local features, with lines."""


@lru_cache(maxsize=4)
def blob_operators(features: str = "hks") -> Operators:
    """Operators of a lumpy sphere of 642 vertices without symmetry."""
    return operators_of(blob(3), features)


def operators_of(mesh: TriMesh, features: str = "hks") -> Operators:
    return build_operators(mesh, OperatorSettings(k=K, features=features))


def as_input(operators: Operators, dtype: torch.dtype = torch.float64) -> NetworkInput:
    return network_input(
        operators.mass,
        operators.eigenvalues,
        operators.eigenvectors,
        operators.features,
        operators.lines,
        dtype=dtype,
        k=K,
    )


def answer(network: VectorHeatNet, mesh: NetworkInput) -> tuple[Complexes, NDArray[np.float64]]:
    """Unit z and the size in units of the mesh."""
    with torch.no_grad():
        out = network(mesh)
    z = unstack(out.z)
    return z / np.abs(z), out.size.double().numpy() * mesh.length


def from_halfedges(z: Complexes, mesh: TriMesh, order: int) -> Complexes:
    """The field at each halfedge's tail, measured from that halfedge: free of frames; (3m,)."""
    return np.asarray(z[mesh.tail] * np.exp(-1j * order * build_frames(mesh).halfedge_angle))
