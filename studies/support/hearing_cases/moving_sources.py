"""Sources that move past or around an array."""

from __future__ import annotations

from studies.support.hearing_cases.case import HearingCase

TITLE = "moving sources"


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    return []
