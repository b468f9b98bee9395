"""Quantities of a run of one robot, from which the metrics are computed."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d
from scipy.spatial import KDTree

from analysis.runs.proximity import Proximity
from analysis.runs.shortest_path import shortest_path_length
from analysis.runs.smoothness import jerk, windows
from diagrams.running.stop_rules import REST_SPEED_M_S, ROUNDING_S
from systems.framework.compiling import njit
from systems.world.cones import fan_ranges
from systems.world.geometry import control_point_velocity

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Length of the windows over which the smoothness of the motion is computed, s.
WINDOW_S = 4.0
#: A window in which the robot is always slower than this speed counts as rest, m/s.
MOVING_M_S = 0.05
#: Limits of an encounter with an obstacle. ``MET_M``: greatest clearance during the
#: encounter, m (the distance S of Engelbrecht 2021). ``AFTER_S``: the encounter still
#: lasts for this time after the clearance has become greater, s.
MET_M, AFTER_S = 1.0, 5.0
#: Length of the moving mean of the yaw rate, s. The moving mean contains the intended
#: turns, and the rest is ripple.
MEAN_S = 1.0
#: An echo belongs to a body if the range reading differs from the true range of this
#: body by at most this distance, m.
SAME_M = 0.03


class MeasuredRun(Proximity):
    """A run of one robot, with the quantities that several metrics share.

    Each quantity is computed when a metric first reads it. n is the number of ticks
    (control periods).
    """

    @property
    def columns(self) -> dict[str, Floats]:
        """Columns of the run's table by name, (n,) each."""
        return self.result.columns

    @property
    def time(self) -> Floats:
        """(n,) times of the ticks, s."""
        return self.result.time

    @property
    def tick_s(self) -> float:
        """Length of a tick, s."""
        return self.result.scenario.tick_s

    @property
    def searches(self) -> bool:
        """Whether the robot searches for its source step by step."""
        return self.result.scenario.only.searches is not None

    @property
    def routed(self) -> bool:
        """Whether the robot drives along a route."""
        return self.result.scenario.only.kind == "router"

    def has(self, *names: str) -> bool:
        """Whether the table of the run has all of these columns."""
        return set(names).issubset(self.columns)

    @cached_property
    def obstacle_clearances(self) -> list[float]:
        """Least clearance from each body except the followed source, m."""
        return self.least.tolist()[: len(self.result.surroundings.obstacles)]

    # Path and goal

    @cached_property
    def begin(self) -> int:
        """First tick that counts for the metrics of a search.

        If the robot waits for a call, this is the first tick at which it listens to the
        sound of the caller. Otherwise, it is 0.
        """
        if not self.searches:
            return 0
        return int((self.columns.get("listening", np.zeros(1)) > 1.5).argmax())

    @cached_property
    def end(self) -> int:
        """Last tick that counts: the end of a search, or of the run."""
        if self.searches:
            ended = np.flatnonzero(self.columns["search_ended"] > 0.5)
            if len(ended):
                return int(ended[0])
        return len(self.time) - 1

    @cached_property
    def path_length(self) -> float:
        """Length of the path of B's origin up to the tick ``end``, m."""
        path = self.result.vector("p_WB")[:, : self.end + 1]
        return float(np.sum(lengths(np.diff(path))))

    @cached_property
    def source_distance(self) -> Floats:
        """(n,) distance to the source from P, but in a search from B's origin, m."""
        if not self.searches:
            return self.columns["source_range_true"]
        return lengths(self.result.vector("p_WB") - self.result.poses("WS")[:, :2].T)

    @cached_property
    def search_steps(self) -> float:
        """Number of moves that the robot began in its search."""
        return float(self.columns["search_steps"][self.end])

    @cached_property
    def in_goal(self) -> Flags:
        """(n,) whether P is in the goal, a circle around the source."""
        return self.columns["source_range_true"] <= self.result.goal_radius_m

    @cached_property
    def settling_time(self) -> float | None:
        """Time from which P stays in the goal until the run ends, s.

        If the source is at rest, P must also be at rest from this time to the end of
        the run, and this rest must last at least ``stop.rest_time_s``. With a rest time
        of 0, P need not be at rest. The value is None if there is no such time.
        """
        settled, least = self.in_goal, 0.0
        rest_time_s = self.result.scenario.stop.rest_time_s
        if not self.result.target_moves and rest_time_s > 0.0:
            settled = settled & (self._speed_of_P < REST_SPEED_M_S)
            least = rest_time_s - ROUNDING_S
        exits = np.flatnonzero(~settled)
        first = int(exits[-1]) + 1 if len(exits) else 0
        if first == len(settled) or self.time[-1] - self.time[first] < least:
            return None
        return float(self.time[first])

    @cached_property
    def shortest_path(self) -> float | None:
        """Length of the shortest path from the start to the goal, m.

        The path is that of a disc as wide as the robot. It ends where the control point
        P can reach the edge of the goal. The value is None if the source moves, or if
        there is no path.
        """
        result, robot = self.result, self.result.scenario.only
        if result.target_moves:
            return None
        bodies = result.surroundings.obstacles.values()
        length = shortest_path_length(
            robot.start.position_m,
            result.surroundings.followed.path.pose(0.0)[:2],
            result.goal_radius_m + robot.robot.control_point_m,
            [
                row
                for body in bodies
                if not body.path.moves
                for row in body.rectangles(0.0)
            ],
            robot.robot.width_m / 2.0,
        )
        return length if math.isfinite(length) else None

    @property
    def _speed_of_P(self) -> Floats:
        velocity = *self.result.vector("v_WB"), self.columns["omega_WB"]
        offset = self.result.scenario.only.robot.control_point_m
        return lengths(
            control_point_velocity(self.columns["theta_WB"], velocity, offset)
        )

    # Following, and driving along a route

    @cached_property
    def following_error(self) -> Floats:
        """(n,) distance from P to the source minus the follow distance, m."""
        distance = self.columns["source_range_true"]
        return distance - self.result.scenario.only.follow_distance_m

    @cached_property
    def after_second_burst(self) -> Flags:
        """(n,) whether the second burst of sound from the source is over."""
        sound = self.result.scenario.source.sound
        return self.time >= sound.start_s + sound.period_s + sound.on_s

    @cached_property
    def target_valid(self) -> Flags:
        """(n,) whether the robot has a valid target."""
        return self.columns["target_valid"] > 0.5

    @cached_property
    def route_deviation(self) -> Floats:
        """(n,) distance of P from the path along which the target moved, m."""
        # The target moves along the route. At the end of the run, it is ahead of P.
        path = KDTree(self.result.vector("target").T)
        distances: Floats = path.query(self.result.vector("p_WP").T)[0]
        return distances

    @cached_property
    def in_encounter(self) -> Flags:
        """(n,) whether the robot meets a body, as defined by ``near_and_after``."""
        if not len(self.bodies):
            return np.zeros(len(self.time), dtype=bool)
        return near_and_after(self.clearance, self.tick_s)

    # Motion and effort

    @cached_property
    def speed(self) -> Floats:
        """(n,) speed of B's origin, m/s."""
        return lengths(self.result.vector("v_WB"))

    @cached_property
    def jerk(self) -> Floats:
        """(m,) magnitude of the jerk of B's origin, m/s^3, m < n; see ``jerk``."""
        return lengths(jerk(self.result.vector("v_WB").T, self.tick_s).T)

    @cached_property
    def movements(self) -> Floats:
        """(k, m) speeds in the k windows of 4 s in which the robot moves, m/s.

        A window with constant acceleration is left out, because it has no jerk.
        """
        parts = windows(self.speed, round(WINDOW_S / self.tick_s))
        moving = np.max(parts, axis=1, initial=0.0) >= MOVING_M_S
        return parts[moving & np.any(np.diff(parts, 2) != 0.0, axis=1)]

    @cached_property
    def wheel_speeds(self) -> Floats:
        """(2, n) commanded speeds of the wheels, rad/s."""
        return np.array([self.columns[f"wheel_speed_{x}"] for x in ("left", "right")])

    @cached_property
    def echo_times(self) -> tuple[float | None, float | None]:
        """Times from the first echo and from the last echo to the collision, s.

        Only echoes of the body that the robot hits count. Both times are None if the
        run had no collision, or if this body never caused an echo. The robot must have
        range sensors.
        """
        hit = self.result.collision
        if hit is None:
            return None, None
        known = self.time[self._echoes(hit.object)]
        if not len(known):
            return None, None
        first, last = np.maximum(hit.time - known[[0, -1]], 0.0).tolist()
        return first, last

    def _echoes(self, name: str) -> Flags:
        """(n,) whether any sensor had an echo of the body with this name."""
        scenario = self.result.scenario
        sensors = scenario.sensing.ultrasonic
        body = self.result.surroundings.bodies[name].rectangles_over(self.time)
        offset = scenario.only.robot.control_point_m
        ranges = _cone_ranges(self.result.poses("WB"), body, *sensors.beams, offset)
        numbers = range(1, sensors.count + 1)
        read = np.stack([self.columns[f"range_{k}"] for k in numbers], axis=1)
        echo = np.stack([self.columns[f"echo_{k}"] for k in numbers], axis=1) > 0.5
        return np.any(echo & (np.abs(read - ranges) <= SAME_M), axis=1)

    @cached_property
    def odometry_error(self) -> Floats:
        """(n,) distance from the true position to that by odometry, m."""
        return lengths(
            self.result.vector("p_WB_estimated") - self.result.vector("p_WB")
        )

    # Hearing

    @cached_property
    def frames_with_sound(self) -> Flags:
        """(n,) whether an audio frame with sound ends at each tick.

        A frame has sound if the schedule of the source states that the source sounds in
        the middle of the frame. Therefore a pause within a recording counts as sound.
        With the hearing ``audio``, the travel time of the sound is included. With the
        hearing ``ideal_always``, every frame has sound.
        """
        return self._new_frames & self._sounding

    @cached_property
    def detections(self) -> Flags:
        """(n,) whether an audio frame ends, and the robot detected the source in it."""
        return self._new_frames & (self.columns["detected"] > 0.5)

    @cached_property
    def ranged_detections(self) -> Flags:
        """(n,) whether there is a detection that includes a range."""
        return self.detections & (self.columns["range_valid"] > 0.5)

    @cached_property
    def source_errors(self) -> Floats:
        """Position error of each detection that includes a range, m."""
        away = self.result.vector("p_WS_estimated") - self.result.vector("p_WS")
        # The column ``p_WS_estimated`` contains a detection from the next tick on.
        return lengths(away[:, 1:][:, self.ranged_detections[:-1]])

    @cached_property
    def _sounding(self) -> Flags:
        """(n,) whether the source sounds in the middle of a frame that ends now."""
        scenario = self.result.scenario
        travel = np.zeros(len(self.time))
        if scenario.follower.hearing == "audio":
            # The distance at the end of the frame stands for that in the middle.
            travel = self.columns["source_range_true"] / scenario.sound_speed_m_s
        elif scenario.follower.hearing == "ideal_always":
            return np.ones(len(self.time), dtype=bool)
        middle = 0.5 * scenario.follower.microphones.frame_s
        sounds: Flags = scenario.source.sound.sounds(self.time - middle - travel)
        return sounds

    @cached_property
    def _new_frames(self) -> Flags:
        frame_s = self.result.scenario.follower.microphones.frame_s
        ticks = np.rint(self.time / self.tick_s).astype(int)
        new: Flags = (ticks > 0) & (ticks % round(frame_s / self.tick_s) == 0)
        return new


@njit(cache=True)
def _cone_ranges(
    poses: Floats,
    body: Floats,
    axes: Floats,
    places: Floats,
    half_angles: Floats,
    control_point_m: float,
) -> Floats:  # pragma: no cover  (compiled)
    """(n, sensors) true ranges to a body (m, n, 6) over time, m; see ``fan_ranges``."""
    ranges = np.empty((len(poses), axes.size))
    for i in range(len(poses)):
        ranges[i] = fan_ranges(
            poses[i], body[:, i], axes, places, half_angles, control_point_m
        )
    return ranges


def near_and_after(clearance: ArrayLike, period_s: float) -> Flags:
    """(n,) whether an obstacle is nearer than 1 m, or has been within the last 5 s.

    The argument ``clearance`` (n,) is that of the nearest obstacle, m. The samples
    have intervals of ``period_s``, s.
    """
    near = np.asarray(clearance, dtype=float) < MET_M
    ticks = np.arange(len(near))
    last = np.maximum.accumulate(np.where(near, ticks, -len(near) - 1e9))
    return np.asarray(ticks - last <= AFTER_S / period_s + 1e-9)


def yaw_ripple(rate: ArrayLike, where: Flags, period_s: float) -> float | None:
    """Computes the RMS value of a yaw rate (n,) minus its moving mean over 1 s.

    The moving mean includes all samples. The RMS value includes only the samples for
    which ``where`` (n,) is true. The result has the unit of the rate. It is None if
    ``where`` is never true.
    """
    if not np.any(where):
        return None
    rate = np.asarray(rate, dtype=float)
    width = 2 * round(0.5 * MEAN_S / period_s) + 1
    ripple = rate - uniform_filter1d(rate, width, mode="nearest")
    return float(np.sqrt(np.mean(ripple[where] ** 2)))


def lengths(vectors: Iterable[Floats]) -> Floats:
    """(n,) lengths of n vectors (2, n), three times faster than ``numpy.hypot``."""
    x, y = vectors
    found: Floats = np.sqrt(x * x + y * y)
    return found


def share(flags: Flags) -> float | None:
    """Returns the share of flags that are true, 0 to 1; None if there are no flags."""
    return int(np.count_nonzero(flags)) / len(flags) if len(flags) else None


def rms(values: Floats) -> float | None:
    """Returns the root mean square; None if there are no values."""
    return math.sqrt(values @ values / len(values)) if len(values) else None


def quantile(values: Floats, q: float) -> float | None:
    """Returns the quantile q of values, like ``numpy.quantile``, but much faster."""
    if not len(values):
        return None
    place = q * (len(values) - 1)
    low = int(place)
    high = min(low + 1, len(values) - 1)
    ordered = np.partition(values, (low, high))
    return float(ordered[low] + (place - low) * (ordered[high] - ordered[low]))
