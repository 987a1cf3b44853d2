"""A folder of small quad meshes, and a dataset made of it once a session."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vhquad.learn.preprocess import PreprocessSettings
from vhquad.mesh.io import write_quad_mesh
from vhquad.mesh.quad import QuadMesh
from vhquad.nn.settings import ModelSettings

K = 24
SETTINGS = PreprocessSettings(vertices=(200, 260), val=0.0, k=K, deform=0.5)
MODEL = ModelSettings(
    in_channels=72,
    in_lines=6,
    channels=8,
    blocks=1,
    times=2,
    k=K,
    hidden_layers=1,
    head_terms=2,
    features="local",
)


def quad_torus(
    nu: int = 40, nv: int = 16, major: float = 2.0, minor: float = 1.0
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A torus about the z axis whose quads follow its circles."""
    u, v = np.meshgrid(_turn(nu), _turn(nv), indexing="ij")
    r = major + minor * np.cos(v)
    x = np.stack([r * np.cos(u), r * np.sin(u), minor * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    a, b = (i + 1) % nu, (j + 1) % nv
    quads = np.stack([i * nv + j, a * nv + j, a * nv + b, i * nv + b], axis=-1)
    return x, quads.reshape(-1, 4)


def _turn(n: int) -> NDArray[np.float64]:
    return np.arange(n) * (2.0 * np.pi / n)


def write_shapes(folder: Path, count: int = 3) -> None:
    """Tori of different thickness as OBJ files ring0.obj, ring1.obj, ..."""
    folder.mkdir(parents=True, exist_ok=True)
    for place in range(count):
        v, q = quad_torus(minor=0.6 + 0.2 * place)
        write_quad_mesh(folder / f"ring{place}.obj", QuadMesh(v, q))
