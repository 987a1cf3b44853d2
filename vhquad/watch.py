"""Watch: wall time by step."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

__all__ = ["Watch"]


@dataclass
class Watch:
    """Wall time by step: ``with watch("map"): ...`` adds to ``watch.seconds["map"]``."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, step: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.add({step: time.perf_counter() - start})

    def add(self, seconds: Mapping[str, float]) -> None:
        """Count what another watch has measured."""
        for step, value in seconds.items():
            self.seconds[step] = self.seconds.get(step, 0.0) + value
