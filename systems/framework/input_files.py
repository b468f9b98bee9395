"""Files that a user names."""

from __future__ import annotations

from pathlib import Path

from systems.framework.input_error import InputError


def require_file(path: str | Path, field: str, kind: str) -> Path:
    """Refuses what is no file before anything is loaded that could read it.

    Args:
        path: Of the file.
        field: Name of the parameter that holds the path, for the message.
        kind: Of file, as 'WAV or FLAC'.

    Returns:
        The path.

    Raises:
        InputError: It is no file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(
            field, f"{str(path)!r} is not a file; give the path of a {kind} file"
        )
    return path
