"""HiGHS without its greeting, which newer versions write to the standard output when they start."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import highspy

__all__ = ["silent_solver"]


def silent_solver() -> highspy.Highs:
    """A solver that writes nothing, so that a report on the standard output stays JSON."""
    with _muted():
        solver = highspy.Highs()
    solver.silent()
    return solver


@contextmanager
def _muted() -> Iterator[None]:
    """Nothing that a library writes to the standard output meanwhile arrives there."""
    kept = None
    with suppress(OSError, ValueError, AttributeError):  # no standard output at all
        sys.stdout.flush()
        kept = os.dup(1)
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.close(null)
    try:
        yield
    finally:
        if kept is not None:
            os.dup2(kept, 1)
            os.close(kept)
