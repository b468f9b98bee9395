"""One warning about a scenario."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ScenarioWarning:
    """A problem of a scenario that can still be run."""

    field: str
    """Dotted path of the field to change; reports count runs by this field."""
    message: str
    """The problem of the field's value, and the consequence."""

    def __str__(self) -> str:
        return f"{self.field}: {self.message}"
