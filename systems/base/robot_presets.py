"""Named robots: sets of values for the fields of ``RobotParameters``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

RobotPreset = Literal[
    "han2019",
    "turtlebot3_burger",
    "jackal",
    "p3dx",
    "song2011_olfactory",
    "song2011_hearing",
]

_SONG: Mapping[str, Any] = {
    "length_m": 0.14,
    "width_m": 0.2,
    "control_point_m": 0.01,
    "wheel_radius_m": 0.03,
    "wheel_separation_m": 0.2,
    "mass_kg": 2.0,
    "top_speed_m_s": 0.2,
}

#: Fields of ``RobotParameters`` that differ from the follower of Han 2019, by preset.
ROBOT_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "han2019": {},
    # ROBOTIS e-Manual, TurtleBot3 Burger: 138 x 178 mm, 1 kg, wheels of 66 mm diameter,
    # 160 mm apart, 0.22 m/s. Mass, wheels, and track are also in tables 1 and 2 of
    # Engelbrecht, Steyn and Djouani (2021). P is half a wheel separation ahead of the
    # axle, so the speeds of P along and across the heading have the same limit. The
    # real robot has no microphones. The microphone positions are our choice.
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
    # Clearpath Jackal: 508 x 430 mm, 17 kg, 2 m/s. Wheels and track are those of its
    # public ROS description (jackal_description). P is half a wheel separation ahead of
    # the axle. The microphone positions are our choice.
    "jackal": {
        "length_m": 0.508,
        "width_m": 0.430,
        "control_point_m": 0.188,
        "microphones_m": ((0.0, 0.2), (0.0, 0.0), (0.0, -0.2)),
        "wheel_radius_m": 0.098,
        "wheel_separation_m": 0.376,
        "mass_kg": 17.0,
        "top_speed_m_s": 2.0,
    },
    # Pioneer 3-DX: 455 x 381 mm, 9 kg, wheels of 195 mm diameter, 1.2 m/s (data sheet),
    # wheels 331 mm apart (models of simulators). P is half a wheel separation ahead of
    # the axle. The microphone positions are our choice.
    "p3dx": {
        "length_m": 0.455,
        "width_m": 0.381,
        "control_point_m": 0.1655,
        "microphones_m": ((0.0, 0.15), (0.0, 0.0), (0.0, -0.15)),
        "wheel_radius_m": 0.0975,
        "wheel_separation_m": 0.331,
        "mass_kg": 9.0,
        "top_speed_m_s": 1.2,
    },
    # Song 2011 prints neither size nor track. Both are our choice. P is only 1 cm
    # ahead of the axle, because no law steers by it. The olfactory robot does not use
    # its microphones.
    "song2011_olfactory": _SONG,
    # One microphone is in the middle. Three are on arms of 15 cm (Song 2011, 3.1). One
    # of these arms points ahead.
    "song2011_hearing": {
        **_SONG,
        "microphones_m": (
            (-0.01, 0.0),
            (0.14, 0.0),
            (-0.085, 0.15 * 3.0**0.5 / 2.0),
            (-0.085, -0.15 * 3.0**0.5 / 2.0),
        ),
    },
}
