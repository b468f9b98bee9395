"""Arrays that people build, and what ``locate`` and ``listen`` say of their sound."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.live_hearing import LiveHearing
from analysis.arrays.sound_stream import SoundBlock, SoundStream, StreamBrokenError
from studies.support.image_sources import SOUND_SPEED_M_S


def circle(count: int, diameter_m: float) -> NDArray[np.float64]:
    """Returns (count, 3) places on a level circle, m."""
    turn = 2.0 * np.pi * np.arange(count) / count
    around = (np.cos(turn), np.sin(turn), np.zeros(count))
    return 0.5 * diameter_m * np.stack(around, axis=1)


def row(*x_m: float) -> NDArray[np.float64]:
    """Returns places along the x axis, m."""
    return np.array([[x, 0.0, 0.0] for x in x_m])


_CORNERS = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])

ARRAYS: dict[str, NDArray[np.float64]] = {
    "square 4.6 cm": 0.02285 * _CORNERS,
    "square 1 m": 0.5 * _CORNERS,
    "row of 4": row(-0.075, -0.025, 0.025, 0.075),
    "row of 3": row(-0.1, 0.0, 0.1),
    "pair 10 cm": row(-0.05, 0.05),
    "pair 20 cm": row(-0.1, 0.1),
    "pair 1 m": row(-0.5, 0.5),
    "triangle 1 m": circle(3, 1.0),
    "triangle 10 cm": circle(3, 0.1154),
    "circle of 6": circle(6, 0.093),
    "circle of 8": circle(8, 0.2),
    "tetrahedron": 0.06
    * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]),
}


def geometry_of(places: NDArray[np.float64]) -> ArrayGeometry:
    """Returns the geometry of places at 20 deg C; level rows have no z coordinate."""
    level = not np.ptp(places[:, 1:])
    given = places[:, :2] if level else places
    return ArrayGeometry.model_validate(
        {"microphones": given.tolist(), "sound_speed": SOUND_SPEED_M_S}
    )


def angle_off_deg(
    bearing_deg: float, truth: NDArray[np.float64], places: NDArray[np.float64]
) -> float:
    """Returns how far a bearing is from the (3,) true place, deg.

    A row knows only the angle to its axis. Its bearing is compared with this angle.
    """
    true_deg = np.degrees(np.arctan2(truth[1], truth[0]))
    axes = np.linalg.svd(places - places.mean(axis=0))
    if axes[1][1] > 1e-6:
        return abs(float((bearing_deg - true_deg + 180.0) % 360.0 - 180.0))
    along, turn = axes[2][0], math.radians(bearing_deg)
    to_axis = math.degrees(math.acos(along @ truth / np.linalg.norm(truth)))
    told = math.acos(along @ [math.cos(turn), math.sin(turn), 0.0])
    return abs(math.degrees(told) - to_axis)


def streamed(
    samples: NDArray[np.float64],
    rate: int,
    geometry: ArrayGeometry,
    tell: Callable[[float, float], None],
) -> str:
    """Listens to (n, k) samples; reports time, s, and bearing, rad, of each track.

    Returns what stopped the stream, or an empty text.
    """
    sound = samples.astype(np.float32)
    size = rate // 50
    blocks = (SoundBlock(sound[:, k : k + size]) for k in range(0, len(sound.T), size))
    hearing = LiveHearing(SoundStream(len(sound), rate, blocks), geometry)
    try:
        for step in hearing.steps():
            for track in step.sources.tracks:
                tell(step.sources.t_s, track.bearing)
    except StreamBrokenError as error:
        return str(error)
    return ""
