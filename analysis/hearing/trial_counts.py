"""How many measurements a cell of the localisation experiment may have."""

from __future__ import annotations

from systems.framework.input_error import InputError

#: Emission and bound of a cell are held in memory.
_MOST_TRIALS = 100_000


def check_trials(trials: int) -> None:
    """Refuses too many, or too few for a standard deviation.

    Args:
        trials: Measurements a cell.

    Raises:
        InputError: They are.
    """
    if not 2 <= trials <= _MOST_TRIALS:
        raise InputError("trials", f"{trials} must lie between 2 and {_MOST_TRIALS}")
