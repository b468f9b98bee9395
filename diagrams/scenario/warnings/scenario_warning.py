"""One warning about a scenario."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ScenarioWarning:
    """What a user must know of a scenario that is run all the same."""

    field: str
    """Dotted path of the field to change; runs are counted by it."""
    message: str
    """What is wrong with its value, and what follows."""

    def __str__(self) -> str:
        return f"{self.field}: {self.message}"
