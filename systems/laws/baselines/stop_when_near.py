"""Baseline: go to the sound, and stop while something is near."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.signals import TICK_S
from systems.laws.baselines.baseline_controller import (
    BaselineController,
    follow_numbers,
)
from systems.laws.baselines.parameters import StopWhenNearParameters
from systems.laws.parameters import AttractionParameters
from systems.planning.following import FollowNumbers, approach
from systems.planning.parameters import FollowingParameters
from systems.planning.turning import turn_towards
from systems.ranging.parameters import UltrasonicParameters


class StopNumbers(NamedTuple):
    """What the step of ``StopWhenNearController`` depends on."""

    own: StopWhenNearParameters
    follow: FollowNumbers


@register_jitable
def stop_when_near_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: StopNumbers
) -> None:
    """The twist of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Not used.
        state: None.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``StopNumbers``.
    """
    own, twist = numbers.own, outputs[0]
    wanted, bearing = approach(inputs, numbers.follow)
    ranges, echo = inputs[4], inputs[5]
    for k in range(len(ranges)):
        if echo[k] > 0.5 and ranges[k] < own.stop_m:
            wanted = min(wanted, 0.0)
    twist[0], twist[1] = turn_towards(wanted, bearing, inputs[3][2], numbers.follow.own)


class StopWhenNearController(BaselineController):
    """Turns to the target and drives; stops while an echo is near.

    .. pydrake_system::

        name: StopWhenNearController
        input_ports:
        - p_WS_estimated [m]
        - v_WS_estimated [m/s]
        - target_valid [0 or 1]
        - pose_WB_estimated [m, m, rad]
        - ranges [m]
        - echo [0 or 1]
        output_ports:
        - twist_B [m/s, rad/s]

    What everybody tries first. No state; no latency.

    Args:
        robot: Place of P.
        attraction: The follow distance.
        repulsion: ``RepulsionParameters``; uses ``stop_when_near``.
        following: How fast it drives and turns.
        sensors: The range sensors.
        tick_s: Period of the controller, s.

    Reference: ours; docs/results_laws.md.
    """

    def __init__(
        self,
        *,
        robot: RobotParameters | None = None,
        attraction: AttractionParameters | None = None,
        repulsion: Any = None,
        following: FollowingParameters | None = None,
        sensors: UltrasonicParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        count = (sensors or UltrasonicParameters()).count
        default = repulsion is None
        numbers = StopNumbers(
            StopWhenNearParameters() if default else repulsion.stop_when_near,
            follow_numbers(following, attraction, robot),
        )
        self.declare_baseline(
            "stop_when_near_controller",
            stop_when_near_step,
            numbers,
            tick_s,
            inputs=(("ranges", count), ("echo", count)),
        )
