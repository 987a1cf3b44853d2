"""A sheet that bends without stretching, and a small network that learns a field on it flat."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from vhquad.field.cross import CrossField
from vhquad.geometry.frames import from_3d, vertex_axes
from vhquad.geometry.operators import OperatorSettings, build_operators
from vhquad.learn.predict import predict_input
from vhquad.learn.schedule import TrainSettings, learning_rate
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.inputs import NetworkInput, network_input, stack
from vhquad.nn.loss import FieldTruth, field_loss
from vhquad.nn.network import VectorHeatNet
from vhquad.nn.settings import ModelSettings

Floats = NDArray[np.float64]

STEPS, K = 300, 64


def folded_sheet(fold: float, across: int = 6, along: int = 6, fine: int = 8) -> TriMesh:
    """Miura's folding of parallelograms, by an angle from 0 (flat) towards pi/2; an isometry.

    Each panel keeps its shape, so that all triangles of all foldings are congruent.
    """
    slant, a, b = np.radians(60.0), 1.0, 1.0
    s, c = np.sin(fold), np.cos(fold)
    stretch = np.sqrt(1.0 + (c * np.tan(slant)) ** 2)
    lift, step = a * s * np.sin(slant), b * c * np.tan(slant) / stretch
    advance, zigzag = a * np.sqrt(1.0 - (s * np.sin(slant)) ** 2), b / stretch
    i, j = np.meshgrid(np.arange(along * fine + 1), np.arange(across * fine + 1), indexing="ij")
    u, v = i / fine, j / fine  # panels are linear between whole numbers

    def saw(t: Floats) -> Floats:
        return np.abs((t + 1.0) % 2.0 - 1.0)

    points = np.stack([v * step, u * advance + saw(v) * zigzag, saw(u) * lift], axis=-1)
    width = across * fine + 1
    corner = (i * width + j)[:-1, :-1].reshape(-1)
    quads = corner[:, None] + np.array([0, 1, width + 1, width])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return TriMesh(points.reshape(-1, 3), faces)


def rolled(flat: TriMesh) -> TriMesh:
    """Three quarters of a turn about y, the front outside."""
    x, y = flat.vertices[:, 0], flat.vertices[:, 1]
    radius = np.ptp(x) / np.radians(270.0)
    angle = (x - x.mean()) / radius
    points = np.stack([x.mean() + radius * np.sin(angle), y, radius * np.cos(angle)], axis=1)
    return TriMesh(points, flat.faces)


def _input(mesh: TriMesh) -> NetworkInput:
    made = build_operators(mesh, OperatorSettings(k=K, features="hks", turned=True))
    return network_input(made.mass, made.eigenvalues, made.eigenvectors, made.features)


def answer(network: VectorHeatNet, mesh: TriMesh) -> CrossField:
    """The network's field of the sheet in some state."""
    found = predict_input(network, _input(mesh))
    return CrossField("vertices", found.z, found.size)


def train(flat: TriMesh) -> tuple[VectorHeatNet, float]:
    """A small network that learns one field of the sheet; it need not be a good one."""
    given = _input(flat)
    p = (flat.vertices - flat.vertices.mean(axis=0))[:, :2]
    p = p / np.ptp(p, axis=0)
    angle = 0.7 * np.cos(2.0 * np.pi * p[:, 0]) + 3.0 * p[:, 0] * p[:, 1]
    direction = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    u = from_3d(direction[:, None], vertex_axes(flat))[:, 0]
    n = flat.n_vertices
    size = torch.full((n,), 0.02)
    truth = FieldTruth(stack((u / np.abs(u)) ** 4), size, given.mass)
    channels = given.features.shape[2]
    torch.manual_seed(0)
    network = VectorHeatNet(
        ModelSettings(in_channels=channels, channels=48, blocks=3, k=K, hidden_layers=1)
    )
    settings = TrainSettings(steps=STEPS, rate=3e-3)
    optimizer = torch.optim.AdamW(network.parameters(), weight_decay=settings.weight_decay)
    for step in range(STEPS):
        for group in optimizer.param_groups:
            group["lr"] = learning_rate(settings, step)
        loss = field_loss(network(given), truth)
        optimizer.zero_grad()
        loss.total.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), settings.clip)
        optimizer.step()
    return network.eval(), float(field_loss(network(given), truth).direction.detach())
