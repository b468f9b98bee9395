"""The blocks of a robot that drives to a goal on a planned route."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from diagrams.scenario.scenario import Scenario
from systems import (
    GlobalPlanner,
    IdealObjectSensor,
    ImpedanceAdaptation,
    ObjectDetector,
    PathTarget,
    ReferenceModel,
    SafetyFilter,
    TrajectoryImpedanceController,
    UltrasonicArray,
)
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_filtered import FilteredTrajectoryParameters


def _adapting(own: Any) -> AdaptiveTrajectoryParameters | None:
    """The gains of a law that adapts its gains; None for any other law."""
    return own if isinstance(own, AdaptiveTrajectoryParameters) else None


def make_trajectory_controller(scenario: Scenario) -> Any:
    """Makes the controller block of a robot that drives on a route.

    ``scenario`` is the scenario of this robot alone.
    """
    router = scenario.router
    return TrajectoryImpedanceController(
        parameters=router.gains,
        robot=router.robot,
        adapts=_adapting(router.gains) is not None,
        narrows=router.gains.zone_narrows,
        tick_s=scenario.tick_s,
    )


def trajectory_command(scenario: Scenario) -> Any | None:
    """Makes the safety filter that drives the wheels of a robot on a route.

    ``scenario`` is the scenario of this robot alone. The result is None if the law of
    the robot has no safety filter.
    """
    router = scenario.router
    own = router.gains
    filters = isinstance(own, FilteredTrajectoryParameters)
    if isinstance(own, AdaptiveTrajectoryParameters):
        filters = own.safety_filter
    if not filters:
        return None
    return SafetyFilter(
        robot=router.robot, known=scenario.mapped(), tick_s=scenario.tick_s
    )


def routed_blocks(
    scenario: Scenario,
    *,
    owners: Sequence[int],
    robots: Sequence[int],
    seed_of: Callable[[str], int],
) -> list[Any]:
    """Makes all blocks of a robot on a route except plant, odometry, law and command.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        owners: Number of the body of each rectangle in the inputs ``poses_WO`` and
            ``sizes``, ascending from 0.
        robots: Numbers of those bodies that are robots.
        seed_of: Function that returns the random seed of a block from its name.

    Returns:
        Blocks that are not yet in a diagram.

    Raises:
        InputError: No route leads to the goal.
    """
    router = scenario.router
    robot, tick_s = router.robot, scenario.tick_s
    return [
        GlobalPlanner(
            parameters=router.route,
            known=scenario.mapped(),
            initial_pose=router.start.pose,
            robot=robot,
            tick_s=tick_s,
        ),
        PathTarget(parameters=router.route, robot=robot, tick_s=tick_s),
        *_seen_objects(scenario, owners, robots, seed_of),
        *_adaptation(scenario),
    ]


def _seen_objects(
    scenario: Scenario,
    owners: Sequence[int],
    robots: Sequence[int],
    seed_of: Callable[[str], int],
) -> list[Any]:
    router, tick_s = scenario.router, scenario.tick_s
    robot = router.robot
    if router.obstacle_sensing == "ideal":
        return [
            IdealObjectSensor(
                parameters=router.objects,
                robot=robot,
                bodies=len(owners),
                owners=owners,
                robots=robots,
                seed=seed_of("ideal_object_sensor"),
                tick_s=tick_s,
            )
        ]
    return [
        UltrasonicArray(
            parameters=router.ultrasonic,
            faults=router.faults,
            sound_speed_m_s=scenario.sound_speed_m_s,
            assumed_sound_speed_m_s=router.assumed_sound_speed_m_s,
            robot=robot,
            source_size=None,
            obstacle_count=len(owners),
            seed=seed_of("ultrasonic_array"),
            tick_s=tick_s,
        ),
        ObjectDetector(
            sensors=router.ultrasonic,
            robot=robot,
            known=scenario.mapped(),
            tick_s=tick_s,
        ),
    ]


def _adaptation(scenario: Scenario) -> list[Any]:
    own = _adapting(scenario.router.gains)
    if own is None:
        return []
    given: dict[str, Any] = {
        "parameters": own,
        "robot": scenario.router.robot,
        "tick_s": scenario.tick_s,
    }
    return [ReferenceModel(**given), ImpedanceAdaptation(**given)]
