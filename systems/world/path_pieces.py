"""Computes the speed of a body along the segments of its path, in pieces.

Within a piece, the acceleration is constant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from systems.framework.input_error import InputError
from systems.world.path_segments import Pose, Segment

#: Greatest yaw rate, rad/s, and yaw acceleration, rad/s^2, of a turn on the spot (our
#: choice). A turn by a right angle takes 1.5 s.
TURN_RATE_RAD_S, TURN_ACCELERATION_RAD_S2 = 1.5, 3.0

#: Largest number of laps in which a body may reach its speed.
_MOST_LAPS = 1000


class Piece(NamedTuple):
    """A part of a segment with constant acceleration, given by its start.

    ``forward`` and ``curvature`` are those of the segment. In a turn on the spot,
    ``speed`` and ``acceleration`` are in rad/s and rad/s^2.
    """

    begin: float
    x: float
    y: float
    theta: float
    forward: float
    curvature: float
    speed: float
    acceleration: float


class Limits(NamedTuple):
    """Limits of the motion along a path."""

    speed: float
    """Greatest speed, m/s."""
    acceleration: float
    """Acceleration along the path, m/s^2."""
    yaw_rate: float
    """Greatest yaw rate in arcs and in turns on the spot, rad/s."""

    def on(self, segment: Segment) -> float:
        """Returns the greatest speed on a line or an arc, m/s."""
        if segment.curvature:
            return min(self.speed, self.yaw_rate / abs(segment.curvature))
        return self.speed


def rest(begin: float, pose: Pose) -> Piece:
    """Returns the piece of a body that rests at a pose from a time on, s."""
    return Piece(begin, *pose, 1.0, 0.0, 0.0, 0.0)


def turning(begin: float, turn: Segment, limits: Limits) -> tuple[list[Piece], float]:
    """Returns the pieces of the fastest turn on the spot, and the time of its end.

    ``begin`` is the time at which the turn begins, s.
    """
    top = min(TURN_RATE_RAD_S, limits.yaw_rate) ** 2
    joints = [0.0, 0.0]
    return pieces_between(begin, [turn], [top], joints, TURN_ACCELERATION_RAD_S2)


def driving(
    begin: float, segments: Sequence[Segment], limits: Limits
) -> tuple[list[Piece], float]:
    """Returns the pieces of the fastest motion from rest to rest, and its end time.

    The function works with squared speeds, which are linear in the distance. A forward
    pass over the ends of the segments limits each squared speed to what the
    acceleration can reach. A backward pass limits it to a value from which the body can
    brake in time. ``begin`` is the time at which the motion begins, s.
    """
    tops = [limits.on(segment) ** 2 for segment in segments]
    joints = [0.0, *(min(pair) for pair in pairwise(tops)), 0.0]
    gains = [2.0 * limits.acceleration * segment.length for segment in segments]
    for k, gain in enumerate(gains):
        joints[k + 1] = min(joints[k + 1], joints[k] + gain)
    for k, gain in reversed(list(enumerate(gains))):
        joints[k] = min(joints[k], joints[k + 1] + gain)
    return pieces_between(begin, segments, tops, joints, limits.acceleration)


def circling(
    begin: float, approach: Sequence[Segment], lap: Sequence[Segment], limits: Limits
) -> tuple[list[Piece], float, float]:
    """Returns the pieces of the fastest motion in endless laps, without a stop.

    Args:
        begin: Time at which the motion begins from rest, s.
        approach: Line to the start of the first lap, or nothing.
        lap: Segments of a lap.
        limits: Limits of the motion.

    Returns:
        The pieces up to the end of the first lap that all later laps repeat; the time
        at which this lap begins, s; and the time at which it ends, s. In the laps
        before it, the body speeds up.

    Raises:
        InputError: The body speeds up for too many laps.
    """
    a = limits.acceleration
    tops = [limits.on(segment) ** 2 for segment in lap]
    gains = [2.0 * a * segment.length for segment in lap]
    count = len(lap)
    # Squared speeds at the starts of the segments. The least of them keeps its value,
    # so that two rounds of each pass reach all others.
    joints = [min(tops[k - 1], tops[k]) for k in range(count)]
    for k in [*range(count)] * 2:
        after = (k + 1) % count
        joints[after] = min(joints[after], joints[k] + gains[k])
    for k in reversed([*range(count)] * 2):
        joints[k] = min(joints[k], joints[(k + 1) % count] + gains[k])
    joints.append(joints[0])
    if joints[0] > _MOST_LAPS * math.fsum(gains):
        raise InputError(
            "acceleration_m_s2",
            f"at {a:g} m/s^2, the body speeds up for more than {_MOST_LAPS} laps; "
            "raise it, or lower speed_m_s",
        )
    speeds = [0.0, *(min(joints[0], 2.0 * a * each.length) for each in approach)]
    pieces, begin = pieces_between(
        begin, approach, [limits.speed**2] * len(approach), speeds, a
    )
    while speeds[-1] != joints[0]:
        speeds = speeds[-1:]
        for gain, joint in zip(gains, joints[1:], strict=True):
            speeds.append(min(joint, speeds[-1] + gain))
        more, begin = pieces_between(begin, lap, tops, speeds, a)
        pieces += more
    more, end = pieces_between(begin, lap, tops, joints, a)
    return [*pieces, *more], begin, end


def pieces_between(
    begin: float,
    segments: Sequence[Segment],
    tops: Sequence[float],
    joints: Sequence[float],
    acceleration: float,
) -> tuple[list[Piece], float]:
    """Splits segments into pieces: speeding up, constant speed, and braking.

    Args:
        begin: Time at which the first segment begins, s.
        segments: The n segments.
        tops: Greatest squared speed on each segment.
        joints: n + 1 squared speeds at the ends of the segments. The acceleration must
            be able to reach each of them from its neighbors.
        acceleration: Acceleration along the segments.

    Returns:
        The pieces, and the time at which the last one ends, s.
    """
    pieces: list[Piece] = []
    for segment, top, (first, last) in zip(
        segments, tops, pairwise(joints), strict=True
    ):
        gain = 2.0 * acceleration * segment.length
        peak = min(top, 0.5 * (first + last + gain))
        up = (peak - first) / (2.0 * acceleration)
        down = (peak - last) / (2.0 * acceleration)
        ways = (
            (0.0, up, first, peak, acceleration),
            (up, segment.length - up - down, peak, peak, 0.0),
            (segment.length - down, down, peak, last, -acceleration),
        )
        for start, way, before, after, rate in ways:
            if way > 0.0:
                speed = math.sqrt(before)
                pieces.append(_piece(begin, segment, start, speed, rate))
                begin += 2.0 * way / (speed + math.sqrt(after))
    return pieces, begin


def _piece(
    begin: float, segment: Segment, s: float, speed: float, rate: float
) -> Piece:
    pose = segment.pose(s)
    return Piece(begin, *pose, segment.forward, segment.curvature, speed, rate)


class Interval(NamedTuple):
    """Times and speeds at the ends of a leg with stated times."""

    begin: float
    """Time at which the body leaves the first waypoint, s."""
    end: float
    """Time at which the body reaches the second waypoint, s."""
    first: float
    """Speed at the first waypoint, m/s."""
    last: float
    """Speed at the second waypoint, m/s."""


def timed(
    segments: Sequence[Segment], interval: Interval, limits: Limits, where: str
) -> list[Piece]:
    """Computes the pieces of a leg that takes a stated time.

    The body changes its speed with the given acceleration to a constant speed, and
    changes it again before the end of the leg.

    Args:
        segments: Lines and arcs of the leg.
        interval: Times and speeds at its ends. The speeds are at most the mean speed.
        limits: Limits of the motion.
        where: Words for messages.

    Returns:
        The pieces.

    Raises:
        InputError: The motion exceeds a limit.
    """
    begin, end, first, last = interval
    time, a = end - begin, limits.acceleration
    length = math.fsum(segment.length for segment in segments)
    # With the ramps (c^2 - u^2) / 2a at both ends, the distance is a quadratic function
    # of the constant speed c. The smaller root leaves time for both ramps.
    half_sum = 0.5 * (a * time + first + last)
    product = 0.5 * (first**2 + last**2) + a * length
    root = half_sum**2 - product
    if root < -1e-9 * half_sum**2:
        b = 2.0 * length - (first + last) * time
        needed = (b + math.hypot(b, (first - last) * time)) / time**2
        raise InputError(
            "waypoint_times_s",
            f"{where}, {length:.3g} m in {time:.3g} s need an acceleration of "
            f"{needed:.3g} m/s^2, not {a:g} m/s^2; allow more time, or raise "
            "acceleration_m_s2",
        )
    top = product / (half_sum + math.sqrt(max(root, 0.0)))
    if top > limits.speed:
        raise InputError(
            "waypoint_times_s",
            f"{where}, {length:.3g} m in {time:.3g} s need {top:.3g} m/s, which is "
            f"above {limits.speed:.3g} m/s; allow more time",
        )
    up, down = (top**2 - first**2) / (2.0 * a), (top**2 - last**2) / (2.0 * a)
    faster, slower = begin + (top - first) / a, end - (top - last) / a
    phases = (
        (0.0, up, begin, first, a),
        (up, length - down, faster, top, 0.0),
        (length - down, length, slower, top, -a),
    )
    pieces, done = [], 0.0
    for segment in segments:
        for start, stop, clock, speed, rate in phases:
            from_s, to_s = max(start, done), min(stop, done + segment.length)
            if to_s - from_s > 0.0:
                now = math.sqrt(max(speed**2 + 2.0 * rate * (from_s - start), 0.0))
                later = math.sqrt(max(speed**2 + 2.0 * rate * (to_s - start), 0.0))
                _check_yaw_rate(max(now, later), segment, limits, where)
                at = clock + (2.0 * (from_s - start) / (speed + now) if now else 0.0)
                pieces.append(_piece(at, segment, from_s - done, now, rate))
        done += segment.length
    return pieces


def _check_yaw_rate(speed: float, segment: Segment, limits: Limits, where: str) -> None:
    yaw_rate = speed * abs(segment.curvature)
    if yaw_rate > limits.yaw_rate * (1.0 + 1e-9):
        raise InputError(
            "waypoint_times_s",
            f"{where}, a corner needs a yaw rate of {yaw_rate:.3g} rad/s, which is "
            f"above {limits.yaw_rate:.3g} rad/s; allow more time, or raise "
            "corner_radius_m",
        )


def backward(pieces: Sequence[Piece], end: float, begin: float) -> list[Piece]:
    """Computes the pieces of the way back, which is the same motion in reverse.

    Args:
        pieces: Pieces of the motion.
        end: Time at which the last of them ends, s.
        begin: Time at which the way back begins, s.

    Returns:
        The pieces in the order of the way back.
    """
    back = []
    for piece, until in zip(pieces, [*(p.begin for p in pieces[1:]), end], strict=True):
        since = until - piece.begin
        s = (piece.speed + 0.5 * piece.acceleration * since) * since
        segment = Segment(*piece[1:6], s)
        speed = -(piece.speed + piece.acceleration * since)
        at = begin + (end - until)
        back.append(_piece(at, segment, s, speed, piece.acceleration))
    return back[::-1]
