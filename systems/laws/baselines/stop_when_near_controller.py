"""Baseline: drive to the sound, and stop while an echo is near."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.block import Port, Step
from systems.framework.signals import TICK_S
from systems.laws.baselines.baseline_controller import BaselineController
from systems.laws.parameters import AttractionParameters
from systems.laws.stop_when_near import StopWhenNearParameters
from systems.planning.following import FollowNumbers, approach
from systems.planning.turning import turn_toward
from systems.ranging.parameters import UltrasonicParameters


class StopNumbers(NamedTuple):
    """Constants of the step of ``StopWhenNearController``."""

    own: StopWhenNearParameters
    follow: FollowNumbers


@register_jitable
def stop_when_near_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: StopNumbers
) -> None:
    """Computes the twist of the robot: forward motion only without near echoes."""
    own, twist = numbers.own, outputs[0]
    wanted, bearing = approach(inputs, numbers.follow)
    ranges, echo = inputs[4], inputs[5]
    for k in range(len(ranges)):
        if echo[k] > 0.5 and ranges[k] < own.stop_m:
            wanted = min(wanted, 0.0)
    twist[0], twist[1] = turn_toward(wanted, bearing, inputs[3][2])


class StopWhenNearController(BaselineController):
    """Drives to the target, but does not drive forward while an echo is near.

    This is the simplest law. The block has no state and no latency.

    Args:
        robot: Parameters of the robot, for the position of the control point P.
        attraction: ``AttractionParameters``. The block uses only the follow distance.
        gains: ``StopWhenNearParameters``.
        sensors: Range sensors. The block uses only their number.
        tick_s: Control period, s.

    Reference: our own work; docs/results_laws.md.
    """

    inputs = (
        *BaselineController.inputs,
        Port("ranges", "sensors", "m"),
        Port("echo", "sensors", "0 or 1"),
    )

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        gains: StopWhenNearParameters = StopWhenNearParameters(),
        sensors: UltrasonicParameters = UltrasonicParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("stop_when_near_controller")
        numbers = StopNumbers(
            gains,
            FollowNumbers(attraction.follow_distance_m, robot.control_point_m),
        )
        self.declare(
            Step(stop_when_near_step, numbers),
            tick_s=tick_s,
            sizes={"sensors": sensors.count},
        )
