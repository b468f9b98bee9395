"""Which of the sounds of a frame comes from the source that is followed.

Every source has a place in W with a covariance: the followed one that of the tracker,
the others the one where they were last heard. Places are compared with what is heard by
the delays that they would have (third-degree cubature, Arasaratnam and Haykin 2009): a
row's two sides have the same, and a range that is not known is a large covariance. Each
sound belongs to one source, so that all of them together are likeliest (global nearest
neighbours); one that belongs to none is another source.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.special import chdtri

from systems.hearing.localise import Candidate
from systems.hearing.tracking.target_filter import NEVER_HEARD_S
from systems.sound.array_shape import ArrayShape

# Other sources that are remembered, and for how long, s.
_OTHERS = 4
_FORGOTTEN_S = 6.0

# One that was never heard together with the followed source may be that one, off its
# expected place: it is forgotten after so long, when the source has missed a burst.
_DOUBTED_S = 3.0

# What is not sure may be chance, which does not come twice: another source counts when
# it was heard so many times, at most so long after one another; and the followed one,
# after a silence, when it is heard a second time, s.
_TIMES = 3
_GAP_S = 0.06
_SILENCE_S = 0.2

# A delay of the source is farther off than the gate in one frame of so many.
_GATE = 3e-4

# Cost of a sound of no known source: one in ten frames has one, with delays of any size
# up to a metre.
_NOWHERE = -1.0

# A second sound where the followed one is expected is as likely to be it when it
# correlates more than this share of the first.
_SECOND = 0.6

# Standard deviations: of what delays leave out, above all the robot's turning within a
# frame; of what the tracker's covariance does; and of a source's velocity, m and m/s.
_DELAY_FLOOR_M = 0.008
_PLACE_FLOOR_M = 0.03
_SPEED_M_S = 0.35

# Where only the direction is known the range is about this, and half of it off, m.
_RANGE_M = 2.5

# What is meant by a first bearing, standard deviation, rad.
_BEARING = math.radians(4.0)


class Belief(NamedTuple):
    """What the tracker says of the followed source, and odometry of the robot."""

    p_WS: NDArray[np.float64]
    """(2,) m."""
    covariance: NDArray[np.float64]
    """(2, 2) m^2."""
    age: float
    """Of what was last heard of it, s; ``NEVER_HEARD_S`` and more: nothing yet."""
    pose: NDArray[np.float64]
    """(3,) of B in W, m and rad."""


class _Line(NamedTuple):
    """That of a row of microphones, or of none."""

    p: NDArray[np.float64]
    """(2,) a point of it in W, m."""
    normal: NDArray[np.float64]
    """(2,) unit vector; zeros where nothing is mirrored."""

    def mirrored(
        self, p: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A place's other side of it."""
        flip = np.eye(2) - 2.0 * np.outer(self.normal, self.normal)
        return self.p + flip @ (p - self.p), flip @ covariance @ flip


class _Place(NamedTuple):
    """Where a source was when it was last heard."""

    p: NDArray[np.float64]
    covariance: NDArray[np.float64]
    line: _Line


class ChoiceMemory(NamedTuple):
    """What a frame leaves behind for the choice in the next one."""

    line: NDArray[np.float64]
    """(4,) point and normal of the row as the followed source was last heard."""
    others: NDArray[np.float64]
    """(k, 13) other sources: time since each was heard, s, how often it was, 1 where
    that was together with the followed one; place; covariance; point and normal of the
    row."""

    @classmethod
    def unpack(cls, values: NDArray[np.float64]) -> ChoiceMemory:
        """From the (n,) vector that ``pack`` gave."""
        return cls(values[:4].copy(), values[4:].reshape(_OTHERS, -1).copy())

    def pack(self) -> NDArray[np.float64]:
        """All of it in one vector."""
        return np.concatenate((self.line, self.others.ravel()))


class SourceChoice:
    """Chooses among the sounds of successive frames.

    Args:
        shape: The microphones, in a plane; axes of B.
        c: Speed of sound, m/s.
        p_BA: (2,) their centroid from the origin of B, m.
        frame_s: Period of the frames, s.
        first_bearing: Of the source before it is heard, rad; None: it is the first
            sound that is heard alone.
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
        # Every channel is off by itself.
        self._floor = _DELAY_FLOOR_M**2 * (np.eye(count) + 1.0)

    def blank(self) -> ChoiceMemory:
        """Nothing heard yet."""
        others = np.zeros((_OTHERS, 13))
        others[:, 0] = NEVER_HEARD_S
        return ChoiceMemory(np.zeros(4), others)

    def choose(
        self,
        candidates: Sequence[Candidate],
        memory: ChoiceMemory,
        belief: Belief,
        *,
        may_sound: bool = True,
    ) -> tuple[int | None, ChoiceMemory]:
        """The sound of the followed source.

        Args:
            candidates: Sounds of a frame.
            memory: What the last frame left.
            belief: Now.
            may_sound: Whether the source can sound by its schedule.

        Returns:
            Its place among them, None where it is not heard; and the new memory.
        """
        others = _aged(memory.others, self._frame_s, doubted=belief.age > _DOUBTED_S)
        if not candidates:
            return None, memory._replace(others=others)
        centre, turn, line = self._array(belief.pose)
        microphones = centre + self._shape.p_AM @ turn.T
        places = [_grown(row) for row in others]
        costs = np.array(
            [[self._cost(c, p, microphones) for p in places] for c in candidates]
        )
        followed = self._followed(belief, memory, centre, turn)
        own = np.full(len(candidates), math.inf)
        if may_sound and followed is not None:
            own = np.array([self._cost(c, followed, microphones) for c in candidates])
        elif may_sound and _is_alone(candidates):
            own[0] = _NOWHERE - 1.0
        counts = others[:, 1] >= _TIMES
        # Beside a sound that goes on there are its side peaks.
        beside = counts & (others[:, 0] <= _SILENCE_S)
        own[own > costs.min(axis=1, initial=math.inf, where=beside)] = math.inf
        sure = np.array([c.sure for c in candidates])
        if belief.age > _SILENCE_S:
            again = np.isfinite(costs[:, ~counts]).any(axis=1)
            own[~again & ~sure] = math.inf
        shared = costs.copy()
        # What was heard once is the followed source then, not another one.
        shared[np.ix_(np.isfinite(own), ~counts)] = math.inf
        shared[np.ix_(~sure, counts & ~beside)] = math.inf
        belongs = _assigned(np.column_stack((own, shared)))
        chosen = belongs.index(0) if 0 in belongs else None
        for candidate, place in zip(candidates, belongs, strict=True):
            if place != 0:
                self._remember(others, place, candidate, (centre, turn, line))
        if chosen is None or _is_ambiguous(chosen, own, belongs, candidates):
            return None, memory._replace(others=others)
        others[~counts & np.isfinite(costs[chosen]), 0] = NEVER_HEARD_S
        others[(others[:, 0] == 0.0) & (others[:, 1] > 1.0), 2] = 1.0
        return chosen, ChoiceMemory(np.concatenate(line), others)

    def _array(
        self, pose: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], _Line]:
        """Centroid of the microphones in W, the rotation R_WB, and their line."""
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        turn = np.array([[cosine, -sine], [sine, cosine]])
        centre = pose[:2] + turn @ self._p_BA
        ahead = self._shape.ahead
        return (
            centre,
            turn,
            _Line(centre, np.zeros(2) if ahead is None else turn @ ahead),
        )

    def _followed(
        self,
        belief: Belief,
        memory: ChoiceMemory,
        centre: NDArray[np.float64],
        turn: NDArray[np.float64],
    ) -> _Place | None:
        """Where the followed source is expected; None: anywhere."""
        if belief.age < NEVER_HEARD_S:
            covariance = belief.covariance + _PLACE_FLOOR_M**2 * np.eye(2)
            return _Place(belief.p_WS, covariance, _Line(*memory.line.reshape(2, 2)))
        if self._first_bearing is None:
            return None
        angle = self._first_bearing
        u = turn @ np.array([math.cos(angle), math.sin(angle)])
        p, covariance = _placed(centre, u, _BEARING**2 * (np.eye(2) - np.outer(u, u)))
        return _Place(p, covariance, _Line(centre, np.zeros(2)))

    def _cost(
        self,
        candidate: Candidate,
        place: _Place | None,
        microphones: NDArray[np.float64],
    ) -> float:
        """Twice the negative log-likelihood of being heard so; infinity: beyond it."""
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

    def _remember(
        self,
        others: NDArray[np.float64],
        place: int | None,
        candidate: Candidate,
        array: tuple[NDArray[np.float64], NDArray[np.float64], _Line],
    ) -> None:
        """Another source was heard: one of a place (from 1), or a new one."""
        centre, turn, line = array
        row = int(others[:, 0].argmax()) if place is None else place - 1
        fix = candidate.fix
        p, covariance = turn @ fix.p_AS, turn @ fix.covariance @ turn.T
        if fix.range_valid:
            p = p + centre
        else:
            p, covariance = _placed(centre, p, covariance)
        times, together = (0.0, 0.0) if place is None else others[row, 1:3]
        where = *p, *covariance.ravel(), *np.concatenate(line)
        others[row] = 0.0, times + 1.0, together, *where


def _assigned(costs: NDArray[np.float64]) -> list[int | None]:
    """Place that each sound belongs to, no two the same; None: none.

    Args:
        costs: (sounds, places), infinite where one is not the other's.
    """
    sounds, places = costs.shape
    finite = np.where(np.isfinite(costs), costs, 1e9)
    nowhere = np.full((sounds, sounds), _NOWHERE)
    columns = linear_sum_assignment(np.hstack((finite, nowhere)))[1]
    return [int(k) if k < places else None for k in columns]


def _is_alone(candidates: Sequence[Candidate]) -> bool:
    """Whether the first of all sounds is the only one, side peaks apart."""
    most = _SECOND * candidates[0].correlation
    return candidates[0].alone and all(c.correlation <= most for c in candidates[1:])


def _is_ambiguous(
    chosen: int,
    own: NDArray[np.float64],
    belongs: Sequence[int | None],
    candidates: Sequence[Candidate],
) -> bool:
    """Whether another sound that is no known source's may be the followed one's."""
    most = _SECOND * candidates[chosen].correlation
    return any(
        k != chosen and np.isfinite(own[k]) and not belongs[k] and c.correlation > most
        for k, c in enumerate(candidates)
    )


def _aged(
    others: NDArray[np.float64], seconds: float, *, doubted: bool
) -> NDArray[np.float64]:
    """Other sources so much later, without those that are forgotten."""
    others = others.copy()
    others[:, 0] += seconds
    gone = others[:, 0] > _FORGOTTEN_S
    gone |= (others[:, 1] < _TIMES) & (others[:, 0] > _GAP_S)
    gone |= doubted & (others[:, 2] < 0.5) & (others[:, 1] >= _TIMES)
    others[gone, 0] = NEVER_HEARD_S
    return others


def _placed(
    centre: NDArray[np.float64],
    u: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Place of a source of which only the direction is known, with covariance."""
    along = np.outer(u, u) / 4.0
    return centre + _RANGE_M * u, _RANGE_M**2 * (covariance + along)


def _grown(row: NDArray[np.float64]) -> _Place | None:
    """Where another source may be by now; None: there is none."""
    if row[0] >= NEVER_HEARD_S:
        return None
    covariance = row[5:9].reshape(2, 2) + (_SPEED_M_S * row[0]) ** 2 * np.eye(2)
    return _Place(row[3:5], covariance, _Line(row[9:11], row[11:13]))


def _expected_delays(
    p: NDArray[np.float64],
    covariance: NDArray[np.float64],
    microphones: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n - 1,) mean and (n - 1, n - 1) covariance of the delays from a place, m."""
    root = math.sqrt(2.0) * np.linalg.cholesky(covariance + 1e-12 * np.eye(2))
    points = np.vstack((p + root.T, p - root.T))
    ranges = np.linalg.norm(points[:, np.newaxis] - microphones, axis=2)
    delays = ranges[:, 1:] - ranges[:, :1]
    mean = delays.mean(axis=0)
    return mean, (delays - mean).T @ (delays - mean) / len(points)
