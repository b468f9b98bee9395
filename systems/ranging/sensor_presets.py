"""Named sets of range sensors, and their places on the body of a robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

SensorPreset = Literal[
    "three", "six", "ring_8", "ring_12", "lidar", "lidar_270", "scan_7"
]

#: Position of a mast above the axle of the default robot. The body of the robot does
#: not block the view of a sensor on the mast. ``on_body`` gives the position for other
#: robots.
_MAST = {"position_m": (-0.175, 0.0)}
#: Presets whose sensors are on the mast, and those of ``six`` on the rear edge.
_ON_MAST = ("ring_8", "ring_12", "lidar", "lidar_270")
_REAR_OF_SIX = (3, 4, 5)
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
    # A scanner like those of the BARN challenge: 270 deg, centered on the heading. The
    # number of beams and the range are our choice.
    "lidar_270": {
        **_MAST,
        "sensors": [{"axis_deg": 3.6 * k} for k in range(37, -38, -1)],
        "beam_half_angle_deg": 1.8,
        "maximum_range_m": 10.0,
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


def on_body(
    group: Mapping[str, Any], length_m: float, control_point_m: float
) -> dict[str, Any]:
    """Adds the positions of a preset's sensors on the body of a robot.

    A mast stands above the axle, and the sensors that look back are on the rear edge.

    Args:
        group: Input of the group ``ultrasonic``. Positions in it stay unchanged.
        length_m: Length of the body, whose center is the middle of the axle, m.
        control_point_m: Distance of the control point P ahead of the axle, m.

    Returns:
        The input with positions relative to P, m.
    """
    preset, sensors = group.get("preset"), group.get("sensors", {})
    if "position_m" in group or "positions_m" in group:
        return dict(group)
    if preset in _ON_MAST:
        return {**group, "position_m": (-control_point_m, 0.0)}
    if preset != "six" or not isinstance(sensors, Mapping):
        return dict(group)
    rear = {"position_m": (-control_point_m - length_m / 2.0, 0.0)}
    places = {str(k): rear for k in _REAR_OF_SIX}
    changed = {
        str(k): {**places.get(str(k), {}), **own} if isinstance(own, Mapping) else own
        for k, own in sensors.items()
    }
    return {**group, "sensors": places | changed}
