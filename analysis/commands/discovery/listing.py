"""A command that prints a list of names, each with one line of text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from analysis.commands.command import Job


def listing(
    plural: str, about: str, rows: Callable[[], dict[str, str]]
) -> Job[dict[str, str]]:
    """Makes the job of a command that prints a list of names.

    Args:
        plural: Key of the list in the JSON document.
        about: Key of each entry's text in the JSON document.
        rows: Function that returns a mapping from each name to one line of text.

    Returns:
        The job, which writes no files.
    """

    def summary(found: dict[str, str]) -> dict[str, Any]:
        listed = [{"name": name, about: line} for name, line in found.items()]
        return {"schema_version": 1, plural: listed}

    def text(found: dict[str, str], _: dict[str, Any]) -> str:
        width = max(map(len, found))
        return "\n".join(f"{name:<{width}}  {line}" for name, line in found.items())

    return Job(run=lambda _: rows(), summary=summary, text=text)
