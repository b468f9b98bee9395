"""Result directories that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["choose_directory", "whole_directory"]


def choose_directory(out: str | Path | None, base: str | Path = "results") -> Path:
    """The directory to write, checked before anything runs.

    Args:
        out: A directory that does not exist yet or is empty; none: the next
            number under ``base``.
        base: Parent of numbered directories.

    Raises:
        ValueError: It is in use, or cannot be written; ``out: ...``.
    """
    path = Path(out) if out is not None else _next_number(Path(base))
    if path.exists() and not path.is_dir():
        raise ValueError(f"out: {path} is a file; name a directory")
    if path.is_dir() and any(path.iterdir()):
        raise ValueError(f"out: {path} is not empty; name another directory")
    parent = path.absolute().parent
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir():
        raise ValueError(f"out: {parent} is a file; name another directory")
    for folder in (parent, path):
        if folder.exists() and not os.access(folder, os.W_OK | os.X_OK):
            raise ValueError(f"out: {folder} cannot be written; name another directory")
    return path


def _next_number(base: Path) -> Path:
    numbers = [int(p.name) for p in base.glob("[0-9]*") if p.name.isdigit()]
    return base / f"{max(numbers, default=0) + 1:04d}"


@contextmanager
def whole_directory(path: Path) -> Iterator[Path]:
    """Yields a hidden directory beside ``path`` that takes its name at the end.

    If the block raises, KeyboardInterrupt included, nothing stays behind: not
    even parents that were made for it.
    """
    made = [p for p in path.absolute().parents if not p.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise ValueError(
            f"out: {path} cannot be made ({error.strerror}); name another directory"
        ) from None
    try:
        yield partial
        partial.chmod(0o777 & ~_umask())
        if path.is_dir():
            path.rmdir()
        partial.rename(path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        for parent in made:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
