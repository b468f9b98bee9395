"""Limits the number of measurements in the localization experiment."""

from __future__ import annotations

from systems.framework.input_error import InputError

#: Most measurements per cell. The sound and the bounds of a cell are held in memory.
_MOST_TRIALS = 100_000


def check_trials(trials: int) -> None:
    """Checks the number of measurements per position of the source.

    Args:
        trials: Number of measurements.

    Raises:
        InputError: The number is too large, or too small for a standard deviation.
    """
    if not 2 <= trials <= _MOST_TRIALS:
        raise InputError("trials", f"{trials} must lie between 2 and {_MOST_TRIALS}")
