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
from systems.laws.trajectory.parameters import (
    AdaptiveTrajectoryParameters,
    FilteredTrajectoryParameters,
)


def _gains(scenario: Scenario) -> Any:
    return getattr(scenario.repulsion, scenario.law)


def _adapting(scenario: Scenario) -> AdaptiveTrajectoryParameters | None:
    """Parameters of the law if it adapts its gains; otherwise None."""
    own = _gains(scenario)
    adaptive = isinstance(own, AdaptiveTrajectoryParameters)
    return own if adaptive and own.adaptation.rule != "none" else None


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
    filtered = AdaptiveTrajectoryParameters, FilteredTrajectoryParameters
    if not isinstance(own, filtered) or own.safety_filter is None:
        return None
    return SafetyFilter(
        parameters=own.safety_filter, robot=scenario.robot, tick_s=scenario.tick_s
    )


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
            faults=scenario.faults,
            acoustics=scenario.acoustics,
            robot=robot,
            source_size=None,
            obstacle_count=bodies,
            seed=seed_of("ultrasonic_array"),
            tick_s=tick_s,
        ),
        ObjectDetector(
            parameters=scenario.detector,
            sensors=scenario.ultrasonic,
            robot=robot,
            tick_s=tick_s,
        ),
    ]


def _adaptation(scenario: Scenario) -> list[Any]:
    own = _adapting(scenario)
    if own is None:
        return []
    robot, tick_s = scenario.robot, scenario.tick_s
    frequency, ratio = own.reference.poles(
        robot.mass_kg, own.stiffness_n_m, own.damping_n_s_m
    )
    return [
        ReferenceModel(frequency=frequency, ratio=ratio, tick_s=tick_s),
        ImpedanceAdaptation(
            parameters=own.adaptation, impedance=own, robot=robot, tick_s=tick_s
        ),
    ]
