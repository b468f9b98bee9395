"""Limits the number of measurements in the localization experiment."""

from __future__ import annotations

from systems.framework.input_error import InputError

#: Most measurements per cell. The sound and the bounds of a cell are held in memory.
_MOST_TRIALS = 100_000


def check_trials(trials: int) -> None:
    """Raises ``InputError`` if there are too many trials, or fewer than two."""
    if not 2 <= trials <= _MOST_TRIALS:
        raise InputError("trials", f"{trials} must lie between 2 and {_MOST_TRIALS}")
