"""Failures other than bad input, and their messages to the user."""

from __future__ import annotations

import contextlib
import errno
import traceback
from collections.abc import Iterator
from pathlib import Path

from systems.framework.input_error import LONGEST_MESSAGE, shortened

_ROOT = Path(__file__).resolve().parents[1]
_OURS = ("systems", "diagrams", "analysis", "phonotaxis")


class RunError(Exception):
    """A run started but could not continue; the message has one line."""


@contextlib.contextmanager
def no_exit() -> Iterator[None]:
    """Turns any attempt to end the process within the ``with`` block into an error.

    For example, code of a user or of Drake may call ``sys.exit``. The function converts
    every exception that is not an ``Exception``, including interrupts.
    ``Interrupts.watched`` later recognizes the interrupts.

    Raises:
        RunError: The block raised such an exception.
    """
    try:
        yield
    except Exception:
        raise
    except BaseException as error:
        kind, last = type(error).__name__, traceback.extract_tb(error.__traceback__)[-1]
        place = f"{_inside(Path(last.filename))}:{last.lineno}"
        text = f"the command was ended from within, by {kind} in {place}"
        raise RunError(text) from error


def failure_text(error: Exception) -> str:
    """Describes an exception other than an input error in one line."""
    if isinstance(error, RunError):
        text = str(error)
    elif isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        where = f" {error.filename}" if error.filename else ""
        text = (
            f"cannot write{where} ({error.strerror}); free space on the disk, and try "
            "again"
        )
    else:
        text = f"{type(error).__name__} in {_where(error)}: {error}"
        text = f"{shortened(text, LONGEST_MESSAGE - 60)} (--debug prints the traceback)"
    return shortened(text, LONGEST_MESSAGE)


def _where(error: BaseException) -> str:
    """File and line that raised the exception; prefers the last of our own files."""
    frames = traceback.extract_tb(error.__traceback__)
    named = [(_inside(Path(frame.filename)), frame.lineno) for frame in frames]
    ours = [at for at in named if at[0].parts[0] in _OURS]
    path, line = (ours or named or [(Path("unknown"), 0)])[-1]
    return f"{path}:{line}"


def _inside(path: Path) -> Path:
    return path.relative_to(_ROOT) if _ROOT in path.parents else path
