"""What a case of hearing is, and what its outcome is."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

# A confidence above this is a claim, so a wrong answer with it is a false claim.
CLAIM = 0.5


class Outcome(NamedTuple):
    """The outcome of one case."""

    right: bool
    """Whether the answer, or the reason for a refusal, is the right one."""
    said: str
    """The answer in one line, for the list of what failed."""
    false_claim: bool = False
    """Whether a wrong direction or position has a confidence above 0.5."""


class HearingCase(NamedTuple):
    """A recording with a known truth, and the judgment of what is said of it."""

    name: str
    """Array, sound, place and fault in a few words, unique within its kind."""
    judge: Callable[[], Outcome]
    """Makes the recording, has it located or listened to, and judges the answer.

    It draws all random numbers from a seed of its own.
    """
