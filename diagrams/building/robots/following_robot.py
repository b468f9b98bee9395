"""The blocks of a robot that follows a sound: hearing, tracker, range sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from diagrams.scenario.participants import Follower
from diagrams.scenario.scenario import Scenario
from systems import (
    CollisionVector,
    FreeSpaceMap,
    IdealObstacleSensor,
    IdealSourceSensor,
    MicArray,
    SensingMonitor,
    SourceTracker,
    TDOAEstimator,
    UltrasonicArray,
)
from systems.framework.input_error import InputError


def following_blocks(
    scenario: Scenario,
    controller: Any,
    *,
    owners: Sequence[int],
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
    """Makes the sensing blocks of a robot that follows a sound.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        controller: The controller block of the robot's law.
        owners: Number of the body of each rectangle in the inputs ``poses_WO`` and
            ``sizes``, ascending from 0.
        others: Names of the sources and loudspeakers that the robot does not follow.
        seed_of: Function that returns the random seed of a block from its name.

    Returns:
        Blocks that are not yet in a diagram.

    Raises:
        InputError: The law reads ranges, but the robot has no range sensors.
    """
    robot = scenario.follower
    _check_sensing(robot, controller)
    mapped = robot.own_guard is not None or "free_space" in _inputs(controller)
    return [
        *_hearing(scenario, robot, others, seed_of),
        _tracker(scenario, robot),
        *_obstacle_sensing(scenario, robot, owners, seed_of, mapped=mapped),
    ]


def _hearing(
    scenario: Scenario,
    robot: Follower,
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
    if not robot.listens:
        return [
            IdealSourceSensor(
                robot=robot.robot,
                sound=scenario.source.sound,
                always=robot.hearing == "ideal_always",
                frame_s=robot.microphones.frame_s,
            )
        ]
    return [
        MicArray(
            parameters=robot.microphones,
            robot=robot.robot,
            sound_speed_m_s=scenario.sound_speed_m_s,
            room=scenario.room,
            faults=robot.faults,
            others=others,
            seed=seed_of("mic_array"),
        ),
        TDOAEstimator(
            parameters=robot.tdoa,
            robot=robot.robot,
            sound_speed_m_s=scenario.believed_sound_speed_m_s,
            sound=scenario.source.sound,
            microphones=robot.microphones,
        ),
    ]


def _tracker(scenario: Scenario, robot: Follower) -> Any:
    """Makes the tracker of the source for the robot's kind of hearing.

    With ideal hearing, an estimate is one tick (control period) old. With audio, an
    estimate is older by half an audio frame.
    """
    tick, frame = scenario.tick_s, robot.microphones.frame_s
    exact = not robot.listens
    return SourceTracker(
        robot=robot.robot,
        tracker=robot.tracker,
        measurement_age_s=tick if exact else tick + 0.5 * frame,
        frame_s=frame,
        exact=exact,
        initial_pose=robot.start.pose,
        tick_s=tick,
    )


#: Ports that only range sensors provide.
_OF_RANGES = {"ranges", "echo", "range_ages", "free_space"}


def _check_sensing(robot: Follower, controller: Any) -> None:
    """Raises an error if a law reads ranges, but the robot has no range sensors."""
    wanted = _OF_RANGES.intersection(_inputs(controller))
    if wanted and robot.obstacle_sensing != "ultrasonic" and not robot.blocks:
        raise InputError(
            "obstacle_sensing",
            f"is {robot.obstacle_sensing}, but law {robot.law!r} reads "
            f"{', '.join(sorted(wanted))}; set it to ultrasonic",
        )


def _inputs(block: Any) -> list[str]:
    ports = map(block.get_input_port, range(block.num_input_ports()))
    return [port.get_name() for port in ports]


def _obstacle_sensing(
    scenario: Scenario,
    robot: Follower,
    owners: Sequence[int],
    seed_of: Callable[[str], int],
    *,
    mapped: bool,
) -> list[Any]:
    seen: dict[str, Any] = {
        "robot": robot.robot,
        "source_size": scenario.source_size,
        "obstacle_count": len(owners),
    }
    if robot.obstacle_sensing == "ideal":
        return [
            IdealObstacleSensor(
                maximum_range_m=robot.ultrasonic.maximum_range_m,
                all_bodies=robot.collision_vector.aggregation == "sum",
                owners=owners,
                **seen,
            )
        ]
    sensing = [
        UltrasonicArray(
            parameters=robot.ultrasonic,
            faults=robot.faults,
            sound_speed_m_s=scenario.sound_speed_m_s,
            assumed_sound_speed_m_s=robot.assumed_sound_speed_m_s,
            seed=seed_of("ultrasonic_array"),
            tick_s=scenario.tick_s,
            **seen,
        ),
        CollisionVector(
            parameters=robot.collision_vector,
            sensors=robot.ultrasonic,
            robot=robot.robot,
            initial_pose=robot.start.pose,
            tick_s=scenario.tick_s,
        ),
    ]
    if mapped:
        known = FreeSpaceMap(
            parameters=robot.own_map,
            sensors=robot.ultrasonic,
            robot=robot.robot,
            plant=robot.plant,
            tick_s=scenario.tick_s,
        )
        sensing.append(known)
    if robot.own_guard is not None:
        monitor = SensingMonitor(
            sensors=robot.ultrasonic, robot=robot.robot, tick_s=scenario.tick_s
        )
        sensing.append(monitor)
    return sensing
