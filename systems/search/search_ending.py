"""The endings of a search, and the faults that a searching robot detects."""

from __future__ import annotations

from collections.abc import Mapping

#: Numbers of the endings. 0: the search continues.
(
    UNDECIDED,
    FOUND,
    REFUSED,
    NO_WIND,
    NO_NOSE,
    NO_TOUCH,
    STEPS_GONE,
    NOT_CALLED,
    CALLER_LOST,
    NOT_HEARD,
    AMBIGUOUS,
    DEAF,
) = range(12)

#: Reason why a robot gave up a search, by the number of the ending.
SEARCH_REASONS: Mapping[int, str] = {
    REFUSED: "touched something that does not smell",
    NO_WIND: "there is no wind to follow",
    NO_NOSE: "two or more gas sensors are dead",
    NO_TOUCH: "both contact switches are stuck",
    STEPS_GONE: "all steps are used up",
    NOT_CALLED: "no call was received",
    CALLER_LOST: "the caller reports that it has found nothing",
    NOT_HEARD: "the caller is not heard",
    AMBIGUOUS: "the sound fits several directions",
    DEAF: "two or more microphones are lost",
}

#: Columns of the port ``search_report``: number of the ending, phase of the search,
#: number of steps so far, and sum of the bits of the faults.
REPORT_COLUMNS = ("search_ended", "search_phase", "search_steps", "search_fault")

#: Faults, by the bit of the last column.
_FAULTS = (
    "gas sensor 1 is dead",
    "gas sensor 2 is dead",
    "gas sensor 3 is dead",
    "the left contact switch is stuck",
    "the right contact switch is stuck",
    "a microphone is lost",
)


def fault_names(fault: float) -> list[str]:
    """Returns one text for each fault that a searching robot has detected.

    ``fault`` is the last value of the port ``search_report``: the sum of the bits of
    all detected faults.
    """
    return [text for bit, text in enumerate(_FAULTS) if int(fault) >> bit & 1]
