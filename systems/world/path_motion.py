"""Computes the motion of a body through its waypoints: driving, stops, and repetition.

``systems/world/path_segments.py`` has the geometry of the path, and
``systems/world/path_pieces.py`` the speed along it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

from systems.framework.input_error import InputError
from systems.world.path_pieces import (
    Interval,
    Limits,
    Piece,
    backward,
    circling,
    driving,
    rest,
    timed,
    turning,
)
from systems.world.path_segments import Leg, Segment, approach, driven, make_legs

AtEnd = Literal["stop", "shuttle", "loop"]


class Motion(NamedTuple):
    """The pieces of a motion, which may repeat the last of them for ever."""

    pieces: list[Piece]
    repeats_from: float
    """Time at which the repeated pieces begin, s."""
    period: float
    """Duration of the repeated pieces, s; infinite if the body rests at the end."""
    duration: float
    """Time from the start to the last waypoint, or of a lap, s."""
    length: float
    """Length of the path from the first waypoint to the last, or of a lap, m."""


class Waypoints(NamedTuple):
    """The waypoints of a path, with one pause each, and with one time each or none."""

    points: tuple[tuple[float, float], ...]
    pauses: tuple[float, ...]
    times: tuple[float, ...]


def checked_waypoints(
    points: Sequence[tuple[float, float]],
    pauses: Sequence[float],
    times: Sequence[float],
    at_end: AtEnd,
) -> Waypoints:
    """Checks the waypoints of a path, and completes them.

    Args:
        points: Points in W, m.
        pauses: Pause at each point, s, or nothing.
        times: Time of each point, s, or nothing.
        at_end: ``stop``, ``shuttle`` or ``loop``, see ``WaypointPath``.

    Returns:
        The waypoints with a pause each. A loop has its first point again at its end.

    Raises:
        InputError: There is no point, or the pauses or times do not fit the points.
    """
    if not points:
        raise InputError("waypoints_m", "no point is given; give at least one")
    count = len(points)
    for field, values in (("pauses_s", pauses), ("waypoint_times_s", times)):
        if values and len(values) != count:
            raise InputError(
                field,
                f"has {len(values)} values for {count} waypoints; give one value per "
                f"waypoint, for example {[float(k) for k in range(count)]}",
            )
    for k, (before, after) in enumerate(pairwise(times)):
        if not after > before:
            raise InputError(
                f"waypoint_times_s.{k + 1}",
                f"{after:g} s is not after the time before it, {before:g} s; give "
                "increasing times",
            )
    pauses = [*pauses] or [0.0] * count
    if at_end == "loop" and count > 1:
        if points[-1] != points[0]:
            if times:
                raise InputError(
                    "waypoint_times_s",
                    "a loop also needs the time of the return to the first waypoint; "
                    f"add {list(points[0])} to the end of waypoints_m, and its time",
                )
            points, pauses = [*points, points[0]], [*pauses, pauses[0]]
        pauses[-1] = max(pauses[0], pauses[-1])
    return Waypoints(tuple(points), tuple(pauses), tuple(times))


def plan_motion(
    waypoints: Waypoints, at_end: AtEnd, corner_radius: float, limits: Limits
) -> Motion:
    """Computes the motion through at least two waypoints.

    Args:
        waypoints: Points, pauses and times.
        at_end: ``stop``, ``shuttle`` or ``loop``, see ``WaypointPath``.
        corner_radius: Largest radius of the corners, m.
        limits: Limits of the motion.

    Returns:
        The motion.

    Raises:
        InputError: Two neighbors coincide, or the times need a motion beyond a limit.
    """
    closed = at_end == "loop"
    points, pauses, times = waypoints
    stops = [pause > 0.0 for pause in pauses]
    legs = make_legs(points, corner_radius, stops, closed=closed)
    length = math.fsum(each.length for leg in legs for each in driven(leg))
    onto = approach(legs[0], points[0]) if closed else []
    first = (onto or driven(legs[0]))[0].pose(0.0)
    start = (times[0] if times else 0.0) + pauses[0]
    pieces = [rest(0.0, first)] if start > 0.0 else []
    trip = None
    if times:
        trip = _timed_trip(legs, onto, waypoints, limits, closed=closed)
    if closed:
        more, begin, end = trip or _laps(legs, onto, pauses, start, limits)
        return Motion([*pieces, *more], begin, end - begin, end - begin, length)
    more, _, end = trip or _trip(legs, pauses, start, limits)
    last = legs[-1].line.pose(legs[-1].line.length)
    pieces += more
    if at_end == "stop":
        return Motion([*pieces, rest(end, last)], math.inf, math.inf, end, length)
    back = end + pauses[-1]
    pieces += [rest(end, last)] * (pauses[-1] > 0.0)
    pieces += backward(more, end, back)
    once = times[0] if times else 0.0
    return Motion(pieces, once, back + (end - start) - once, end, length)


def _standing(
    begin: float, leg: Leg, until: float, limits: Limits
) -> tuple[list[Piece], float]:
    """Returns the pieces of the stop at the end of a leg, and the time of its end.

    The body rests first. Then it turns on the spot, so that the turn ends at the time
    ``until``, s. If the time is too short for the turn, the stop takes longer.
    """
    there = leg.line.pose(leg.line.length)
    if leg.corner is None:
        return [rest(begin, there)] * (until > begin), max(until, begin)
    turn_time = turning(0.0, leg.corner, limits)[1]
    turns_at = max(until - turn_time, begin)
    pieces, end = turning(turns_at, leg.corner, limits)
    return [*([rest(begin, there)] * (turns_at > begin)), *pieces], end


def _trip(
    legs: Sequence[Leg],
    pauses: Sequence[float],
    begin: float,
    limits: Limits,
    onto: Sequence[Segment] = (),
) -> tuple[list[Piece], float, float]:
    """Returns the pieces from the start to the last waypoint, and their times.

    ``pauses`` has the pause at the first waypoint, which has passed, and at all others.
    The pieces do not contain the pause at the last waypoint. ``onto`` precedes the
    first leg.
    """
    pieces: list[Piece] = []
    section, clock = [*onto], begin
    for leg, pause in zip(legs, pauses[1:], strict=True):
        section += driven(leg)
        if leg.stops:
            more, clock = driving(clock, section, limits)
            pieces += more
            section = []
            if leg is not legs[-1]:
                more, clock = _standing(clock, leg, clock + pause, limits)
                pieces += more
    return pieces, begin, clock


def _laps(
    legs: Sequence[Leg],
    onto: Sequence[Segment],
    pauses: Sequence[float],
    begin: float,
    limits: Limits,
) -> tuple[list[Piece], float, float]:
    """Returns the pieces of a loop, and the times of the repeated pieces.

    The repeated pieces begin and end at the first stop of a lap. Without a stop, they
    are a lap.
    """
    stop = next((k for k, leg in enumerate(legs) if leg.stops), None)
    if stop is None:
        lap = [segment for leg in legs for segment in driven(leg)]
        return circling(begin, onto, lap, limits)
    head, tail = [*legs[: stop + 1]], [*legs[stop + 1 :]]
    pieces, _, first = _trip(head, pauses[: stop + 2], begin, limits, onto)
    standing, clock = _standing(first, legs[stop], first + pauses[stop + 1], limits)
    around = [0.0, *pauses[stop + 2 :], *pauses[1 : stop + 2]]
    more, _, end = _trip([*tail, *head], around, clock, limits)
    return [*pieces, *standing, *more], first, end


def _timed_trip(
    legs: Sequence[Leg],
    onto: Sequence[Segment],
    waypoints: Waypoints,
    limits: Limits,
    *,
    closed: bool,
) -> tuple[list[Piece], float, float]:
    """Returns the pieces from the first time on, and the times of the repeated pieces.

    A body on a closed path starts its first lap from rest. The second lap is the one
    that repeats. The time of a waypoint is that of the middle of its arc.
    """
    _, pauses, times = waypoints
    ways = []
    for k, leg in enumerate(legs):
        into = legs[k - 1].corner if not legs[k - 1].stops else None
        out = leg.corner if not leg.stops else None
        line = driven(leg)[: -1 if out else None]
        ways.append([*_half(into, 1), *line, *_half(out, 0)])
    seam = 0.0
    if not legs[-1].stops:
        steps = times[1] - times[0], times[-1] - times[-2]
        seam = min(_length(ways[0]) / steps[0], _length(ways[-1]) / steps[1])
    first_ways = [[*onto, *ways[0][1:]], *ways[1:]] if onto else ways
    begin = times[0] + pauses[0]
    lap = _TimedLap(legs, waypoints, limits)
    pieces = lap.pieces(first_ways, 0.0, begin, (0.0, seam))
    if not closed:
        return pieces, begin, times[-1]
    stop: list[Piece] = []
    again, begin = times[-1] - times[0], times[-1]
    if legs[-1].stops:
        stop, begin = _standing(begin, legs[-1], begin + pauses[-1], limits)
    pieces += [*stop, *lap.pieces(ways, again, begin, (seam, seam))]
    return pieces, times[-1], times[-1] + again


class _TimedLap(NamedTuple):
    """Computes the pieces from the first waypoint to the last, at stated times."""

    legs: Sequence[Leg]
    waypoints: Waypoints
    limits: Limits

    def pieces(
        self,
        ways: Sequence[Sequence[Segment]],
        later: float,
        begin: float,
        ends: tuple[float, float],
    ) -> list[Piece]:
        """Computes the pieces of a lap.

        At a waypoint where the body does not stop, its speed is the lower of the mean
        speeds of both legs.

        Args:
            ways: Segments from each waypoint to the next.
            later: Time by which all times are later than stated, s.
            begin: Time at which the body leaves the first waypoint, s.
            ends: Speeds at the first and the last waypoint, m/s.

        Returns:
            The pieces.

        Raises:
            InputError: The body leaves a waypoint after the time of the next one.
        """
        limits, times, speed = self.limits, self.waypoints.times, ends[0]
        stops: list[list[Piece]] = []
        begins, last = [begin], len(ways) - 1
        for k, leg in enumerate(self.legs[:-1], start=1):
            stop: list[Piece] = []
            leave = times[k] + later
            if leg.stops:
                until = leave + self.waypoints.pauses[k]
                stop, leave = _standing(leave, leg, until, limits)
            stops.append(stop)
            begins.append(leave)
        steps = [times[k + 1] + later - time for k, time in enumerate(begins)]
        for k, step in enumerate(steps):
            if not step > 0.0:
                raise InputError(
                    f"waypoint_times_s.{k + 1}",
                    f"at {times[k + 1]:g} s, the body is still at the waypoint before, "
                    f"until {begins[k] - later:.3g} s; give a later time",
                )
        means = [_length(way) / step for way, step in zip(ways, steps, strict=True)]
        pieces: list[Piece] = []
        for k, way in enumerate(ways):
            after = ends[1]
            if k < last:
                after = 0.0 if self.legs[k].stops else min(means[k : k + 2])
            interval = Interval(begins[k], times[k + 1] + later, speed, after)
            where = f"from waypoints_m.{k} to waypoints_m.{k + 1}"
            pieces += timed(way, interval, limits, where)
            pieces += stops[k] if k < last else []
            speed = after
        return pieces


def _half(arc: Segment | None, which: int) -> list[Segment]:
    """Returns the first (0) or second (1) half of an arc, if there is an arc."""
    if arc is None:
        return []
    middle = 0.5 * arc.length
    return [arc.part(which * middle, (1 + which) * middle)]


def _length(way: Sequence[Segment]) -> float:
    return math.fsum(segment.length for segment in way)
