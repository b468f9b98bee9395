"""Named sets of range sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

SensorPreset = Literal["three", "six", "ring_8", "ring_12", "lidar", "scan_7"]

#: Position of a mast above the axle. The body of the robot does not block the view of a
#: sensor on the mast.
_MAST = {"position_m": (-0.175, 0.0)}
_FRONT = [{"axis_deg": axis} for axis in (30.0, 0.0, -30.0)]

#: Fields of ``ultrasonic`` by the name of the preset, see ``sensor_shorthand``.
SENSOR_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "three": {"sensors": _FRONT},
    # Han 2019, 6: three more sensors on the rear edge of the body point backward.
    "six": {
        "sensors": [
            *_FRONT,
            *(
                {"axis_deg": axis, "position_m": (-0.35, 0.0)}
                for axis in (-150.0, -180.0, -210.0)
            ),
        ],
    },
    # Rings without gaps: the opening angle equals the angle between adjacent axes.
    "ring_8": {**_MAST, "sensors": 8, "beam_half_angle_deg": 22.5},
    "ring_12": {**_MAST, "sensors": 12, "beam_half_angle_deg": 15.0},
    "lidar": {
        **_MAST,
        "sensors": 72,
        "beam_half_angle_deg": 2.5,
        "maximum_range_m": 5.0,
        "noise_m": 0.01,
    },
    # Engelbrecht, Steyn and Djouani 2021, table 1: beams over the front half plane, 30
    # deg apart, R = 2 m. The paper does not print the width of a beam. The beams here
    # are narrow.
    "scan_7": {
        "sensors": [{"axis_deg": 90.0 - 30.0 * k} for k in range(7)],
        "beam_half_angle_deg": 0.5,
        "maximum_range_m": 2.0,
    },
}
