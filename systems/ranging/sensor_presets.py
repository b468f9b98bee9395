"""Named sets of range sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

SensorPreset = Literal["three", "six", "ring_8", "ring_12", "lidar", "scan_7"]

#: A mast above the axle, from where the body of the robot does not block any sensor.
_MAST = {"positions_m": ((-0.175, 0.0),)}

#: Fields of ``UltrasonicParameters`` that differ from the three sensors of the papers.
SENSOR_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "three": {},
    # Han 2019, 6: three more sensors on the rear edge of the body point backward.
    "six": {
        "axes_deg": (30.0, 0.0, -30.0, -150.0, -180.0, -210.0),
        "positions_m": (*((0.0, 0.0),) * 3, *((-0.35, 0.0),) * 3),
    },
    # Rings without gaps: the opening angle equals the angle between adjacent axes.
    "ring_8": {**_MAST, "axes_deg": 8, "beam_half_angle_deg": 22.5},
    "ring_12": {**_MAST, "axes_deg": 12, "beam_half_angle_deg": 15.0},
    "lidar": {
        **_MAST,
        "axes_deg": 72,
        "beam_half_angle_deg": 2.5,
        "maximum_range_m": 5.0,
        "noise_m": 0.01,
    },
    # Engelbrecht, Steyn and Djouani 2021, table 1: beams over the front half plane, 30
    # deg apart, R = 2 m. They do not print the width of a beam; the beams here are
    # narrow.
    "scan_7": {
        "axes_deg": (90.0, 60.0, 30.0, 0.0, -30.0, -60.0, -90.0),
        "beam_half_angle_deg": 0.5,
        "maximum_range_m": 2.0,
    },
}
