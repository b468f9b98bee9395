"""Chooses the sound of the followed source among the sounds of an audio frame.

Each known source has a position in the world frame W with a covariance. The tracker
gives the position of the followed source. The position of every other source is the
position at which it was last heard.

The method has three steps:

1. Convert the position of each source to expected delays by third-degree cubature
   (Arasaratnam and Haykin 2009). An unknown range is treated as a range with a large
   variance.
2. Compare the expected delays with the delays of each sound. Positions on both sides of
   a row of microphones have the same delays, so the mirror image of each position is
   compared, too.
3. Assign each sound to at most one source, so that the total likelihood is largest
   (global nearest neighbors). A sound that belongs to no known source is a new source.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.special import chdtri

from systems.hearing.localize import Candidate
from systems.hearing.tracking.target_filter import NEVER_HEARD_S, SPEED_STD
from systems.sound.array_shape import ArrayShape

# Largest number of other sources that are remembered.
_OTHERS = 4
# Time without sound until another source is forgotten, s.
_FORGOTTEN_S = 6.0

# Silence of the followed source after which a doubtful other source is dropped, s.
# Another source is doubtful if it was never heard together with the followed source. It
# may then be the followed source at a wrong position.
_DOUBTED_S = 3.0

# A sound that is not sure may be due to chance, but chance does not repeat. Therefore
# sources must be confirmed.
# Number of times that another source must be heard until it is confirmed.
_TIMES = 3
# Largest gap between these times, s.
_GAP_S = 0.06
# Silence after which the followed source must be heard twice until it is confirmed, s.
_SILENCE_S = 0.2

# Share of the frames in which the delays of the right source are outside the gate.
_GATE = 3e-4

# Cost of a sound that belongs to no known source. It assumes that one in ten frames
# contains such a sound, with delays of any size up to 1 m.
_NOWHERE = -1.0

# A second sound at the expected position makes the choice ambiguous if its correlation
# exceeds this share of the first one's correlation.
_SECOND = 0.6

# Standard deviations of errors that are not in the covariances.
# Error of the range differences, m, mainly because the robot turns within a frame.
_DELAY_FLOOR_M = 0.008
# Error of the position that the tracker gives, m.
_PLACE_FLOOR_M = 0.03

# Assumed range if only the direction is known, m. Its standard deviation is half of
# this value.
_RANGE_M = 2.5

# Standard deviation of the first bearing that the user gives, rad.
_BEARING = math.radians(4.0)


class Belief(NamedTuple):
    """Tracker's estimate of the followed source, and odometry pose of the robot."""

    p_WS: NDArray[np.float64]
    """(2,) position of the source in W, m."""
    covariance: NDArray[np.float64]
    """(2, 2) covariance of the position, m^2."""
    age: float
    """Time since the source was last heard, s. If the source was never heard, the time
    is at least ``NEVER_HEARD_S``."""
    pose: NDArray[np.float64]
    """(3,) x, y, theta of B in W, m and rad."""


class _Line(NamedTuple):
    """Line of a row of microphones, at which the positions of sources are mirrored."""

    p: NDArray[np.float64]
    """(2,) point of the line in W, m."""
    normal: NDArray[np.float64]
    """(2,) unit normal of the line; zeros if there is no mirror image."""

    def mirrored(
        self, p: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mirrors a position and its covariance at the line."""
        flip = np.eye(2) - 2.0 * np.outer(self.normal, self.normal)
        return self.p + flip @ (p - self.p), flip @ covariance @ flip


class _Place(NamedTuple):
    """Position of a source when it was last heard, m, with covariance, m^2."""

    p: NDArray[np.float64]
    covariance: NDArray[np.float64]
    line: _Line


class _Other(NamedTuple):
    """A source that is not followed."""

    place: _Place
    """Position when it was last heard."""
    silence: float
    """Time since it was last heard, s."""
    times: int
    """Number of times that it was heard."""
    together: bool
    """Whether it was heard together with the followed source."""

    @property
    def is_confirmed(self) -> bool:
        """Whether it was heard so often that it is not due to chance."""
        return self.times >= _TIMES

    def grown(self) -> _Place:
        """Returns where the source may be now."""
        spread = (SPEED_STD * self.silence) ** 2 * np.eye(2)
        return self.place._replace(covariance=self.place.covariance + spread)


class ChoiceMemory(NamedTuple):
    """Values that the choice keeps from one frame to the next one."""

    line: _Line
    """Line of the row when the followed source was last heard."""
    others: tuple[_Other | None, ...]
    """The other sources. An entry is None if there is no source at this index."""


class SourceChoice:
    """Chooses the sound of the followed source in successive audio frames.

    Args:
        shape: The microphones, in a plane, in the axes of the body frame B.
        c: Speed of sound, m/s.
        p_BA: (2,) centroid of the microphones relative to the origin of B, m.
        frame_s: Period of the frames, s.
        first_bearing: Bearing of the source before it is heard, rad. None: the source
            is the first sound that is heard alone.
    """

    def __init__(
        self,
        shape: ArrayShape,
        c: float,
        p_BA: NDArray[np.float64],
        frame_s: float,
        first_bearing: float | None = None,
    ) -> None:
        self._shape, self._c, self._p_BA = shape, c, p_BA
        self._frame_s, self._first_bearing = frame_s, first_bearing
        count = shape.count - 1
        self._gate = float(chdtri(count, _GATE))
        # Each channel has an independent error.
        self._floor = _DELAY_FLOOR_M**2 * (np.eye(count) + 1.0)

    def blank(self) -> ChoiceMemory:
        """Returns the memory before anything is heard."""
        return ChoiceMemory(_Line(np.zeros(2), np.zeros(2)), (None,) * _OTHERS)

    @staticmethod
    def full() -> ChoiceMemory:
        """Returns an example of the memory in which nothing is None."""
        line = _Line(np.zeros(2), np.zeros(2))
        place = _Place(np.zeros(2), np.zeros((2, 2)), line)
        other = _Other(place, 0.0, 0, together=False)
        return ChoiceMemory(line, (other,) * _OTHERS)

    def choose(
        self,
        candidates: Sequence[Candidate],
        memory: ChoiceMemory,
        belief: Belief,
        *,
        may_sound: bool = True,
    ) -> tuple[int | None, ChoiceMemory]:
        """Chooses the sound of the followed source, and updates the other sources.

        The function computes a cost for each pair of a sound and a known source. If the
        source cannot have caused the sound, the cost is infinite. The assignment with
        the smallest total cost gives the sound of the followed source.

        Args:
            candidates: Sounds of an audio frame.
            memory: Memory after the previous frame.
            belief: Present estimate of the followed source, and pose of the robot.
            may_sound: Whether the schedule of the source permits a sound in this frame.

        Returns:
            Two values: the index of the sound in ``candidates``, or None if the source
            is not heard; and the new memory.
        """
        doubted = belief.age > _DOUBTED_S
        others = [_aged(o, self._frame_s, doubted=doubted) for o in memory.others]
        if not candidates:
            return None, memory._replace(others=tuple(others))
        # Costs of each sound for each known source.
        center, turn, line = self._array(belief.pose)
        microphones = center + self._shape.p_AM @ turn.T
        places = [None if o is None else o.grown() for o in others]
        costs = np.array(
            [[self._cost(c, p, microphones) for p in places] for c in candidates]
        )
        followed = self._followed(belief, memory, center, turn)
        own = np.full(len(candidates), math.inf)
        if may_sound and followed is not None:
            own = np.array([self._cost(c, followed, microphones) for c in candidates])
        elif may_sound and _is_alone(candidates):
            # The first sound that is alone becomes the followed source.
            own[0] = _NOWHERE - 1.0
        counts = np.array([o is not None and o.is_confirmed for o in others])
        # A sound may fit a confirmed source that still sounds better than the followed
        # source. It is then a side peak of the confirmed source.
        recent = [o is not None and o.silence <= _SILENCE_S for o in others]
        beside = counts & np.array(recent)
        own[own > costs.min(axis=1, initial=math.inf, where=beside)] = math.inf
        # After a silence, a sound that is not sure must be heard twice.
        sure = np.array([c.sure for c in candidates])
        if belief.age > _SILENCE_S:
            again = np.isfinite(costs[:, ~counts]).any(axis=1)
            own[~again & ~sure] = math.inf
        shared = costs.copy()
        # A sound that may be the followed source confirms no other source.
        shared[np.ix_(np.isfinite(own), ~counts)] = math.inf
        # A sound that is not sure is not assigned to a silent confirmed source.
        shared[np.ix_(~sure, counts & ~beside)] = math.inf
        belongs = _assigned(np.column_stack((own, shared)))
        chosen = belongs.index(0) if 0 in belongs else None
        for candidate, place in zip(candidates, belongs, strict=True):
            if place != 0:
                where = self._located(candidate, center, turn, line)
                _remember(others, place, where)
        if chosen is None or _is_ambiguous(chosen, own, belongs, candidates):
            return None, memory._replace(others=tuple(others))
        for k, other in enumerate(others):
            if not counts[k] and np.isfinite(costs[chosen, k]):
                # The chosen sound also fits this source, which is not confirmed.
                others[k] = None
            elif other is not None and other.silence == 0.0 and other.times > 1:
                others[k] = other._replace(together=True)
        return chosen, ChoiceMemory(line, tuple(others))

    def _array(
        self, pose: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], _Line]:
        """Returns the microphones' centroid in W, R_WB, and the line of the row."""
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        turn = np.array([[cosine, -sine], [sine, cosine]])
        center = pose[:2] + turn @ self._p_BA
        ahead = self._shape.ahead
        return (
            center,
            turn,
            _Line(center, np.zeros(2) if ahead is None else turn @ ahead),
        )

    def _followed(
        self,
        belief: Belief,
        memory: ChoiceMemory,
        center: NDArray[np.float64],
        turn: NDArray[np.float64],
    ) -> _Place | None:
        """Returns the expected position of the followed source; None: unknown."""
        if belief.age < NEVER_HEARD_S:
            covariance = belief.covariance + _PLACE_FLOOR_M**2 * np.eye(2)
            return _Place(belief.p_WS, covariance, memory.line)
        if self._first_bearing is None:
            return None
        angle = self._first_bearing
        u = turn @ np.array([math.cos(angle), math.sin(angle)])
        p, covariance = _placed(center, u, _BEARING**2 * (np.eye(2) - np.outer(u, u)))
        return _Place(p, covariance, _Line(center, np.zeros(2)))

    def _cost(
        self,
        candidate: Candidate,
        place: _Place | None,
        microphones: NDArray[np.float64],
    ) -> float:
        """Returns twice the negative log-likelihood that a sound comes from a source.

        The result is the smaller of the values for both sides of the row of
        microphones. It is infinite if the delays differ too much from the expected
        delays on both sides.
        """
        if place is None:
            return math.inf
        sides = [place[:2]]
        if place.line.normal.any():
            sides.append(place.line.mirrored(*place[:2]))
        least = math.inf
        for p, covariance in sides:
            mean, spread = _expected_delays(p, covariance, microphones)
            spread += self._c**2 * candidate.covariance + self._floor
            missed = self._c * candidate.tau - mean
            squared = float(missed @ np.linalg.solve(spread, missed))
            if squared <= self._gate:
                least = min(least, squared + float(np.linalg.slogdet(spread)[1]))
        return least

    def _located(
        self,
        candidate: Candidate,
        center: NDArray[np.float64],
        turn: NDArray[np.float64],
        line: _Line,
    ) -> _Place:
        """Returns the position of a sound in W, given the results of ``_array``."""
        fix = candidate.fix
        p, covariance = turn @ fix.p_AS, turn @ fix.covariance @ turn.T
        if fix.range_valid:
            return _Place(p + center, covariance, line)
        return _Place(*_placed(center, p, covariance), line)


def _assigned(costs: NDArray[np.float64]) -> list[int | None]:
    """Assigns sounds to sources with the smallest total cost.

    ``costs`` has one row per sound and one column per source. A cost is infinite if the
    sound cannot come from the source. For each sound, the result has the index of its
    source, or None if the sound belongs to no known source. Each source has at most one
    sound.
    """
    sounds, places = costs.shape
    finite = np.where(np.isfinite(costs), costs, 1e9)
    nowhere = np.full((sounds, sounds), _NOWHERE)
    columns = linear_sum_assignment(np.hstack((finite, nowhere)))[1]
    return [int(k) if k < places else None for k in columns]


def _is_alone(candidates: Sequence[Candidate]) -> bool:
    """Returns whether the first sound is the only one, apart from side peaks."""
    most = _SECOND * candidates[0].correlation
    return candidates[0].alone and all(c.correlation <= most for c in candidates[1:])


def _is_ambiguous(
    chosen: int,
    own: NDArray[np.float64],
    belongs: Sequence[int | None],
    candidates: Sequence[Candidate],
) -> bool:
    """Returns whether another unassigned sound may be that of the followed source."""
    most = _SECOND * candidates[chosen].correlation
    return any(
        k != chosen and np.isfinite(own[k]) and not belongs[k] and c.correlation > most
        for k, c in enumerate(candidates)
    )


def _aged(other: _Other | None, seconds: float, *, doubted: bool) -> _Other | None:
    """Returns another source some seconds later; None: it is forgotten."""
    if other is None:
        return None
    silence = other.silence + seconds
    is_wrong = doubted and other.is_confirmed and not other.together
    is_chance = silence > _GAP_S and not other.is_confirmed
    if silence > _FORGOTTEN_S or is_chance or is_wrong:
        return None
    return other._replace(silence=silence)


def _remember(others: list[_Other | None], number: int | None, place: _Place) -> None:
    """Stores in ``others`` the position of another source that was heard.

    ``number`` is 1 plus the index of this source in ``others``. If it is None, the
    source is new and replaces the source with the longest silence.
    """
    if number is None:
        silences = [math.inf if o is None else o.silence for o in others]
        others[silences.index(max(silences))] = _Other(place, 0.0, 1, together=False)
        return
    known = others[number - 1]
    assert known is not None
    others[number - 1] = known._replace(place=place, silence=0.0, times=known.times + 1)


def _placed(
    center: NDArray[np.float64],
    u: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the position of a source with unknown range, and its covariance."""
    along = np.outer(u, u) / 4.0
    return center + _RANGE_M * u, _RANGE_M**2 * (covariance + along)


def _expected_delays(
    p: NDArray[np.float64],
    covariance: NDArray[np.float64],
    microphones: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Computes mean and covariance of the range differences for an uncertain source.

    The range difference of a microphone is its range minus the range of microphone 0.
    The positions ``p`` and ``microphones`` are in the world frame W, m. The results are
    the (n - 1,) mean, m, and the (n - 1, n - 1) covariance, m^2.
    """
    root = math.sqrt(2.0) * np.linalg.cholesky(covariance + 1e-12 * np.eye(2))
    points = np.vstack((p + root.T, p - root.T))
    ranges = np.linalg.norm(points[:, np.newaxis] - microphones, axis=2)
    delays = ranges[:, 1:] - ranges[:, :1]
    mean = delays.mean(axis=0)
    return mean, (delays - mean).T @ (delays - mean) / len(points)
