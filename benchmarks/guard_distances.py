"""How much clear floor a guarded robot needs ahead, by theorem and by simulation.

    python -m benchmarks.guard_distances

For speeds of the robot and of bodies, the distance of the axle from a wall straight
ahead at which the guard no longer passes the command: as the theorem has it, with the
bounds of the braking, and in runs by compiled loops in which the robot drives at the
wall. Then for each preset of sensors what of the round it sees, and so which guarantee
there is.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.reporting.markdown import markdown_table
from benchmarks.guard_drivers import drive_at_a_wall
from diagrams import Scenario
from systems.ranging.sensor_presets import SENSOR_PRESETS
from systems.ranging.ultrasonic_array import UltrasonicParameters
from systems.safety.braking import PASSED
from systems.safety.free_space_map import body_radius, sensor_sectors
from systems.safety.motion_guard import GuardParameters

__all__ = ["needed_distance", "passed_distance", "seen_share"]

#: Of the robot and of bodies, m/s.
SPEEDS_M_S, BODIES_M_S = (0.2, 0.4, 0.62, 0.72), (0.0, 0.3, 0.6, 1.0)
#: What the rims still move after the commanded speed is 0, in lags.
_LAGS = 6.0


def needed_distance(speed: float, body_speed: float) -> float:
    """Of the axle from a wall, at which a command is passed by the theorem.

    Args:
        speed: Of the robot, m/s.
        body_speed: Up to which it is guarded against bodies, m/s.

    Returns:
        m: the disc and the margins, the way of a tick and of braking with the lag, the
        error of ranges, and what bodies come nearer by meanwhile.
    """
    scenario, guard = Scenario(), GuardParameters(obstacle_speed_m_s=body_speed)
    keep = body_radius(scenario.robot) + guard.margin_m
    error = scenario.free_space.range_error(scenario.ultrasonic)
    lag, tick = scenario.plant.motor_lag_s, scenario.tick_s
    way = speed**2 / (2.0 * guard.braking_m_s2) + speed * (lag + 2.0 * tick)
    if body_speed == 0.0:
        # A cell counts as a whole, and its rows are entered by turns.
        cell = scenario.free_space.cell_m
        return keep + way + error + math.sqrt(2.0) * cell + 4.0 * tick * speed
    time = speed / guard.braking_m_s2 + 2.0 * tick + _LAGS * lag
    return keep + way + error + body_speed * (tick + time)


def passed_distance(speed: float, body_speed: float) -> float:
    """The same in a run: where the guard last passed the command.

    Args:
        speed: Of the robot, m/s.
        body_speed: Up to which it is guarded against bodies, m/s.

    Returns:
        m, from the axle.
    """
    run, wall_m = drive_at_a_wall(speed, body_speed)
    passed = run.columns["guard_action"] == PASSED
    last = np.argmin(passed) - 1 if not passed.all() else len(passed) - 1
    return float(wall_m - run.columns["p_WB_x"][last])


def seen_share(preset: str) -> float:
    """How much of the round the sensors of a preset see.

    Args:
        preset: One of ``SENSOR_PRESETS``.

    Returns:
        deg, of 360.
    """
    sensors = UltrasonicParameters.model_validate({"preset": preset})
    sectors = sensor_sectors(sensors, Scenario().robot.control_point_m)
    turns = np.arange(-180.0, 180.0, 0.25) + 0.125
    seen = np.zeros(len(turns), dtype=bool)
    for k, by in enumerate(sectors.seen_by):
        if by.any():
            right, left = np.degrees([sectors.right[k, 0], sectors.left[k, 0]])
            seen |= (turns - right) % 360.0 <= left - right
    return 0.25 * float(seen.sum())


def main() -> None:
    """Prints both tables."""
    rows = [
        [f"{v:g} m/s"]
        + [
            f"{needed_distance(v, u):.2f} / {passed_distance(v, u):.2f}"
            for u in BODIES_M_S
        ]
        for v in SPEEDS_M_S
    ]
    head = [f"bodies {u:g} m/s" if u else "all rests" for u in BODIES_M_S]
    print(markdown_table(["robot", *head], rows))
    rows = []
    for name in SENSOR_PRESETS:
        share = seen_share(name)
        kind = "passive" if share > 359.0 else "passive orientation"
        rows.append([f"`{name}`", f"{share:.0f} deg", "yes", kind])
    names = ["sensors", "see", "static safety", "against what moves"]
    print(markdown_table(names, rows))


if __name__ == "__main__":
    main()
