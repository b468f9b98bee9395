"""Named robots: what a user would else write field by field."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

__all__ = ["ROBOT_PRESETS", "RobotPreset"]

RobotPreset = Literal["han2019", "turtlebot3_burger"]

#: Fields of ``RobotParameters`` that differ from the slave robot of Han 2019.
ROBOT_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "han2019": {},
    # ROBOTIS e-Manual, TurtleBot3 Burger: 138 x 178 mm, 1 kg, wheels of 66 mm,
    # 160 mm apart, 0.22 m/s. P is half a wheel separation ahead of the axle, so that
    # its speeds along and across have one limit. It has no microphones of its own:
    # these are ours.
    "turtlebot3_burger": {
        "length_m": 0.138,
        "width_m": 0.178,
        "control_point_m": 0.08,
        "microphones_m": ((0.0, 0.05), (0.0, 0.0), (0.0, -0.05)),
        "wheel_radius_m": 0.033,
        "wheel_separation_m": 0.16,
        "mass_kg": 1.0,
        "top_speed_m_s": 0.22,
    },
}
