"""Named robots: what a user would else write field by field."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

RobotPreset = Literal[
    "han2019", "turtlebot3_burger", "song2011_olfactory", "song2011_hearing"
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

#: Fields of ``RobotParameters`` that differ from the slave robot of Han 2019.
ROBOT_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "han2019": {},
    # ROBOTIS e-Manual, TurtleBot3 Burger: 138 x 178 mm, 1 kg, wheels of 66 mm,
    # 160 mm apart, 0.22 m/s; mass, wheels and track are also in tables 1 and 2 of
    # Engelbrecht, Steyn and Djouani (2021). P is half a wheel separation ahead of the
    # axle, so that its speeds along and across have one limit. It has no microphones of
    # its own: these are ours.
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
    # Song 2011: neither sizes nor track are printed; these are ours. P is over the axle
    # but for a centimetre: nothing is steered by it. The smelling robot has no use for
    # microphones.
    "song2011_olfactory": _SONG,
    # A microphone in the middle and three on arms of 15 cm (3.1), one of them ahead.
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
