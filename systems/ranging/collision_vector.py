"""From three ranges to the vector that points at the obstacle."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.block import Block_, Port, RunFacts, Step
from systems.framework.scalar_math import float_of
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.ranging.parameters import CollisionVectorParameters, UltrasonicParameters
from systems.world.geometry import control_point, rotate

#: Collision vectors that a controller takes at once.
SLOTS = 3


@register_jitable
def echo_point(range_: Any, axis: Any, position: Any) -> Any:
    """Where an echo is taken to lie: on the sensor's axis.

    Args:
        range_: Range r_i, m; float or AutoDiffXd.
        axis: Direction phi_i of the sensor in B, rad.
        position: Place p_PU_i of the sensor from P, m.

    Returns:
        (x, y) from P in B axes, m. Han 2019, eq. 11 prints a minus sign and
        mixes d with r; eq. 13 swaps the axes.
    """
    return (
        position[0] + range_ * math.cos(axis),
        position[1] + range_ * math.sin(axis),
    )


def echo_points(ranges: Any, echo: Any, sensors: UltrasonicParameters) -> Any:
    """The points that the sensors see, None where there is no echo.

    Args:
        ranges: (n,) ranges r_i, m; floats or AutoDiffXd.
        echo: (n,) 1 where there is an echo, else 0.
        sensors: Axes and places of the sensors.

    Returns:
        For each sensor (x, y) from P in B, m, or None.
    """
    return [
        echo_point(range_, axis, position) if heard > 0.5 else None
        for range_, heard, axis, position in zip(
            ranges, echo, sensors.axes, sensors.places, strict=True
        )
    ]


@register_jitable
def carried_point(
    point: Any, pose_then: Any, pose_now: Any, control_point_m: Any
) -> Any:
    """Where a point that was seen from another pose lies now, if it rests.

    Args:
        point: (x, y) from P in B axes as seen then, m; floats or AutoDiffXd.
        pose_then: (x, y, theta) of the robot then, m and rad.
        pose_now: The same now.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        (x, y) from P in B axes now, m.
    """
    p_then = control_point(pose_then, control_point_m)
    p_now = control_point(pose_now, control_point_m)
    x, y = rotate(pose_then[2], point[0], point[1])
    dx, dy = p_then[0] - p_now[0] + x, p_then[1] - p_now[1] + y
    return rotate(-pose_now[2], dx, dy)


@register_jitable
def foot_on_segment(a: Any, b: Any) -> Any:
    """Point of the segment a-b that is nearest to the origin.

    Args:
        a: (x, y), m; floats or AutoDiffXd.
        b: (x, y), m.

    Returns:
        (x, y), m. Han 2019, eq. 14 has a wrong sign and a singular slope, and
        does not keep the foot on the segment; a foot outside of it points at
        empty space.
    """
    ex, ey = b[0] - a[0], b[1] - a[1]
    squared = ex * ex + ey * ey
    if squared == 0.0:
        return a
    t = -(a[0] * ex + a[1] * ey) / squared
    if t <= 0.0:
        return a
    if t >= 1.0:
        return b
    return a[0] + t * ex, a[1] + t * ey


def collision_vectors(
    points: Any, parameters: CollisionVectorParameters, neighbours: Any = None
) -> Any:
    """Collision vectors from the points that the sensors see.

    Args:
        points: n entries, left to right: (x, y) from P in m, or None where there
            is no echo.
        parameters: The aggregation rule.
        neighbours: Pairs of sensors next to one another, from 0, the left one first
            (``UltrasonicParameters.neighbours``); none: each and the next.

    Returns:
        Up to ``SLOTS`` (feature, x, y), the nearest ones. The feature names what the
        vector stands on, so that a jump from one to another is not taken for a
        motion: 1 to n one sensor (case I, Han 2019, eq. 12), n + k sensor k and its
        right neighbour (case II, eq. 14).
    """
    if neighbours is None:
        neighbours = pairwise(range(len(points)))
    return _vectors(
        [(0.0, 0.0) if point is None else point for point in points],
        [point is not None for point in points],
        [*neighbours],
        parameters.pair_separation_m,
        joined=parameters.aggregation == "paper",
        every=parameters.aggregation == "sum",
    )


@register_jitable
def _vectors(points, heard, neighbours, separation, joined, every):
    """``collision_vectors``; points that are not heard may lie anywhere."""
    nearest = -1
    for k in range(len(points)):
        if not heard[k]:
            continue
        if nearest < 0 or _squared(points[k]) < _squared(points[nearest]):
            nearest = k
    found = [(0.0 * x, x, y) for x, y in points[:0]]
    if nearest < 0:
        return found
    pairs = [
        (int(pair[0]), int(pair[1]))
        for pair in neighbours
        if heard[int(pair[0])]
        and heard[int(pair[1])]
        and _close(points[int(pair[0])], points[int(pair[1])], separation)
    ]
    if every:
        return _all_vectors(points, heard, pairs, found)
    if joined:
        # Of the neighbours that are close enough the nearer to P.
        best, least = -1, math.inf
        for index in range(len(pairs)):
            left, right = pairs[index]
            if nearest in (left, right):
                other = points[right if left == nearest else left]
                if float_of(_squared(other)) < least:
                    best, least = index, float_of(_squared(other))
        if best >= 0:
            found.append(_pair(points, pairs[best][0], pairs[best][1]))
            return found
    x, y = points[nearest]
    found.append((0.0 * x + (1.0 + nearest), x, y))
    return found


@register_jitable
def _squared(point):
    return point[0] * point[0] + point[1] * point[1]


@register_jitable
def _close(a, b, separation):
    return _squared((b[0] - a[0], b[1] - a[1])) < separation * separation


@register_jitable
def _pair(points, left, right):
    x, y = foot_on_segment(points[left], points[right])
    return 0.0 * x + (1.0 + len(points) + left), x, y


@register_jitable
def _all_vectors(points, heard, pairs, vectors):
    """A vector for each pair, and for each echo that is in none; the nearest."""
    for left, right in pairs:
        vectors.append(_pair(points, left, right))
    for k in range(len(points)):
        alone = heard[k]
        for left, right in pairs:
            alone = alone and k not in (left, right)
        if alone:
            vectors.append((0.0 * points[k][0] + (1.0 + k), points[k][0], points[k][1]))
    if len(vectors) <= SLOTS:
        return vectors
    nearest = vectors[:0]
    for _ in range(SLOTS):
        first = 0
        for k in range(1, len(vectors)):
            if _squared(vectors[k][1:]) < _squared(vectors[first][1:]):
                first = k
        nearest.append(vectors.pop(first))
    return nearest


@register_jitable
def fill_slots(vectors: Any, outputs: Any) -> None:
    """Fills the ports of vectors, mask and features: 6, 3 and 3 elements.

    Args:
        vectors: At most three (feature, x, y), from P, m.
        outputs: Vectors, m, mask, 1 or 0, and features; zeros, which they remain
            where there is nothing.
    """
    vectors_B, mask, features = outputs
    for k in range(len(vectors)):
        feature, x, y = vectors[k]
        vectors_B[2 * k], vectors_B[2 * k + 1] = x, y
        mask[k] = mask[k] + 1.0
        features[k] = feature


#: What every block says of itself that obstacle sensing ends in.
#: Output ports of every block that senses obstacles.
COLLISION_PORTS = (
    Port(
        "collision_vectors_B",
        2 * SLOTS,
        "m, three slots of x and y",
        tuple(
            f"collision_{slot}_B_{axis}"
            for slot in range(1, SLOTS + 1)
            for axis in "xy"
        ),
    ),
    Port("mask", SLOTS, "0 or 1, one per slot"),
    Port(
        "features",
        SLOTS,
        "number of the sensor, pair of sensors or body of the vector, 0 none",
        "feature_{}",
    ),
)


class CollisionNumbers(NamedTuple):
    """What the step of ``CollisionVector`` depends on."""

    separation_m: float
    """Echoes farther apart are not joined, m."""
    joined: bool
    """Whether the nearest echo is joined with a neighbour."""
    every: bool
    """Whether every echo or pair has its own vector."""
    axes: list[float]
    """Of the sensors in B, rad."""
    places: list[tuple[float, float]]
    """Of the sensors from P, m."""
    neighbours: list[tuple[int, int]]
    """Pairs of sensors."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    tick_s: float


def collision_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Collision vectors of one tick; see ``systems.framework.block.Step``.

    Args:
        tick: Not used.
        state: Poses at the ticks of a round before this one, the last tick first, m
            and rad; none where every range is new at every tick.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``CollisionNumbers``.
    """
    ranges, echo, ages, pose = inputs
    points = [
        echo_point(ranges[k], numbers.axes[k], numbers.places[k])
        for k in range(len(ranges))
    ]
    if len(state):
        for k in range(len(points)):
            ticks = round(float_of(ages[k]) / numbers.tick_s)
            if ticks > 0:
                # A sensor that has failed is older than all poses that are kept.
                at = min(3 * (ticks - 1), len(state) - 3)
                then = state[at], state[at + 1], state[at + 2]
                now = pose[0], pose[1], pose[2]
                points[k] = carried_point(points[k], then, now, numbers.control_point_m)
        for k in range(len(state) - 1, 2, -1):
            state[k] = state[k - 3]
        for k in range(3):
            state[k] = pose[k]
    vectors = _vectors(
        points,
        [flag > 0.5 for flag in echo],
        numbers.neighbours,
        numbers.separation_m,
        numbers.joined,
        numbers.every,
    )
    fill_slots(vectors, outputs)


@define_for_scalars("CollisionVector_", __name__)
def CollisionVector_(T):
    class Impl(Block_[T]):
        """Turns echoes into collision vectors from P (cases I and II).

        Slots are filled from the first; only ``aggregation: sum`` fills more
        than one. Where all sensors fire at every tick, a function of the present
        ranges: no state, no latency; the ports of age and pose are not read.
        Otherwise a range that is held stands for a point at rest in W: the block
        converts this point to the present pose. An obstacle's own motion since that
        sensor fired, up to a round less a tick, remains an error.

        Discrete state, every tick, where ranges are held: the poses of the ticks of
        a round before this one, two for three sensors that fire one after the other.

        Args:
            parameters: ``CollisionVectorParameters``.
            sensors: Places, period and order of firing, ``UltrasonicParameters``.
            robot: Place of P.
            initial_pose: (x, y, theta) before time zero, m and rad.
            tick_s: Period of the robot, s.

        Reference: Han 2019, eq. 11-14, with the corrections of docs/errata.md.
        """

        part, stage = "collision", "obstacle sensing"
        inputs = (
            Port("ranges", "sensors", "m"),
            Port("echo", "sensors", "0 or 1"),
            Port("range_ages", "sensors", "s"),
            Port("pose_WB_estimated", 3, "m, m, rad"),
        )
        outputs = COLLISION_PORTS

        def _construct(
            self,
            *,
            parameters: CollisionVectorParameters = CollisionVectorParameters(),
            sensors: UltrasonicParameters = UltrasonicParameters(),
            robot: RobotParameters = RobotParameters(),
            initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
            tick_s: float = TICK_S,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("collision_vector")
            past_poses = sensors.round_ticks(tick_s) - 1
            numbers = CollisionNumbers(
                parameters.pair_separation_m,
                parameters.aggregation == "paper",
                parameters.aggregation == "sum",
                [*sensors.axes],
                [*sensors.places],
                [*sensors.neighbours],
                robot.control_point_m,
                tick_s,
            )
            self.declare(
                Step(collision_step, numbers, [*initial_pose] * past_poses),
                tick_s=tick_s,
                sizes={"sensors": sensors.count},
                unread=() if past_poses else ("range_ages", "pose_WB_estimated"),
            )

        def step_for(self, run: RunFacts) -> Step:
            """The step, with the initial pose of the run."""
            past_poses = len(self.step.state) // 3
            return self.step._replace(state=[*run.initial_pose] * past_poses)

    return Impl


CollisionVector = CollisionVector_[None]
