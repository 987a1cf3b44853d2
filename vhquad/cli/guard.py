"""What a command does when something goes wrong: one line on stderr and an exit code.

==== =========================================================================
code meaning
==== =========================================================================
0    done
1    an unexpected error; ``--debug`` shows the traceback
2    wrong usage, or an input that cannot be used; the message says what to do
3    the mesh made or checked is not a valid all-quad mesh
130  interrupted
==== =========================================================================
"""

from __future__ import annotations

import functools
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import typer

from vhquad.errors import VhquadError

__all__ = [
    "INTERRUPTED",
    "INVALID",
    "REFUSED",
    "UNEXPECTED",
    "Shell",
    "complain",
    "guarded",
    "warn",
]

UNEXPECTED, REFUSED, INVALID, INTERRUPTED = 1, 2, 3, 130

C = TypeVar("C", bound=Callable[..., None])


@dataclass(frozen=True)
class Shell:
    """The global options."""

    debug: bool = False
    quiet: bool = False


def guarded(command: C) -> C:
    """Wrap a command so that it ends with a line and an exit code, whatever happens."""

    @functools.wraps(command)
    def run(ctx: typer.Context, *args: Any, **kwargs: Any) -> None:
        shell = ctx.obj if isinstance(ctx.obj, Shell) else Shell()
        try:
            with warnings.catch_warnings():
                if not shell.debug:
                    warnings.showwarning = _show_warning
                command(ctx, *args, **kwargs)
        except (typer.Exit, typer.BadParameter):
            raise
        except BrokenPipeError:  # the reader of our output went away, as `| head` does
            raise typer.Exit(UNEXPECTED) from None
        except KeyboardInterrupt:
            _leave("interrupted", INTERRUPTED, shell)
        except VhquadError as error:
            _leave(f"error: {error}", REFUSED, shell)
        except MemoryError:
            _leave("error: out of memory; ask for fewer quads or decimate the input", 1, shell)
        except OSError as error:
            _leave(f"error: {error}", REFUSED, shell)
        except Exception as error:
            kind = type(error).__name__
            hint = "" if shell.debug else " (run with --debug for the traceback)"
            _leave(f"unexpected error: {kind}: {error}{hint}", UNEXPECTED, shell)

    return run  # type: ignore[return-value]


def complain(message: str) -> None:
    """One line on stderr."""
    typer.echo(f"vhquad: {' '.join(message.split())}", err=True)


def warn(message: str) -> None:
    """A warning of one line on stderr; not silenced by --quiet."""
    complain(f"warning: {message}")


def _leave(message: str, code: int, shell: Shell) -> None:
    if shell.debug:
        typer.echo(traceback.format_exc(), err=True)
    complain(message)
    raise typer.Exit(code) from None


def _show_warning(
    message: Warning | str, category: type[Warning], *args: Any, **kwargs: Any
) -> None:
    """Show what libraries warn of in one line, without their source code."""
    if not issubclass(category, DeprecationWarning | FutureWarning | ResourceWarning):
        warn(str(message))
