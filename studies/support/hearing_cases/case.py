"""What a case of hearing is, and when its answer is right.

All kinds follow one rule:

- If the recording is in order, the direction must be right: within three stated
  standard deviations, or 5 deg. A direction that is missing, or wrong beside a warning,
  is not right. No fault may be named.
- If the recording has a fault, the message must name it, and the channels that have it.
  A direction beside the message must be right, unless the fault itself changes
  directions; then its confidence must be at most 0.5.
- A wrong direction with a confidence above 0.5 is never right, whatever else is said.

Kinds whose topic is another answer, such as a position, say so in their judges.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

# A confidence above this is a claim, so a wrong answer with it is a false claim.
CLAIM = 0.5

# Largest errors of a right direction, and of a claim that is not yet false, deg.
_RIGHT_DEG, _CLAIMED_DEG = 5.0, 15.0
# Largest error of a right direction, in stated standard deviations.
_DEVIATIONS = 3.0


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

    def outcome(self) -> Outcome:
        """Returns the outcome, in which a false claim is not right."""
        found = self.judge()
        return found._replace(right=bool(found.right and not found.false_claim))


class _Source(Protocol):
    @property
    def bearing_deg(self) -> float: ...

    @property
    def confidence(self) -> float: ...


def off_deg(one_deg: float, other_deg: float) -> float:
    """Returns the size of the difference of two bearings, deg."""
    return abs(math.remainder(one_deg - other_deg, 360.0))


def is_near(bearing_deg: float | None, std_deg: float | None, truth_deg: float) -> bool:
    """Returns whether a bearing is right. A missing bearing is not."""
    if bearing_deg is None:
        return False
    within = max(_DEVIATIONS * (std_deg or 0.0), _RIGHT_DEG)
    return off_deg(bearing_deg, truth_deg) < within


def claims_elsewhere(sources: Iterable[_Source], truth_deg: Iterable[float]) -> bool:
    """Returns whether a source with a confidence above 0.5 is at none of the truths."""
    truth = list(truth_deg)
    return any(
        source.confidence > CLAIM
        and all(off_deg(source.bearing_deg, at) > _CLAIMED_DEG for at in truth)
        for source in sources
    )
