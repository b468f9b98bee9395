"""A block that detects objects, with positions and velocities, from beam ranges."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.ranging.beam_groups import BeamNumbers, group_beams
from systems.ranging.object_tracks import (
    NOISE_M,
    TRACK_SIZE,
    TRACKS,
    TrackNumbers,
    track_objects,
)
from systems.ranging.objects import (
    OBJECTS_PORT,
    OBJECTS_SIZE,
    ON_MAP_M,
    VX,
    VY,
    X,
    Y,
    is_on_map,
)
from systems.ranging.parameters import OBJECT_SIZE, UltrasonicParameters
from systems.world.geometry import control_point

# State of one beam: x and y of its last hit in W, m; its range, m; and 1 if there was
# an echo, otherwise 0.
_HIT_X, _HIT_Y, _RANGE, _HEARD = range(4)
_BEAM_SIZE = 4


class DetectorNumbers(NamedTuple):
    """Constants of ``object_detector_step``."""

    axes: NDArray[np.float64]
    """(n,) directions of the beams in B, rad."""
    places: NDArray[np.float64]
    """(n, 2) origins of the beams relative to P, in the axes of B, m."""
    beams: BeamNumbers
    tracks: TrackNumbers
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    oldest_s: float
    """Age of a range above which its sensor counts as failed, s."""
    half_apart_rad: float
    """Half of the largest angle between neighboring beams, rad."""
    known: NDArray[np.float64]
    """(k, 6) rectangles of known obstacles in W."""


@njit(cache=True)
def _keep_hits(
    kept: Any, ranges: Any, echo: Any, ages: Any, pose: Any, numbers: DetectorNumbers
) -> None:  # pragma: no cover  (compiled)
    """Stores the new hits of the beams in the world frame W.

    A beam without a new range keeps its last hit. If the range of a beam is too old,
    the beam counts as a beam without an echo.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(ranges)):
        if ages[k] > numbers.oldest_s:
            kept[k, _HEARD] = 0.0
        elif ages[k] < 0.5 * numbers.tracks.tick_s:
            axis = pose[2] + numbers.axes[k]
            ahead = numbers.control_point_m + numbers.places[k, 0]
            left = numbers.places[k, 1]
            kept[k, _HIT_X] = pose[0] + c * ahead - s * left
            kept[k, _HIT_Y] = pose[1] + s * ahead + c * left
            kept[k, _HIT_X] += ranges[k] * math.cos(axis)
            kept[k, _HIT_Y] += ranges[k] * math.sin(axis)
            kept[k, _RANGE], kept[k, _HEARD] = ranges[k], echo[k]


@njit(cache=True)
def _detect(
    state: Any, ranges: Any, echo: Any, ages: Any, pose: Any, numbers: DetectorNumbers
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Updates the state, and returns the objects of one control period."""
    count = len(ranges)
    kept = state[: _BEAM_SIZE * count].reshape(count, _BEAM_SIZE)
    tracks = state[_BEAM_SIZE * count :].reshape(TRACKS, TRACK_SIZE)
    _keep_hits(kept, ranges, echo, ages, pose, numbers)
    p_WP = control_point((pose[0], pose[1], pose[2]), numbers.control_point_m)
    hits = np.empty((count, 2))
    for k in range(count):
        hits[k, 0] = kept[k, _HIT_X] - p_WP[0]
        hits[k, 1] = kept[k, _HIT_Y] - p_WP[1]
    groups, used = group_beams(
        hits, kept[:, _RANGE].copy(), kept[:, _HEARD].copy(), numbers.beams
    )
    found = track_objects(tracks, groups[:used], p_WP, numbers.tracks)
    for slot in found:
        if slot[VX] == 0.0 and slot[VY] == 0.0:
            continue
        # The nearest point of a surface is off by up to half of the spacing of beams.
        near_m = ON_MAP_M + numbers.half_apart_rad * math.hypot(slot[X], slot[Y])
        x, y = p_WP[0] + slot[X], p_WP[1] + slot[Y]
        if is_on_map(x, y, numbers.known, near_m):
            slot[VX] = slot[VY] = 0.0
    return found


def object_detector_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: DetectorNumbers
) -> None:
    """Computes the objects that the beams hit in one control period.

    The state has the last hit of each beam, followed by the tracks of the objects.
    """
    ranges, echo, ages, pose = inputs
    found = _detect(state, ranges, echo, ages, pose, numbers)
    for k in range(OBJECTS_SIZE):
        outputs[0][k] = found[k // OBJECT_SIZE, k % OBJECT_SIZE]


class ObjectDetector(Block):
    """Groups the hits of beams into objects and estimates the objects' velocities.

    The block replaces ``IdealObjectSensor`` and has the same output port. If hits of
    adjacent beams are close enough, they belong to one object. A hollow surface counts
    as several objects. For each object, the block gives three quantities:

    - the vector from the control point P to the nearest point of the object. The block
      searches for this point among the present hits and the lines between them.
    - the filtered velocity, after the block has tracked the object for long enough.
    - the radius, which is half of the width of the object, or 0 if the object is wide.

    The block keeps an object for 0.5 s after its last hit, because narrow beams do not
    hit an object between them. The beams do not show whether an object is a robot.

    The accuracy has these limits:

    - Beams detect only objects that they hit. With 7 beams, a disc of 0.2 m width is
      certain to be hit only within 0.4 m of P.
    - A motion along a surface is visible only at the edges of the surface. The
      resolution equals the spacing of the beams. As an example, take boxes that cross
      at 0.15 to 0.3 m/s at a distance of 1 m. One second after the boxes come into
      view, the median error of their velocities is 25 % with 36 beams all around, 15 %
      with 72 beams, and 7 % with 360 beams.
    - While the robot turns, bodies at rest seem to move. Their apparent speed is up to
      0.3 m/s with 36 beams, 0.12 m/s with 72 beams, and 0 m/s with 360 beams. Objects
      whose nearest point is on a known obstacle, within 0.1 m and half of the spacing
      of the beams, count as parts of it, so their velocity is 0.
    - Where the spacing of the beams exceeds 0.25 m, no velocity is known. With 7 beams,
      this is the case at distances above 0.48 m.

    The discrete state has the hits and the tracks. The block updates it every control
    period. The output is a function of the state and the inputs. There is no latency,
    but the velocity takes about 0.5 s to follow a change.

    Args:
        sensors: Positions, directions, and firing period of the beams.
        robot: Distance of P ahead of the axle.
        known: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in the world frame W, m and rad. They are at rest.
        tick_s: Control period, s.

    Reference: our own work. Engelbrecht, Steyn and Djouani (2021) state neither how
    beams become obstacles nor how velocities are measured. With one obstacle per beam,
    the sum of the dampings would exceed the largest stable damping for this control
    period.
    """

    part, stage = "objects", "obstacle sensing"
    inputs = (
        Port("ranges", "sensors", "m"),
        Port("echo", "sensors", "0 or 1"),
        Port("range_ages", "sensors", "s"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
    )
    outputs = (OBJECTS_PORT,)

    def __init__(
        self,
        *,
        sensors: UltrasonicParameters = UltrasonicParameters(),
        robot: RobotParameters = RobotParameters(),
        known: ArrayLike = (),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("object_detector")
        numbers = _numbers(sensors, robot, known, tick_s)
        size = _BEAM_SIZE * sensors.count + TRACKS * TRACK_SIZE
        self._step = Step(object_detector_step, numbers, [0.0] * size)
        self.declare(
            self._step,
            tick_s=tick_s,
            sizes={"sensors": sensors.count},
            arrays=True,
        )

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step with the map of the run."""
        known = _rectangles(run.mapped)
        return self._step._replace(numbers=self._step.numbers._replace(known=known))


def _rectangles(known: ArrayLike) -> NDArray[np.float64]:
    return np.array(known, dtype=float).reshape(-1, 6)


def _numbers(
    sensors: UltrasonicParameters,
    robot: RobotParameters,
    known: ArrayLike,
    tick_s: float,
) -> DetectorNumbers:
    apart = np.zeros(sensors.count)
    for left, right in sensors.neighbors:
        apart[left] = (sensors.axes[left] - sensors.axes[right]) % math.tau
    axes, places, _ = sensors.beams
    return DetectorNumbers(
        axes,
        places,
        BeamNumbers(apart, sensors.each("maximum_range_m")),
        TrackNumbers(math.hypot(NOISE_M, sensors.noise_m), tick_s),
        robot.control_point_m,
        oldest_s=(sensors.round_ticks(tick_s) + 0.5) * tick_s,
        half_apart_rad=0.5 * float(np.max(apart)),
        known=_rectangles(known),
    )
