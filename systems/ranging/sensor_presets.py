"""Named sets of range sensors: what a user would else write field by field."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

SensorPreset = Literal["three", "six", "ring_8", "ring_12", "lidar", "scan_7"]

#: A mast over the axle: a ring there has no body of the robot in its view.
_MAST = {"positions_m": ((-0.175, 0.0),)}

#: Fields of ``UltrasonicParameters`` that differ from the papers' three sensors.
SENSOR_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "three": {},
    # Han 2019, 6: three more look behind, from the rear edge of the body.
    "six": {
        "axes_deg": (30.0, 0.0, -30.0, -150.0, -180.0, -210.0),
        "positions_m": (*((0.0, 0.0),) * 3, *((-0.35, 0.0),) * 3),
    },
    # Rings without gaps: twice the half angle is the angle between two axes.
    "ring_8": {**_MAST, "axes_deg": 8, "beam_half_angle_deg": 22.5},
    "ring_12": {**_MAST, "axes_deg": 12, "beam_half_angle_deg": 15.0},
    "lidar": {
        **_MAST,
        "axes_deg": 72,
        "beam_half_angle_deg": 2.5,
        "maximum_range_m": 5.0,
        "noise_m": 0.01,
    },
    # Engelbrecht, Steyn and Djouani 2021, table 1: a half plane ahead, 30 deg apart,
    # R = 2 m. How wide a beam is they do not print: these are as good as rays.
    "scan_7": {
        "axes_deg": (90.0, 60.0, 30.0, 0.0, -30.0, -60.0, -90.0),
        "beam_half_angle_deg": 0.5,
        "maximum_range_m": 2.0,
    },
}
