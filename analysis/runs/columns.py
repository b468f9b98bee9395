"""Defines the meaning and the unit of each column in the table of a run.

Most columns come from ports of the blocks of the model. The blocks define the names and
the units of their ports. ``tests/analysis/runs/test_columns.py`` checks that the names
and units in this file agree with those of the blocks.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

from systems.framework.input_error import InputError

if TYPE_CHECKING:
    import pandas as pd

    from diagrams import RunResult


class Column(NamedTuple):
    """Meaning and unit of one column, or of columns that differ only in a number."""

    name: str
    """Name of the column. ``{k}`` stands for a number, from 1."""
    unit: str
    """Unit of the column. ``1`` means dimensionless, ``0 or 1`` means a truth value,
    and ``number`` means a code or a count."""
    meaning: str
    """Meaning of the column, as one phrase."""


def _of(unit: str, **meanings: str) -> list[Column]:
    """Returns several columns with the same unit."""
    return [
        Column(name.replace("_K", "_{k}"), unit, text)
        for name, text in meanings.items()
    ]


def _xy(unit: str, name: str, meaning: str) -> list[Column]:
    """Returns the columns ``name_x`` and ``name_y`` of a vector."""
    return [Column(f"{name}_{axis}", unit, f"{axis} of {meaning}") for axis in "xy"]


_MOTION = [
    *_of("s", t="time of the tick since the beginning of the run"),
    *_xy("m", "p_WB", "the middle of the axle, B, in W"),
    *_of("rad", theta_WB="heading of the robot in W, counter-clockwise, not wrapped"),
    *_xy("m/s", "v_WB", "the velocity of B in W"),
    *_of("rad/s", omega_WB="yaw rate of the robot, counter-clockwise"),
    *_xy("m", "p_WP", "the control point, P, in W"),
    *_xy("m/s", "v_WP", "the velocity of P in W, commanded from t on"),
    *_of(
        "rad/s",
        wheel_speed_left="speed of the left wheel, commanded from t on",
        wheel_speed_right="speed of the right wheel, commanded from t on",
    ),
    *_of(
        "m/s",
        slip_left="speed of the left rim minus speed of the ground below it",
        slip_right="speed of the right rim minus speed of the ground below it",
        slip_sideways="speed of the wheels to the left over the ground",
    ),
    *_xy("m", "p_WB_estimated", "B in W, by odometry"),
    *_of("rad", theta_WB_estimated="heading in W, by odometry"),
]
_HEARING = [
    *_xy("m", "p_WS", "S, the source, robot or goal that the robot follows, in W"),
    *_of("rad", theta_WS="heading of S in W"),
    *_of("m", source_range_true="distance from P to S"),
    *_of("rad", source_bearing_true="direction from P to S, from the robot's x axis"),
    *_of(
        "m",
        p_PS_B_x="forward component of the heard position of S from P; 0 if nothing "
        "is heard, of a unit vector if there is no range",
        p_PS_B_y="leftward component of the heard position of S from P, likewise",
    ),
    *_of("m", source_range="heard distance from P to S; empty if there is no range"),
    *_of(
        "rad",
        source_bearing="heard direction from P to S, from the robot's x axis; empty if "
        "nothing is heard",
    ),
    *_of(
        "0 or 1",
        detected="whether the source was heard in the last frame",
        range_valid="whether its range was heard in the last frame",
    ),
    *_of(
        "number",
        range_status="0 nothing heard, 1 there is a range; the others are reasons for "
        "no range: 2 plane wave, 3 no position fits, 4 too uncertain, 5 too few "
        "microphones, 6 sound rejected",
    ),
    *_of(
        "0 or 1",
        target_valid="whether there is a valid target",
        ambiguous="whether another direction fits the sound as well",
    ),
    *_xy("m", "p_WS_estimated", "the position of S that the robot assumes, in W"),
    *_of("number", lost_microphone="the first microphone that hears nothing; 0: none"),
]
_OBSTACLES = [
    *_of("m", range_K="last range of sensor k; its greatest range if there is no echo"),
    *_of("0 or 1", echo_K="whether sensor k had an echo"),
    *_of(
        "m",
        collision_K_B_x="forward part of collision vector k, from P to an obstacle",
        collision_K_B_y="leftward part of collision vector k",
    ),
    *_of(
        "number", feature_K="code of the sensors that vector k comes from; 0: no vector"
    ),
    *_of(
        "m/s",
        obstacle_speed_K="speed s of the obstacle of vector k, as the law uses it",
    ),
]
_CONTROL = [
    *_xy("N", "attraction", "the force toward the target, in W"),
    *_xy("N", "repulsion", "the force away from obstacles, in W"),
    *_of("m/s", wanted_speed="forward speed that the law commands"),
    *_of("rad/s", wanted_turn="yaw rate that the law commands"),
    *_of(
        "number",
        plan_mode="0 no target, 1 driving, 2 looking, 3 backing off or making room to "
        "turn, 4 no path found",
    ),
    *_xy("m", "carrot", "the point that the law heads for, in W"),
    *_of("m", way_left="remaining path length to the target"),
    *_of(
        "number",
        guard_action="action of the guard: 0 passed, 1 slowed, 2 turned, 3 braked, 4 "
        "halted because of a sensing fault",
    ),
    *_of(
        "m",
        guard_distance="distance to space that is not free minus the distance that the "
        "guard needs",
        guard_stopping_distance="distance in which the robot can stop",
        guard_view_distance="guard_distance for obstacles in view",
    ),
    *_of(
        "number",
        sensing_fault="fault of the sensing: 0 none, 1 odometry jumped, 2 a sensor is "
        "silent, 3 frozen, 4 noisy",
        faulty_sensor="number of the faulty range sensor; 0: none",
    ),
]
_ROUTES = [
    *_of("number", replans="number of routes that were planned again"),
    *_xy("m", "target", "the target on the route, in W"),
    *_of(
        "m/s",
        target_vx="x of the velocity of the target, in W",
        target_vy="y of the velocity of the target, in W",
    ),
    *_of(
        "m",
        target_along="distance of the target along the route",
        robot_along="distance of P along the route",
    ),
    *_xy("m", "reference", "the position of the reference model, in W"),
    *_of(
        "m/s",
        reference_vx="x of the reference model's velocity, in W",
        reference_vy="y of the reference model's velocity, in W",
    ),
    *_of(
        "N/m",
        stiffness="stiffness between robot and target, K",
        contact_stiffness="stiffness between robot and obstacles, K_e",
    ),
    *_of("N s/m", damping="damping between robot and target, D"),
    *_of(
        "m/s",
        filter_slack="speed by which the filter relaxes its limit near moving objects",
    ),
    *_of("0 or 1", filter_active="whether the velocity filter changed the command"),
]
_SEARCHES = [
    *_of(
        "deg",
        heading_deg="heading by the compass, clockwise from north",
        expected_heading_deg="heading that the search wants, clockwise from north",
    ),
    *_of(
        "1",
        duty_left="duty of the left motor, -1 to 1",
        duty_right="duty of the right motor, -1 to 1",
        gas_right="reading of the right gas sensor, Rs/R0: 1 in clean air",
        gas_rear="reading of the rear gas sensor",
        gas_left="reading of the left gas sensor",
        concentration_right="true concentration at the right gas sensor, over C1",
        concentration_rear="true concentration at the rear gas sensor, over C1",
        concentration_left="true concentration at the left gas sensor, over C1",
        airflow_left="reading of the airflow sensor that looks to the left",
        airflow_right="reading of the airflow sensor that looks to the right",
    ),
    *_of(
        "0 or 1",
        contact_left="whether the left contact switch is closed",
        contact_right="whether the right contact switch is closed",
        move="whether the search lets the robot move",
        calling="whether the robot calls",
    ),
    *_of("dBm", rssi_dbm="level of the caller's radio"),
    *_of(
        "number",
        touched="the body that the switches touch; -1: none",
        listening="what the robot listens to: 0 nothing, 1 noise, 2 sound",
        search_ended="end of the search: 0 it continues, 1 found, else the reason for "
        "giving up (systems/search/search_ending.py)",
        search_phase="phase of the search, a number of its rules",
        search_steps="number of steps begun",
        search_fault="faults that the search has found, one bit per fault "
        "(systems/search/search_ending.py)",
        sink_frames="number of radio frames of the robot that the sink has received",
        sink_function="function of the last of these frames, by the protocol; -1: "
        "none yet (systems/radio/codec.py)",
        sink_value="value of the last of these frames",
        sink_result="result of the search at the sink: -1 none, 0 not found, 1 found",
    ),
    *_of("s", sink_age_s="time since the sink received the last of these frames"),
]
#: All columns that tables of runs can have. The order follows the flow of the signals.
COLUMNS: tuple[Column, ...] = (
    *_MOTION,
    *_HEARING,
    *_OBSTACLES,
    *_CONTROL,
    *_ROUTES,
    *_SEARCHES,
)
_BY_NAME = {column.name: column for column in COLUMNS}


def column_of(name: str) -> Column | None:
    """Returns the unit and the meaning of a column, or None if they are unknown.

    They are unknown for a column of a user's own block. The name may begin with the
    name of a robot and a dot. If the name contains a number, the meaning contains this
    number, too.
    """
    own = name.rpartition(".")[2]
    number = re.search(r"(?<=_)\d+", own)
    pattern = re.sub(r"(?<=_)\d+", "{k}", own, count=1)
    found = _BY_NAME.get(own) or _BY_NAME.get(pattern)
    if found is None:
        return None
    k = number[0] if number else ""
    return Column(name, found.unit, re.sub(r"\bk\b", k, found.meaning))


def columns(of: RunResult | Iterable[str] | None = None) -> pd.DataFrame:
    """Returns a table with the unit and the meaning of each column of a run.

    Args:
        of: A run, or names of columns. None means all columns that any run can have.
            Their names then have ``{k}`` instead of numbers.

    Returns:
        Table with one row per column. The index is the name of the column, and the
        columns are ``unit`` and ``meaning``. For a column of a user's own block, both
        entries are empty.

    Raises:
        InputError: The argument is a scenario or a string instead of a run.
    """
    import pandas as pd

    from diagrams import RunResult, Scenario

    if isinstance(of, Scenario | str):
        raise InputError("of", "give a run, as simulate returns it, or its columns")
    if of is None:
        rows = list(COLUMNS)
    else:
        names = of.columns if isinstance(of, RunResult) else of
        rows = [column_of(name) or Column(name, "", "") for name in names]
    return pd.DataFrame(rows, columns=list(Column._fields)).set_index("name")
