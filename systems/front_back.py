"""Front or back: the question that a line of microphones cannot answer.

A source and its mirror image behind the microphones give the same delays.
When the robot moves, the true one stays where it is, or moves no faster than a
source can; the image runs. Two hypotheses with a score each are carried along
(the Viterbi recursion with two states); a candidate that moved faster than
believable since it was last checked pays for it.
"""

from __future__ import annotations

from typing import Any

from systems.geometry import safe_norm

__all__ = ["Candidates", "resolve"]

#: Time between checks, s: long against noise, short of a burst.
CHECK_AFTER_S = 0.45
#: Part of the old scores that survives a check.
MEMORY = 0.7
#: Difference of the scores, two standard deviations squared, at which the
#: verdict turns over; the first one is front.
SWITCH_MARGIN = 4.0
#: Scores at which one more bad check says nothing new.
LARGEST_SCORE = 50.0


class Candidates:
    """Layout of the resolver's memory in the tracker's state, eight numbers.

    Anchor of the front candidate (2), anchor of the back candidate (2), time
    since the anchors were set (negative: no anchors yet), score of front,
    score of back, and 1 where back was chosen at the last check.
    """

    @staticmethod
    def none() -> list[float]:
        """Nothing heard yet."""
        return [0.0] * 4 + [-1.0, 0.0, 0.0, 0.0]

    @staticmethod
    def behind(memory: list[Any]) -> bool:
        """Whether the source was found behind the microphones at the last check."""
        return bool(memory[7] > 0.5)

    @staticmethod
    def older(memory: list[Any], seconds: float) -> list[Any]:
        """The same memory a while later."""
        if memory[4] < 0.0:
            return memory
        return [*memory[:4], memory[4] + seconds, *memory[5:]]


def resolve(memory: list[Any], front: list[Any], back: list[Any], tracker):
    """Chooses between the candidates of a new estimate.

    Args:
        memory: See ``Candidates``.
        front: Candidate before the microphones, in W, m.
        back: Its mirror image, in W, m.
        tracker: ``source_top_speed_m_s`` and ``mirror_tolerance_m``.

    Returns:
        (memory, the chosen candidate).
    """
    anchors = memory[0:2], memory[2:4]
    elapsed, scores = memory[4], memory[5:7]
    if elapsed < 0.0:
        fresh = Candidates.none()
        return [*front, *back, 0.0 * front[0], *fresh[5:]], front

    reach = tracker.source_top_speed_m_s * elapsed
    new_scores = []
    for candidate in (front, back):
        paths = []
        for anchor, score in zip(anchors, scores, strict=True):
            moved = safe_norm(candidate[0] - anchor[0], candidate[1] - anchor[1])
            excess = moved - reach
            cost = (excess / tracker.mirror_tolerance_m) ** 2 if excess > 0.0 else 0.0
            paths.append(score + cost)
        new_scores.append(min(paths))
    least = min(new_scores)
    new_scores = [min(score - least, LARGEST_SCORE) for score in new_scores]
    margin = -SWITCH_MARGIN if Candidates.behind(memory) else SWITCH_MARGIN
    behind = new_scores[0] - new_scores[1] > margin
    chosen = back if behind else front
    if elapsed < CHECK_AFTER_S:
        return memory, chosen
    kept = [MEMORY * score for score in new_scores]
    return [*front, *back, 0.0 * elapsed, *kept, float(behind)], chosen
