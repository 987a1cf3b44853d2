"""Settings that all tests share: repeatable property tests and a fixed random generator."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, settings

from tests.command_line import Invoke, invoke_with

settings.register_profile(
    "vhquad",
    deadline=None,
    derandomize=True,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("vhquad")
torch.set_num_threads(1)  # small meshes; more threads wait for each other


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed, fresh for each test."""
    return np.random.default_rng(20240607)


@pytest.fixture
def invoke(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[Invoke]:
    """A function that runs a command of vhquad in this process, with a cache folder of its own."""
    handler = signal.getsignal(signal.SIGTERM)
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path / "cache"))
    yield invoke_with(capsys)
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture(scope="session")
def small_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a small network with random weights, which predicts in milliseconds."""
    from tests.nn_inputs import random_network, small_settings
    from vhquad.nn.checkpoint import Model, save_model

    path = tmp_path_factory.mktemp("model") / "model.safetensors"
    save_model(path, Model(random_network(small_settings(), torch.float32)))
    return path
