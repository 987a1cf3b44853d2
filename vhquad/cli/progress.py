"""Progress on stderr, on terminals only: a line that says what runs, how far it is, since when."""

from __future__ import annotations

import sys
from types import TracebackType

__all__ = ["Progress"]


class Progress:
    """A context with one line of progress; call it with (what runs, share done in [0, 1]).

    A share that is not known is given as None and shown by a moving bar.
    """

    def __init__(self, quiet: bool, start: str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as RichProgress

        self._bar = RichProgress(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.fields[note]}", markup=False),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            transient=True,
            disable=quiet or not sys.stderr.isatty(),
        )
        self._task = self._bar.add_task(start, total=None, note="")

    def __enter__(self) -> Progress:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def __call__(self, what: str, share: float | None = None, note: str = "") -> None:
        """Say what runs now."""
        total = None if share is None else 1.0
        done = min(share or 0.0, 0.999)  # a finished bar would stop its clock
        self._bar.update(self._task, description=what, total=total, completed=done, note=note)
