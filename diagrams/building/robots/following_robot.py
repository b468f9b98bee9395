"""The blocks of a robot that follows a sound: hearing, tracker, range sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

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
    bodies: int,
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
    """Makes the sensing blocks of a robot that follows a sound.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        controller: The block of its law.
        bodies: Number of bodies on ``poses_WO`` and ``sizes``.
        others: Names of the sources and loudspeakers that the robot does not follow.
        seed_of: Returns the seed of a block, by its name.

    Returns:
        Blocks, not yet in a diagram.

    Raises:
        InputError: The law reads ranges, but the robot has no range sensors.
    """
    _check_sensing(scenario, controller)
    mapped = scenario.own_guard is not None or "free_space" in _inputs(controller)
    return [
        *_hearing(scenario, others, seed_of),
        _tracker(scenario),
        *_obstacle_sensing(scenario, bodies, seed_of, mapped=mapped),
    ]


def _hearing(
    scenario: Scenario, others: Sequence[str], seed_of: Callable[[str], int]
) -> list[Any]:
    if scenario.hearing == "ideal":
        return [
            IdealSourceSensor(
                robot=scenario.robot,
                hearing=scenario.ideal_hearing,
                sound=scenario.sound,
                frame_s=scenario.microphones.frame_s,
                seed=seed_of("ideal_source_sensor"),
            )
        ]
    return [
        MicArray(
            parameters=scenario.microphones,
            robot=scenario.robot,
            acoustics=scenario.acoustics,
            room=scenario.room,
            faults=scenario.faults,
            others=others,
            seed=seed_of("mic_array"),
        ),
        TDOAEstimator(
            parameters=scenario.tdoa,
            robot=scenario.robot,
            acoustics=scenario.acoustics,
            sound=scenario.sound,
            microphones=scenario.microphones,
        ),
    ]


def _tracker(scenario: Scenario) -> Any:
    """Makes the tracker for the kind of hearing.

    An ideal estimate is one tick old; an estimate from audio is older by half a frame.
    For ideal estimates, the tracker uses the exact covariance and does not resolve
    front and back.
    """
    tick, frame = scenario.tick_s, scenario.microphones.frame_s
    tracker, age = scenario.tracker, tick + 0.5 * frame
    if scenario.hearing == "ideal":
        exact = {"resolve_front_back": False, "measurement_floor_m": 0.0}
        tracker = tracker.model_copy(update=exact)
        age = tick
    return SourceTracker(
        robot=scenario.robot,
        tracker=tracker,
        measurement_age_s=age,
        frame_s=frame,
        initial_pose=scenario.start.pose,
        tick_s=tick,
    )


#: Ports that only range sensors provide.
_OF_RANGES = {"ranges", "echo", "range_ages", "free_space"}


def _check_sensing(scenario: Scenario, controller: Any) -> None:
    """Refuses a law that reads ranges if the robot has no range sensors."""
    wanted = _OF_RANGES.intersection(_inputs(controller))
    if wanted and scenario.obstacle_sensing != "ultrasonic" and not scenario.blocks:
        raise InputError(
            "obstacle_sensing",
            f"is {scenario.obstacle_sensing}, but law {scenario.law!r} reads "
            f"{', '.join(sorted(wanted))}; set it to ultrasonic",
        )


def _inputs(block: Any) -> list[str]:
    ports = map(block.get_input_port, range(block.num_input_ports()))
    return [port.get_name() for port in ports]


def _obstacle_sensing(
    scenario: Scenario, bodies: int, seed_of: Callable[[str], int], *, mapped: bool
) -> list[Any]:
    seen: dict[str, Any] = {
        "robot": scenario.robot,
        "source_size": scenario.source_size,
        "obstacle_count": bodies,
    }
    if scenario.obstacle_sensing == "ideal":
        return [
            IdealObstacleSensor(
                maximum_range_m=scenario.ultrasonic.maximum_range_m,
                all_bodies=scenario.collision_vector.aggregation == "sum",
                **seen,
            )
        ]
    sensing = [
        UltrasonicArray(
            parameters=scenario.ultrasonic,
            faults=scenario.faults,
            acoustics=scenario.acoustics,
            seed=seed_of("ultrasonic_array"),
            tick_s=scenario.tick_s,
            **seen,
        ),
        CollisionVector(
            parameters=scenario.collision_vector,
            sensors=scenario.ultrasonic,
            robot=scenario.robot,
            initial_pose=scenario.start.pose,
            tick_s=scenario.tick_s,
        ),
    ]
    if mapped:
        known = FreeSpaceMap(
            parameters=scenario.free_space,
            sensors=scenario.ultrasonic,
            robot=scenario.robot,
            odometry=scenario.odometry,
            plant=scenario.plant,
            tick_s=scenario.tick_s,
        )
        sensing.append(known)
    if scenario.own_guard is not None:
        monitor = SensingMonitor(
            sensors=scenario.ultrasonic, robot=scenario.robot, tick_s=scenario.tick_s
        )
        sensing.append(monitor)
    return sensing
