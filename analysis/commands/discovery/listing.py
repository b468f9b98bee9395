"""A list of names, each with a line about it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from analysis.commands.command import Job


def listing(
    plural: str, about: str, rows: Callable[[], dict[str, str]]
) -> Job[dict[str, str]]:
    """The job of a command that prints a list.

    Args:
        plural: What is listed, as the JSON document has it.
        about: What the line is, as the JSON document has it.
        rows: Gives names and lines.

    Returns:
        A job without a result directory.
    """

    def summary(found: dict[str, str]) -> dict[str, Any]:
        listed = [{"name": name, about: line} for name, line in found.items()]
        return {"schema_version": 1, plural: listed}

    def text(found: dict[str, str], _: dict[str, Any]) -> str:
        width = max(map(len, found))
        return "\n".join(f"{name:<{width}}  {line}" for name, line in found.items())

    return Job(run=lambda _: rows(), summary=summary, text=text)
