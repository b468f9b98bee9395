"""What the blocks of all baselines have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.step_block import Step, StepBlock
from systems.laws.parameters import AttractionParameters
from systems.planning.following import FollowNumbers
from systems.planning.parameters import FollowingParameters

#: Input ports of every baseline, and their sizes.
BASELINE_INPUTS = (
    ("p_WS_estimated", 2),
    ("v_WS_estimated", 2),
    ("target_valid", 1),
    ("pose_WB_estimated", 3),
)


class BaselineController(LeafSystem, StepBlock):
    """A ``StepBlock`` that commands a twist."""

    FACTS = BlockFacts(
        "controller",
        "control",
        columns={"twist_B": ("wanted_speed", "wanted_turn")},
    )

    def declare_baseline(
        self,
        name: str,
        step: Callable[..., None],
        numbers: Any,
        tick_s: float,
        *,
        state: Sequence[float] = (),
        inputs: Sequence[tuple[str, int]] = (),
        carried: Sequence[str] = (),
    ) -> None:
        """Declares ports and state.

        Args:
            name: Of the block.
            step: What it does.
            numbers: What that depends on.
            tick_s: Period of the controller, s.
            state: At the first tick.
            inputs: Ports besides ``BASELINE_INPUTS``, and their sizes.
            carried: As of ``StepBlock.declare_step``.
        """
        self.set_name(name)
        self.declare_step(
            float,
            Step(step, numbers, state),
            (*BASELINE_INPUTS, *inputs),
            (("twist_B", 2),),
            tick_s,
            carried=carried,
        )


def follow_numbers(
    following: FollowingParameters | None,
    attraction: AttractionParameters | None,
    robot: RobotParameters | None,
) -> FollowNumbers:
    """How a robot follows.

    Args:
        following: How fast it drives and turns; none: the defaults.
        attraction: The follow distance; likewise.
        robot: Place of P; likewise.

    Returns:
        The numbers.
    """
    return FollowNumbers(
        following or FollowingParameters(),
        (attraction or AttractionParameters()).follow_distance_m,
        (robot or RobotParameters()).control_point_m,
    )


def half_size(robot: RobotParameters) -> tuple[float, float]:
    """Half of a body's length and width, m."""
    return 0.5 * robot.length_m, 0.5 * robot.width_m


def speed_limits(following: FollowingParameters | None) -> tuple[float, float, float]:
    """Least and largest speed, m/s, and largest yaw rate, rad/s."""
    own = following or FollowingParameters()
    return -own.back_speed_m_s, own.cruise_speed_m_s, own.turn_rate_rad_s
