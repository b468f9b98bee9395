"""How much clear floor a guarded robot needs ahead, by theorem and by simulation.

    python -m benchmarks.guard_distances

For speeds of the robot and of bodies, the distance of the axle from a wall straight
ahead at which the guard no longer passes the command: as the theorem has it, with the
bounds of the braking, and in runs by compiled loops in which the robot drives at the
wall. Then for each preset of sensors what of the round it sees, and so which guarantee
there is.
"""

from __future__ import annotations

import numpy as np

from analysis.reporting.markdown import markdown_table
from analysis.safety.guarantees import clear_way, seen_angle_deg
from benchmarks.guard_drivers import drive_at_a_wall
from diagrams import Scenario
from systems.ranging.sensor_presets import SENSOR_PRESETS
from systems.ranging.ultrasonic_array import UltrasonicParameters
from systems.safety.braking import PASSED
from systems.safety.motion_guard import GuardParameters

__all__ = ["needed_distance", "passed_distance"]

#: Of the robot and of bodies, m/s.
SPEEDS_M_S, BODIES_M_S = (0.2, 0.4, 0.62, 0.72), (0.0, 0.3, 0.6, 1.0)


def needed_distance(speed: float, body_speed: float) -> float:
    """``clear_way`` of the default robot with a guard.

    Args:
        speed: Of the robot, m/s.
        body_speed: Up to which it is guarded against bodies, m/s.

    Returns:
        m, from the axle.
    """
    return clear_way(Scenario(guard=GuardParameters()), speed, body_speed)


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
        sensors = UltrasonicParameters.model_validate({"preset": name})
        share = seen_angle_deg(sensors, Scenario().robot.control_point_m)
        kind = "passive orientation"
        if share > 359.0:
            kind += ", all round"
        rows.append([f"`{name}`", f"{share:.0f} deg", "yes", kind])
    names = ["sensors", "see", "static safety", "against what moves"]
    print(markdown_table(names, rows))


if __name__ == "__main__":
    main()
