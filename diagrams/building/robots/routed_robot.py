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


def _gains(scenario: Scenario) -> Any:
    return getattr(scenario.repulsion, scenario.law)


def _adapting(scenario: Scenario) -> AdaptiveTrajectoryParameters | None:
    """Parameters of the law if it adapts its gains; otherwise None."""
    own = _gains(scenario)
    return own if isinstance(own, AdaptiveTrajectoryParameters) else None


def make_trajectory_controller(scenario: Scenario) -> Any:
    """Makes the controller of a robot with a route.

    Args:
        scenario: Scenario of this robot alone.

    Returns:
        The block.
    """
    return TrajectoryImpedanceController(
        parameters=_gains(scenario),
        robot=scenario.robot,
        adapts=_adapting(scenario) is not None,
        tick_s=scenario.tick_s,
    )


def trajectory_command(scenario: Scenario) -> Any | None:
    """Makes the safety filter that drives the wheels of a robot with a route.

    Args:
        scenario: Scenario of this robot alone.

    Returns:
        The block; None if the law has no safety filter.
    """
    own = _gains(scenario)
    filters = isinstance(own, FilteredTrajectoryParameters)
    if isinstance(own, AdaptiveTrajectoryParameters):
        filters = own.safety_filter
    if not filters:
        return None
    return SafetyFilter(robot=scenario.robot, tick_s=scenario.tick_s)


def routed_blocks(
    scenario: Scenario,
    *,
    bodies: int,
    robots: Sequence[int],
    seed_of: Callable[[str], int],
) -> list[Any]:
    """Makes all blocks of the robot except plant, odometry, law and wheel command.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        bodies: Number of bodies on ``poses_WO`` and ``sizes``.
        robots: Indices of the bodies that are robots.
        seed_of: Returns the seed of a block, by its name.

    Returns:
        Blocks, not yet in a diagram.

    Raises:
        InputError: No route leads to the goal.
    """
    assert scenario.route is not None
    robot, tick_s = scenario.robot, scenario.tick_s
    return [
        GlobalPlanner(
            parameters=scenario.route,
            known=scenario.mapped(),
            initial_pose=scenario.start.pose,
            robot=robot,
            tick_s=tick_s,
        ),
        PathTarget(parameters=scenario.route, robot=robot, tick_s=tick_s),
        *_seen_objects(scenario, bodies, robots, seed_of),
        *_adaptation(scenario),
    ]


def _seen_objects(
    scenario: Scenario,
    bodies: int,
    robots: Sequence[int],
    seed_of: Callable[[str], int],
) -> list[Any]:
    robot, tick_s = scenario.robot, scenario.tick_s
    if scenario.obstacle_sensing == "ideal":
        return [
            IdealObjectSensor(
                parameters=scenario.objects,
                robot=robot,
                bodies=bodies,
                robots=robots,
                seed=seed_of("ideal_object_sensor"),
                tick_s=tick_s,
            )
        ]
    return [
        UltrasonicArray(
            parameters=scenario.ultrasonic,
            acoustics=scenario.acoustics,
            robot=robot,
            source_size=None,
            obstacle_count=bodies,
            seed=seed_of("ultrasonic_array"),
            tick_s=tick_s,
        ),
        ObjectDetector(sensors=scenario.ultrasonic, robot=robot, tick_s=tick_s),
    ]


def _adaptation(scenario: Scenario) -> list[Any]:
    own = _adapting(scenario)
    if own is None:
        return []
    given: dict[str, Any] = {
        "parameters": own,
        "robot": scenario.robot,
        "tick_s": scenario.tick_s,
    }
    return [ReferenceModel(**given), ImpedanceAdaptation(**given)]
