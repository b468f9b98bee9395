"""From three ranges to the vector that points at the obstacle."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal

import numpy as np
from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import read_lists
from systems.framework.parameters import NonNegativeLength, Parameters
from systems.framework.scalar_math import float_of
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.ranging.ultrasonic_array import UltrasonicParameters
from systems.world.geometry import control_point, rotate

__all__ = [
    "COLLISION_FACTS",
    "SLOTS",
    "CollisionVector",
    "CollisionVectorParameters",
    "CollisionVector_",
    "carried_point",
    "collision_vectors",
    "echo_point",
    "echo_points",
    "foot_on_segment",
]

#: Collision vectors that a controller takes at once.
SLOTS = 3

Aggregation = Literal["paper", "nearest", "sum"]


class CollisionVectorParameters(Parameters):
    """How echoes become collision vectors."""

    aggregation: Aggregation = "paper"
    """``paper``: nearest echo, joined with its nearer neighbour where close
    enough; ``nearest``: nearest echo alone; ``sum``: every echo or pair its
    own vector, whose forces add; of more than three the nearest three."""
    pair_separation_m: NonNegativeLength = 0.5
    """Echoes farther apart than this are taken as two obstacles, m."""


def echo_point(range_, axis, position):
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


def echo_points(ranges, echo, sensors: UltrasonicParameters):
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


def carried_point(point, pose_then, pose_now, control_point_m):
    """Where a point that was seen from another pose lies now, if it rests.

    Args:
        point: (x, y) from P in B axes as seen then, m; floats or AutoDiffXd.
        pose_then: (x, y, theta) of the robot then, m and rad.
        pose_now: The same now.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        (x, y) from P in B axes now, m.
    """
    p_then, p_now = (
        control_point(pose, control_point_m) for pose in (pose_then, pose_now)
    )
    x, y = rotate(pose_then[2], *point)
    dx, dy = p_then[0] - p_now[0] + x, p_then[1] - p_now[1] + y
    return rotate(-pose_now[2], dx, dy)


def foot_on_segment(a, b):
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


def collision_vectors(points, parameters: CollisionVectorParameters, neighbours=None):
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
    heard = [k for k, point in enumerate(points) if point is not None]
    if not heard:
        return []
    if neighbours is None:
        neighbours = pairwise(range(len(points)))
    pairs = [
        (left, right)
        for left, right in neighbours
        if points[left] is not None
        and points[right] is not None
        and _close(points[left], points[right], parameters.pair_separation_m)
    ]
    if parameters.aggregation == "sum":
        return _all_vectors(points, heard, pairs)
    nearest = min(heard, key=lambda k: _squared(points[k]))
    if parameters.aggregation == "paper":
        # Of the neighbours that are close enough the nearer to P.
        mine = [pair for pair in pairs if nearest in pair]
        if mine:
            return [_pair(points, *min(mine, key=_other_is_near(points, nearest)))]
    return [(1.0 + nearest, *points[nearest])]


def _squared(point):
    return point[0] * point[0] + point[1] * point[1]


def _close(a, b, separation):
    return _squared((b[0] - a[0], b[1] - a[1])) < separation * separation


def _pair(points, left, right):
    feature = 1.0 + len(points) + left
    return (feature, *foot_on_segment(points[left], points[right]))


def _other_is_near(points, sensor):
    """Key of a pair: the squared distance of its other point."""

    def key(pair):
        left, right = pair
        return _squared(points[right if left == sensor else left])

    return key


def _all_vectors(points, heard, pairs):
    vectors = [_pair(points, left, right) for left, right in pairs]
    paired = {sensor for pair in pairs for sensor in pair}
    vectors += [(1.0 + k, *points[k]) for k in heard if k not in paired]
    if len(vectors) > SLOTS:
        vectors.sort(key=lambda vector: float_of(_squared(vector[1:])))
    return vectors[:SLOTS]


def fill_slots(vectors, scalar):
    """(vectors, mask, features) for the ports: 6, 3 and 3 elements.

    Args:
        vectors: At most three (feature, x, y), from P, m.
        scalar: Makes a number of the ports' type.

    Returns:
        Vectors, m, mask, 1 or 0, and features; zeros where there is nothing.
    """
    zero, one, empty = scalar(0.0), scalar(1.0), SLOTS - len(vectors)
    out = [component for _, x, y in vectors for component in (x, y)]
    mask = [one] * len(vectors)
    features = [zero + feature for feature, _, _ in vectors]
    blank = [zero] * empty
    return out + blank + blank, mask + blank, features + blank


#: What every block says of itself that obstacle sensing ends in.
COLLISION_FACTS = BlockFacts(
    "collision",
    "obstacle sensing",
    columns={
        "collision_vectors_B": tuple(
            f"collision_{slot}_B_{axis}"
            for slot in range(1, SLOTS + 1)
            for axis in "xy"
        ),
        "features": tuple(f"feature_{slot}" for slot in range(1, SLOTS + 1)),
    },
)


def declare_collision_ports(system, slots):
    """Declares the three output ports that every obstacle sensing ends in.

    Args:
        system: The block.
        slots: Cache entry of what ``fill_slots`` returns.
    """
    for index, (name, size) in enumerate(
        (("collision_vectors_B", 2 * SLOTS), ("mask", SLOTS), ("features", SLOTS))
    ):

        def calc(context, output, index=index):
            output.SetFromVector(slots.Eval(context)[index])

        system.DeclareVectorOutputPort(
            name=name,
            size=size,
            calc=calc,
            prerequisites_of_calc={slots.ticket()},
        )


@define_for_scalars("CollisionVector_", __name__)
def CollisionVector_(T):
    class Impl(LeafSystem_[T]):
        """Turns echoes into collision vectors from P (cases I and II).

        .. pydrake_system::

            name: CollisionVector
            input_ports:
            - ranges [m]
            - echo [0 or 1]
            - range_ages [s]
            - pose_WB_estimated [m, m, rad]
            output_ports:
            - collision_vectors_B [m, three slots of x and y]
            - mask [0 or 1 a slot]
            - features [number of the sensor or pair, 0 none]

        Slots are filled from the first; only ``aggregation: sum`` fills more
        than one. Where all sensors fire at every tick, a function of the present
        ranges: no state, no latency; the ports of age and pose are not read.
        Else a range that is held stands for a point that rests in W: it is carried
        on to the present pose. An obstacle's own motion since that sensor fired, up
        to a round less a tick, remains an error.

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

        FACTS = COLLISION_FACTS

        def _construct(
            self,
            *,
            parameters=None,
            sensors=None,
            robot=None,
            initial_pose=(0.0, 0.0, 0.0),
            tick_s=TICK_S,
            converter=None,
        ):
            super().__init__(converter=converter)
            self._parameters = parameters or CollisionVectorParameters()
            self._sensors = sensors or UltrasonicParameters()
            self._robot = robot or RobotParameters()
            self._initial_pose = tuple(initial_pose)
            self._tick_s = tick_s
            self.set_name("collision_vector")
            count = self._sensors.count
            inputs = [
                self.DeclareVectorInputPort(name=name, size=size)
                for name, size in (
                    ("ranges", count),
                    ("echo", count),
                    ("range_ages", count),
                    ("pose_WB_estimated", 3),
                )
            ]
            self._echoes, self._motion = inputs[:2], inputs[2:]
            sources = {port.ticket() for port in self._echoes}
            self._past_poses = self._sensors.round_ticks(tick_s) - 1
            if self._past_poses:
                past = [T(v) for v in self._initial_pose] * self._past_poses
                self.DeclareDiscreteState(past)
                self.DeclarePeriodicDiscreteUpdateEvent(
                    period_sec=tick_s, offset_sec=0.0, update=self._remember
                )
                sources |= {port.ticket() for port in self._motion}
                sources.add(self.xd_ticket())
            slots = declare_cache(self, "slots", self._slots, sources)
            declare_collision_ports(self, slots)

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self,
                parameters=other._parameters,
                sensors=other._sensors,
                robot=other._robot,
                initial_pose=other._initial_pose,
                tick_s=other._tick_s,
                converter=converter,
            )

        def _slots(self, context):
            ranges, echo = read_lists(context, self._echoes)
            points = echo_points(ranges, echo, self._sensors)
            if self._past_poses:
                points = self._carried(context, points)
            neighbours = self._sensors.neighbours
            vectors = collision_vectors(points, self._parameters, neighbours)
            return fill_slots(vectors, T)

        def _carried(self, context, points):
            """The points as they lie from the present pose."""
            ages, now = read_lists(context, self._motion)
            poses = self._poses(context, now)
            ticks = [round(float_of(age) / self._tick_s) for age in ages]
            return [
                carried_point(point, poses[k], poses[0], self._robot.control_point_m)
                if point is not None and k
                else point
                for point, k in zip(points, ticks, strict=True)
            ]

        def _poses(self, context, now):
            """The pose now, a tick ago, two ticks ago, as far back as a round."""
            past = context.get_discrete_state(0).CopyToVector().tolist()
            starts = range(0, len(past), 3)
            return [now, *(past[k : k + 3] for k in starts)]

        def _remember(self, context, discrete_state):
            _, now = read_lists(context, self._motion)
            poses = self._poses(context, now)[:-1]
            discrete_state.set_value(np.array(poses).ravel())

    return Impl


CollisionVector = CollisionVector_[None]
