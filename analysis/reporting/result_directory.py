"""Result directories that appear whole or not at all, and belong to one process."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from systems.framework.input_error import InputError, shortened

#: Parent of numbered directories.
_BASE = "results"


class ResultDirectory:
    """An empty directory that no other process can take; see ``take_directory``."""

    def __init__(self, path: Path, made: list[Path]) -> None:
        """Locks a directory that exists.

        Args:
            path: The directory.
            made: Directories that were made for it, innermost first.

        Raises:
            InputError: Another process has it, or it is not empty any more.
        """
        self.path = path
        self._made = made
        self._lock = -1
        try:
            self._lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            taken = any(path.iterdir())
        except BlockingIOError:
            taken = True
        except OSError as error:
            self.undo()
            raise _cannot(path, error) from None
        if taken:
            self.undo()
            raise _refused(f"another process writes to {path}")

    def close(self) -> None:
        """Lets other processes have it."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def undo(self, *, contents: bool = False) -> None:
        """Removes what was made for it, its parents too, where nothing else is in.

        Args:
            contents: Whether it goes with all that it holds, if it was made.
        """
        if contents and self.path in self._made:
            shutil.rmtree(self.path, ignore_errors=True)
        for folder in self._made:
            with suppress(OSError):
                folder.rmdir()
        self.close()


def take_directory(out: str | Path | None) -> ResultDirectory:
    """Takes the directory that results go to, before anything runs.

    Args:
        out: A directory that does not exist yet, or is empty; none: the next
            number under ``results``.

    Returns:
        The directory, which exists, is empty, and belongs to this process.

    Raises:
        InputError: It is in use, or cannot be made or written.
    """
    if out is not None:
        path = check_directory(out)
        return ResultDirectory(path, _make(path))
    return ResultDirectory(*_make_number(check_directory(_BASE, parent=True)))


@contextmanager
def whole_directory(out: str | Path | None) -> Iterator[tuple[Path, Path]]:
    """The directory of ``take_directory``, with a hidden one to write to.

    The hidden one takes the other's place at the end. If the block raises,
    KeyboardInterrupt included, nothing stays behind: not even parents that were
    made for it.

    Args:
        out: As of ``take_directory``.

    Yields:
        The directory as it will be called, and the hidden one.

    Raises:
        InputError: As ``take_directory``.
    """
    taken = take_directory(out)
    path, partial = taken.path, None
    shown = Path(_BASE) / path.name if out is None else Path(out).expanduser()
    try:
        try:
            partial = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        except OSError as error:
            raise _cannot(path, error) from None
        yield shown, partial
        partial.chmod(0o777 & ~_umask())
        partial.rename(path)
    except BaseException:
        if partial is not None:
            shutil.rmtree(partial, ignore_errors=True)
        taken.undo()
        raise
    taken.close()


def check_directory(out: str | Path, *, parent: bool = False) -> Path:
    """The whole path, with all links followed, if a new directory may be there.

    Args:
        out: What the user named.
        parent: Whether it may hold something: the directory goes below it.

    Returns:
        An absolute path.

    Raises:
        InputError: It is in use, or cannot be made or written.
    """
    shown = shortened(str(out), 80)
    try:
        path = Path(out).expanduser().resolve()
        str(path).encode()
        is_file = path.exists() and not path.is_dir()
        is_empty = parent or not path.is_dir() or not any(path.iterdir())
        is_fixed = not parent and (path == Path.cwd() or path.is_mount())
    except UnicodeEncodeError:
        raise _refused(f"{shown} is not UTF-8") from None
    except (OSError, RuntimeError, ValueError) as error:
        # Names too long, home directories of nobody, and zero bytes.
        reason = getattr(error, "strerror", None) or error
        raise _refused(f"{shown} is not a usable path ({reason})") from None
    if is_file:
        raise InputError("out", f"{shown} is a file; name a directory")
    if is_fixed:
        raise InputError(
            "out", f"{shown!r} cannot be replaced; name a directory that does not exist"
        )
    if not is_empty:
        raise _refused(f"{shown} is not empty")
    above = path.parent
    while not above.exists():
        above = above.parent
    if not above.is_dir():
        raise _refused(f"{above} is a file")
    for folder in (path,) if parent and path.exists() else (above, path):
        if folder.exists() and not os.access(folder, os.W_OK | os.X_OK):
            raise _refused(f"{folder} cannot be written")
    return path


def _make(path: Path) -> list[Path]:
    """What had to be made, innermost first."""
    missing = [p for p in (path, *path.parents) if not p.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _cannot(path, error) from None
    return missing


def _make_number(base: Path) -> tuple[Path, list[Path]]:
    """The next number that nobody else has taken meanwhile."""
    made = _make(base)
    numbers = [int(p.name) for p in base.glob("[0-9]*") if p.name.isdecimal()]
    number = max(numbers, default=0)
    while True:
        number += 1
        path = base / f"{number:04d}"
        try:
            path.mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise _cannot(path, error) from None
        return path, [path, *made]


def _cannot(path: Path, error: OSError) -> InputError:
    return _refused(f"{path} cannot be made ({error.strerror})")


def _refused(why: str) -> InputError:
    return InputError("out", f"{why}; name another directory")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
