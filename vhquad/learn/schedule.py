"""TrainSettings, and what follows from them and a step's number alone: rate, order, mirroring.

Everything random in training is a function of (seed, step), never of a generator's state: a run
that was stopped and resumed sees exactly what the uninterrupted run would have seen.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, get_args

import numpy as np

from vhquad.errors import ConfigError

Precision = Literal["float32", "bfloat16"]
Weighting = Literal["edges", "area"]

__all__ = ["TrainSettings", "learning_rate", "mirrored", "sample_of_step"]


@dataclass(frozen=True)
class TrainSettings:
    """How a model is trained.

    Attributes
    ----------
    steps : int
        Optimiser steps, one mesh each.
    rate : float
        Peak learning rate of the one-cycle schedule.
    warmup : float
        Share of the steps in which the rate rises to its peak.
    weight_decay : float
        AdamW's.
    clip : float
        Largest norm of the gradient.
    ema : float
        Decay of the averaged weights, the ones that are kept.
    mirror : bool
        Show every other mesh as its mirror image.
    precision : "float32" or "bfloat16"
        Of the matrix products while training. bfloat16 takes 0.4 of the time on processors that
        have it (AVX-512 BF16, AMX, GPUs of 2020 on), more on others. Validation is in float32.
    weigh : "edges" or "area"
        What a vertex counts by: the length of the artist's edges around it, or its area, as in the
        paper and in validation.
    seed : int
    validate_every, save_every : int
        Steps between validations and between checkpoints.
    """

    steps: int = 20_000
    rate: float = 1e-3
    warmup: float = 0.1
    weight_decay: float = 1e-4
    clip: float = 1.0
    ema: float = 0.998
    mirror: bool = True
    precision: Precision = "float32"
    weigh: Weighting = "edges"
    seed: int = 0
    validate_every: int = 1000
    save_every: int = 250

    def __post_init__(self) -> None:
        for name in ("steps", "validate_every", "save_every"):
            if getattr(self, name) < 1:
                raise ConfigError(f"--{name.replace('_', '-')} must be at least 1")
        if self.rate <= 0 or self.clip <= 0 or self.weight_decay < 0:
            raise ConfigError("--rate and --clip must be positive, --weight-decay not negative")
        if self.precision not in get_args(Precision):
            raise ConfigError(f"--precision must be float32 or bfloat16, not {self.precision!r}")
        if self.weigh not in get_args(Weighting):
            raise ConfigError(f"weigh must be edges or area, not {self.weigh!r}")
        if not (0.0 <= self.warmup < 1.0 and 0.0 <= self.ema < 1.0):
            raise ConfigError("--warmup and --ema must lie in [0, 1)")

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> TrainSettings:
        """From plain JSON values; unknown names raise ConfigError."""
        foreign = sorted(set(values) - {f.name for f in fields(cls)})
        if foreign:
            raise ConfigError(f"unknown training settings: {', '.join(foreign)}")
        return cls(**values)


def learning_rate(settings: TrainSettings, step: int) -> float:
    """One cycle: a linear rise to the peak, then half a cosine down to a thousandth of it."""
    rise = max(1.0, settings.warmup * settings.steps)
    if step < rise:
        return settings.rate * (step + 1) / (rise + 1)
    progress = min(1.0, (step - rise) / max(1.0, settings.steps - rise))
    low = 1e-3
    return settings.rate * (low + (1.0 - low) * 0.5 * (1.0 + math.cos(math.pi * progress)))


def sample_of_step(settings: TrainSettings, step: int, n_samples: int) -> int:
    """Which training sample a step sees: each once an epoch, in a new order every epoch."""
    epoch, place = divmod(step, n_samples)
    order = np.random.default_rng([settings.seed, 1, epoch]).permutation(n_samples)
    return int(order[place])


def mirrored(settings: TrainSettings, step: int) -> bool:
    """Whether a step sees the mirror image."""
    return settings.mirror and bool(np.random.default_rng([settings.seed, 2, step]).random() < 0.5)
