"""How a search ends, and what a searching robot found to be broken."""

from __future__ import annotations

from collections.abc import Mapping

#: Numbers of the endings; 0: the search goes on.
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

#: Why a search was given up, by the number of its ending.
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

#: Columns of the port ``search_report``: number of the ending, what the robot is at,
#: steps begun, and the sum of what is broken.
REPORT_COLUMNS = ("search_ended", "search_phase", "search_steps", "search_fault")

#: What each bit of the last column stands for.
_FAULTS = (
    "gas sensor 1 is dead",
    "gas sensor 2 is dead",
    "gas sensor 3 is dead",
    "the left contact switch is stuck",
    "the right contact switch is stuck",
    "a microphone is lost",
)


def fault_names(fault: float) -> list[str]:
    """What a searching robot found to be broken, and went on without.

    Args:
        fault: Last column of ``search_report``.

    Returns:
        A text each.
    """
    return [text for bit, text in enumerate(_FAULTS) if int(fault) >> bit & 1]
