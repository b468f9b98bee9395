"""The blocks of robots that search step by step for an odor or a sound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

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


def search_controller(scenario: Scenario) -> Any:
    """Makes the block of the search.

    Args:
        scenario: Scenario of this searching robot alone.

    Returns:
        The block.
    """
    if scenario.searches == "odor":
        return PlumeSearch(parameters=scenario.search, tick_s=scenario.tick_s)
    return SoundSearch(
        parameters=scenario.sound_search,
        radio=scenario.radio,
        speed_m_s=scenario.motor_driver.full_speed_m_s,
        tick_s=scenario.tick_s,
    )


def search_command(scenario: Scenario) -> Any:
    """Makes the block that drives the wheels of a searching robot.

    Args:
        scenario: Scenario of this robot alone.

    Returns:
        The block.
    """
    return MotorDriver(
        parameters=scenario.motor_driver, robot=scenario.robot, tick_s=scenario.tick_s
    )


def searching_blocks(
    scenario: Scenario,
    *,
    bodies: int,
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
    """Makes all blocks of the robot except plant, odometry, search and motors.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        bodies: Number of bodies on ``poses_WO`` and ``sizes``.
        others: Names of the sounds that the robot does not search for.
        seed_of: Returns the seed of a block, by its name.

    Returns:
        Blocks, not yet in a diagram.
    """
    tick_s = scenario.tick_s
    compass = MagneticHeading(
        parameters=scenario.compass, seed=seed_of("magnetic_heading"), tick_s=tick_s
    )
    heading = HeadingController(parameters=scenario.heading_control, tick_s=tick_s)
    senses = _smell if scenario.searches == "odor" else _ears
    return [compass, heading, *senses(scenario, bodies, others, seed_of)]


def _smell(
    scenario: Scenario,
    bodies: int,
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
    assert scenario.odor is not None
    tick_s = scenario.tick_s
    return [
        GasSensorArray(
            parameters=scenario.gas_sensors,
            faults=scenario.faults,
            seed=seed_of("gas_sensor_array"),
            tick_s=tick_s,
        ),
        AirflowSensors(
            parameters=scenario.airflow_sensors,
            seed=seed_of("airflow_sensors"),
            tick_s=tick_s,
        ),
        ContactSwitches(
            faults=scenario.faults,
            robot=scenario.robot,
            bodies=bodies,
            source_size=scenario.odor.container_m,
            tick_s=tick_s,
        ),
    ]


def _ears(
    scenario: Scenario,
    bodies: int,
    others: Sequence[str],
    seed_of: Callable[[str], int],
) -> list[Any]:
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
        CrossPowerEstimator(
            parameters=scenario.cross_power,
            robot=scenario.robot,
            acoustics=scenario.acoustics,
            microphones=scenario.microphones,
        ),
        RadioRange(
            parameters=scenario.radio,
            seed=seed_of("radio_range"),
            tick_s=scenario.tick_s,
        ),
    ]
