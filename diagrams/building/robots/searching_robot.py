"""The blocks of robots that search step by step for an odor or a sound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from diagrams.scenario.participants import OdorSearcher, SoundSearcher
from diagrams.scenario.scenario import Scenario
from systems import (
    AirflowSensors,
    ContactSwitches,
    CrossPowerEstimator,
    GasSensorArray,
    HeadingController,
    MagneticHeading,
    MicArray,
    MotorDriver,
    PlumeSearch,
    RadioRange,
    SoundSearch,
)
from systems.odor.parameters import CONTAINER_M


def search_controller(scenario: Scenario) -> Any:
    """Makes the controller block of a robot that searches for an odor or a sound.

    ``scenario`` is the scenario of this robot alone.
    """
    robot = scenario.only
    if isinstance(robot, OdorSearcher):
        return PlumeSearch(parameters=robot.search, tick_s=scenario.tick_s)
    assert isinstance(robot, SoundSearcher)
    return SoundSearch(
        parameters=robot.sound_search,
        speed_m_s=robot.motor_driver.full_speed_m_s,
        tick_s=scenario.tick_s,
    )


def search_command(scenario: Scenario) -> Any:
    """Makes the block that drives the wheels of a searching robot.

    ``scenario`` is the scenario of this robot alone.
    """
    robot = scenario.only
    assert isinstance(robot, OdorSearcher | SoundSearcher)
    return MotorDriver(
        parameters=robot.motor_driver, robot=robot.robot, tick_s=scenario.tick_s
    )


def searching_blocks(
    scenario: Scenario,
    *,
    owners: Sequence[int],
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
    """Makes all blocks of a searching robot except plant, odometry, search and motors.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        owners: Number of the body of each rectangle in the inputs ``poses_WO`` and
            ``sizes``, ascending from 0.
        others: Names of the sources and loudspeakers for which the robot does not
            search.
        seed_of: Function that returns the random seed of a block from its name.

    Returns:
        Blocks that are not yet in a diagram.
    """
    robot, tick_s = scenario.only, scenario.tick_s
    assert isinstance(robot, OdorSearcher | SoundSearcher)
    compass = MagneticHeading(
        parameters=robot.compass, seed=seed_of("magnetic_heading"), tick_s=tick_s
    )
    heading = HeadingController(tick_s=tick_s)
    if isinstance(robot, OdorSearcher):
        return [compass, heading, *_smell(scenario, robot, owners, seed_of)]
    return [compass, heading, *_ears(scenario, robot, others, seed_of)]


def _smell(
    scenario: Scenario,
    robot: OdorSearcher,
    owners: Sequence[int],
    seed_of: Callable[[str], int],
) -> list[Any]:
    tick_s = scenario.tick_s
    return [
        GasSensorArray(
            parameters=robot.gas_sensors,
            faults=robot.faults,
            seed=seed_of("gas_sensor_array"),
            tick_s=tick_s,
        ),
        AirflowSensors(
            parameters=robot.airflow_sensors,
            seed=seed_of("airflow_sensors"),
            tick_s=tick_s,
        ),
        ContactSwitches(
            faults=robot.faults,
            robot=robot.robot,
            bodies=len(owners),
            owners=owners,
            source_size=CONTAINER_M,
            tick_s=tick_s,
        ),
    ]


def _ears(
    scenario: Scenario,
    robot: SoundSearcher,
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
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
        CrossPowerEstimator(
            robot=robot.robot,
            sound_speed_m_s=scenario.believed_sound_speed_m_s,
            microphones=robot.microphones,
        ),
        RadioRange(seed=seed_of("radio_range"), tick_s=scenario.tick_s),
    ]
