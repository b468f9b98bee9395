"""Result directories that appear complete or not at all, and belong to one process."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from systems.framework.input_error import InputError, shortened

#: Parent directory of the numbered result directories.
RESULTS = "results"
#: Link in this directory to the last result directory.
LATEST = "latest"


class ResultDirectory:
    """An empty directory that no other process can take; see ``take_directory``."""

    def __init__(self, path: Path, made: list[Path]) -> None:
        """Locks an existing directory.

        The list ``made`` contains those of the directory and its parents that this
        process has created, innermost first. ``undo`` removes them. Raises InputError
        if another process has locked the directory, or if it is no longer empty.
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
        """Unlocks the directory, so that other processes can take it."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def undo(self, *, contents: bool = False) -> None:
        """Unlocks the directory, and removes it if this process created it.

        Parent directories that this process created are removed, too. Directories that
        are not empty are kept. With ``contents``, the result directory is removed
        together with its contents.
        """
        if contents and self.path in self._made:
            shutil.rmtree(self.path, ignore_errors=True)
        for folder in self._made:
            with suppress(OSError):
                folder.rmdir()
        self.close()


def take_directory(out: str | Path | None) -> ResultDirectory:
    """Creates and locks the result directory before any computation starts.

    If ``out`` is None, the directory is the next number under ``results``. After the
    call, the directory exists, is empty, and belongs to this process. For the errors,
    see ``check_directory``.
    """
    if out is not None:
        path = check_directory(out)
        return ResultDirectory(path, _make(path))
    return ResultDirectory(*_make_number(check_directory(RESULTS, parent=True)))


@contextmanager
def whole_directory(out: str | Path | None) -> Iterator[tuple[Path, Path]]:
    """Yields the path of the result directory for messages, and a hidden directory.

    The caller writes all files into the hidden directory. At the end of the ``with``
    block, the hidden directory replaces the result directory. If the block raises an
    exception, including KeyboardInterrupt, all new directories are removed. This also
    applies to parent directories that were created. For ``out``, see
    ``take_directory``.
    """
    taken = take_directory(out)
    path, partial = taken.path, None
    shown = Path(RESULTS) / path.name if out is None else Path(out).expanduser()
    try:
        try:
            partial = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        except OSError as error:
            raise _cannot(path, error) from None
        yield shown, partial
        partial.chmod(0o777 & ~_umask())
        partial.rename(path)
        point_latest(path)
    except BaseException:
        if partial is not None:
            shutil.rmtree(partial, ignore_errors=True)
        taken.undo()
        raise
    taken.close()


def point_latest(path: Path) -> None:
    """Makes ``results/latest`` a link to a numbered result directory.

    Other result directories have no such link. Nor have file systems without links.
    """
    if path.parent != Path(RESULTS).resolve() or not path.name.isdecimal():
        return
    new = path.parent / f".{LATEST}.{path.name}"
    with suppress(OSError):
        # A link that moves into place is never missing while another process reads it.
        new.symlink_to(path.name)
        new.replace(path.parent / LATEST)
    with suppress(OSError):
        new.unlink(missing_ok=True)


def numbered_results() -> list[Path]:
    """Lists the numbered result directories under ``results`` in order."""
    found = [path for path in Path(RESULTS).glob("[0-9]*") if path.name.isdecimal()]
    return sorted((path for path in found if path.is_dir()), key=lambda p: int(p.name))


def check_directory(out: str | Path, *, parent: bool = False) -> Path:
    """Checks that a new directory can be created, and resolves its path.

    If ``parent`` is true, ``out`` is the parent of the new directory and may contain
    files. Raises InputError if the directory is not empty, or cannot be created or
    written.
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
        # The name is too long or has zero bytes, or "~user" names no user.
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
    """Creates a directory; returns all directories that it created, innermost first."""
    missing = [p for p in (path, *path.parents) if not p.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _cannot(path, error) from None
    return missing


def _make_number(base: Path) -> tuple[Path, list[Path]]:
    """Creates the directory with the next free number; also returns new parents."""
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
