"""Checks of the paths of input files."""

from __future__ import annotations

from pathlib import Path

from systems.framework.input_error import InputError


def require_file(path: str | Path, field: str, kind: str) -> Path:
    """Checks that a path is a file, before the library that reads the file is loaded.

    Args:
        path: Path of the file.
        field: Name of the parameter with the path, for the message.
        kind: Kind of file for the message, for example 'WAV or FLAC'.

    Returns:
        The path.

    Raises:
        InputError: The path is not a file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(
            field, f"{str(path)!r} is not a file; give the path of a {kind} file"
        )
    return path
