"""Computation of collision vectors, which point at obstacles, from sensor ranges."""

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

#: Largest number of collision vectors in one tick (control period).
SLOTS = 3
#: Largest distance between two echoes of the same obstacle, m.
PAIR_SEPARATION_M = 0.5


@register_jitable
def echo_point(range_: Any, axis: Any, position: Any) -> Any:
    """Computes the position of an echo, as if it came from the axis of the sensor.

    The function corrects two equations of Han 2019. Eq. 11 has a wrong sign and
    confuses the symbols d and r. Eq. 13 swaps the axes.

    Args:
        range_: Range r_i of sensor i, m; float or AutoDiffXd.
        axis: Direction phi_i of the sensor in the axes of the body B, rad.
        position: Position (x, y) of the sensor relative to the control point P, in the
            axes of B, m.

    Returns:
        Position (x, y) of the echo relative to P, in the axes of B, m.
    """
    return (
        position[0] + range_ * math.cos(axis),
        position[1] + range_ * math.sin(axis),
    )


def echo_points(ranges: Any, echo: Any, sensors: UltrasonicParameters) -> Any:
    """Computes the positions of the echoes of all sensors.

    Args:
        ranges: (n,) ranges, m; floats or AutoDiffXd.
        echo: (n,) 1 if the sensor has an echo, otherwise 0.
        sensors: Directions and positions of the sensors.

    Returns:
        List with one entry per sensor: the position (x, y) of the echo relative to the
        control point P, in the axes of the body, m. The entry is None if the sensor has
        no echo.
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
    """Converts a point at rest from an earlier pose of the robot to the present pose.

    Args:
        point: Position (x, y) relative to the control point P at the earlier pose, in
            the axes of the body, m; floats or AutoDiffXd.
        pose_then: Earlier pose (x, y, theta) of the robot, m and rad.
        pose_now: Present pose (x, y, theta) of the robot, m and rad.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        Position (x, y) relative to P at the present pose, in the axes of the body, m.
    """
    p_then = control_point(pose_then, control_point_m)
    p_now = control_point(pose_now, control_point_m)
    x, y = rotate(pose_then[2], point[0], point[1])
    dx, dy = p_then[0] - p_now[0] + x, p_then[1] - p_now[1] + y
    return rotate(-pose_now[2], dx, dy)


@register_jitable
def foot_on_segment(a: Any, b: Any) -> Any:
    """Computes the point of a line segment that is nearest to the origin.

    The function replaces eq. 14 of Han 2019, which has a wrong sign and a singular
    slope. Also, eq. 14 does not limit the point to the segment, so that the point could
    be in empty space.

    Args:
        a: Position (x, y) of one end, m; floats or AutoDiffXd.
        b: Position (x, y) of the other end, m.

    Returns:
        Position (x, y) of the nearest point, m.
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
    points: Any, parameters: CollisionVectorParameters, neighbors: Any = None
) -> Any:
    """Computes collision vectors from the positions of the echoes.

    A collision vector points from the control point P to an obstacle. Each vector has a
    feature, which is a number that identifies the sensors of the vector. If the sensors
    change, the feature changes, too. A law therefore does not mistake the change of
    sensors for a motion.

    Args:
        points: List with one entry per sensor, from left to right. An entry is the
            position (x, y) of the echo relative to P, m, or None without an echo.
        parameters: Rule that combines echoes into vectors.
        neighbors: Pairs of adjacent sensors (``UltrasonicParameters.neighbors``). A
            pair has two indices, counted from 0, with the left sensor first. None: each
            sensor is paired with the next sensor.

    Returns:
        At most ``SLOTS`` entries (feature, x, y), with x and y of the vector from P, m.
        With n sensors, features 1 to n are single sensors (case I, Han 2019, eq. 12).
        Feature n + k is the pair of sensor k, counted from 1, and its right neighbor
        (case II, eq. 14).
    """
    if neighbors is None:
        neighbors = pairwise(range(len(points)))
    return _vectors(
        [(0.0, 0.0) if point is None else point for point in points],
        [point is not None for point in points],
        [*neighbors],
        joined=parameters.aggregation == "paper",
        every=parameters.aggregation == "sum",
    )


@register_jitable
def _vectors(points, heard, neighbors, joined, every):
    """Computes the results of ``collision_vectors``, in a form that compiles.

    ``heard`` has one flag per sensor, true if the sensor has an echo. The position of a
    sensor without an echo is arbitrary. If ``every`` is true, the function returns one
    vector per pair of echoes and per single echo. Otherwise, it returns one vector to
    the nearest echo. If ``joined`` is true, it first joins this echo with the nearer of
    its neighbors.
    """
    # Find the nearest echo.
    nearest, least = -1, math.inf
    for k in range(len(points)):
        if heard[k] and float_of(_squared(points[k])) < least:
            nearest, least = k, float_of(_squared(points[k]))
    # The empty slice gives the empty list its type in compiled code.
    found = [(0.0 * x, x, y) for x, y in points[:0]]
    if nearest < 0:
        return found
    if every:
        pairs = [
            (int(pair[0]), int(pair[1]))
            for pair in neighbors
            if _is_pair(points, heard, int(pair[0]), int(pair[1]))
        ]
        return _all_vectors(points, heard, pairs, found)
    if joined:
        # Join the nearest echo with the neighbor that is nearer to P.
        best, least = -1, math.inf
        for n in range(len(neighbors)):
            left, right = int(neighbors[n][0]), int(neighbors[n][1])
            if nearest not in (left, right):
                continue
            other = _squared(points[right if left == nearest else left])
            if float_of(other) < least and _is_pair(points, heard, left, right):
                best, least = n, float_of(other)
        if best >= 0:
            left, right = int(neighbors[best][0]), int(neighbors[best][1])
            found.append(_pair(points, left, right))
            return found
    x, y = points[nearest]
    found.append((0.0 * x + (1.0 + nearest), x, y))
    return found


@register_jitable
def _squared(point):
    return point[0] * point[0] + point[1] * point[1]


@register_jitable
def _is_pair(points, heard, left, right):
    """Whether two sensors have echoes that are close enough to each other."""
    if not (heard[left] and heard[right]):
        return False
    a, b = points[left], points[right]
    return _squared((b[0] - a[0], b[1] - a[1])) < PAIR_SEPARATION_M**2


@register_jitable
def _pair(points, left, right):
    x, y = foot_on_segment(points[left], points[right])
    return 0.0 * x + (1.0 + len(points) + left), x, y


@register_jitable
def _all_vectors(points, heard, pairs, vectors):
    """Returns the vectors of all pairs of echoes, and of all echoes without a pair.

    If there are more than ``SLOTS`` vectors, the function returns only the nearest.
    """
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
    """Writes collision vectors to the ports of vectors, mask, and features.

    All elements of the ports are 0 before the call. Unused slots remain 0.

    Args:
        vectors: At most three entries (feature, x, y), with x and y of the vector from
            the control point P, m.
        outputs: Three ports: vectors (6 elements), m; mask (3 elements), 0 or 1; and
            features (3 elements).
    """
    vectors_B, mask, features = outputs
    for k in range(len(vectors)):
        feature, x, y = vectors[k]
        vectors_B[2 * k], vectors_B[2 * k + 1] = x, y
        mask[k] = mask[k] + 1.0
        features[k] = feature


#: Output ports of every block that computes collision vectors.
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
    """Constants of ``collision_step``."""

    joined: bool
    """Whether the nearest echo is joined with a neighboring echo."""
    every: bool
    """Whether every pair and every unpaired echo has its own vector."""
    axes: list[float]
    """Directions of the sensors in B, rad."""
    places: list[tuple[float, float]]
    """Positions (x, y) of the sensors relative to P, in the axes of the body B, m."""
    neighbors: list[tuple[int, int]]
    """Pairs of adjacent sensors, counted from 0, each with the left sensor first."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    tick_s: float


def collision_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Computes the collision vectors of one control period.

    The state has the poses of the previous control periods of a sensor round, most
    recent first, m and rad. If every sensor fires in every period, the state is empty.
    """
    ranges, echo, ages, pose = inputs
    points = [
        echo_point(ranges[k], numbers.axes[k], numbers.places[k])
        if echo[k] > 0.5
        else (0.0 * ranges[k], 0.0 * ranges[k])
        for k in range(len(ranges))
    ]
    if len(state):
        # Convert each held range to the present pose.
        for k in range(len(points)):
            ticks = round(float_of(ages[k]) / numbers.tick_s)
            if ticks > 0:
                # The age of a failed sensor can exceed that of the oldest stored pose.
                at = min(3 * (ticks - 1), len(state) - 3)
                then = state[at], state[at + 1], state[at + 2]
                now = pose[0], pose[1], pose[2]
                points[k] = carried_point(points[k], then, now, numbers.control_point_m)
        # Store the present pose in front of the previous ones.
        for k in range(len(state) - 1, 2, -1):
            state[k] = state[k - 3]
        for k in range(3):
            state[k] = pose[k]
    vectors = _vectors(
        points,
        [flag > 0.5 for flag in echo],
        numbers.neighbors,
        numbers.joined,
        numbers.every,
    )
    fill_slots(vectors, outputs)


@define_for_scalars("CollisionVector_", __name__)
def CollisionVector_(T):
    class Impl(Block_[T]):
        """Computes collision vectors from sensor echoes (Han 2019, eq. 11-14).

        A collision vector points from the control point P to an obstacle. The block
        fills the slots of the output ports in order. Only ``aggregation: sum`` fills
        more than one slot.

        If all sensors fire in every control period, the output is a function of the
        present ranges. In this case the block has no state and no latency, and does not
        read the ports of age and pose.

        Otherwise the sensors hold their ranges between two readings. The block assumes
        that a held range belongs to a point at rest in the world frame W, and converts
        this point to the present pose of the robot. If the obstacle has moved since the
        sensor fired, its motion remains as an error. A sensor round is the time in
        which every sensor fires once. The time since a sensor fired is at most one
        round minus one control period.

        If ranges are held, the discrete state has the poses of the previous periods of
        a round, and the block updates it every period. For example, three sensors that
        fire one after the other, one per period, need two poses.

        Args:
            parameters: Rule that combines echoes into vectors.
            sensors: Positions, firing period, and firing order of the sensors.
            robot: Distance of P ahead of the axle.
            initial_pose: Pose (x, y, theta) before time zero, m and rad.
            tick_s: Control period, s.

        Reference: Han 2019, eq. 11-14 (cases I and II), with the corrections of
        docs/errata.md.
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
                parameters.aggregation == "paper",
                parameters.aggregation == "sum",
                [*sensors.axes],
                [*sensors.places],
                [*sensors.neighbors],
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
            """Returns the step with the initial pose of the run as its state."""
            past_poses = len(self.step.state) // 3
            return self.step._replace(state=[*run.initial_pose] * past_poses)

    return Impl


CollisionVector = CollisionVector_[None]
