"""Failures that are not bad input, and how a command reports them."""

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
    """A run that began and could not go on, in one line."""


@contextlib.contextmanager
def no_exit() -> Iterator[None]:
    """Within it, whatever raises something that is no Exception has failed.

    Raises:
        RunError: Something did, as ``sys.exit`` in a user's block or in Drake. An
            interrupt becomes one, too: ``Interrupts.watched`` knows it.
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
    """One line about an exception that is no complaint about input."""
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
    """File and line that raised; the last of ours, where there is one."""
    frames = traceback.extract_tb(error.__traceback__)
    named = [(_inside(Path(frame.filename)), frame.lineno) for frame in frames]
    ours = [at for at in named if at[0].parts[0] in _OURS]
    path, line = (ours or named or [(Path("unknown"), 0)])[-1]
    return f"{path}:{line}"


def _inside(path: Path) -> Path:
    return path.relative_to(_ROOT) if _ROOT in path.parents else path
