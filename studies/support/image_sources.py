"""Sound of a source that moves in free field or in a room, with exact delays."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve, resample_poly

SOUND_SPEED_M_S = 343.2
#: The room, m, and the centroid of the array in it, m.
ROOM_M = np.array([6.0, 5.0, 2.8])
CENTER_M = np.array([3.0, 2.2, 1.2])

# The sound is read between samples of this many times the rate.
_FINER = 8
# Images after this many reflections are computed. Later ones make a tail that is
# independent in each channel.
_MOST_BOUNCES = 2
# The path of the source is computed at this many points a second.
_POINTS_HZ = 200.0


def heard_moving(
    sound: NDArray[np.float64],
    rate: int,
    path_m: NDArray[np.float64],
    microphones_m: NDArray[np.float64],
    t60_s: float = 0.0,
) -> NDArray[np.float64]:
    """Computes what microphones hear of a source that moves.

    Args:
        sound: (samples,) sound of the source.
        rate: Sample rate, Hz.
        path_m: (k, 3) places of the source at equal steps of time, from the array's
            centroid, m.
        microphones_m: (n, 3) places of the microphones, from the same point, m. For an
            array that turns, (k, n, 3).
        t60_s: Reverberation time of the room, s. 0: free field.
            Up to two reflections are exact, and later ones are random.

    Returns:
        (n, samples) channels.
    """
    t = np.arange(sound.size) / rate
    points = np.linspace(0.0, t[-1], max(2, round(t[-1] * _POINTS_HZ)))
    steps = np.linspace(0.0, t[-1], len(path_m))
    path = np.stack([np.interp(points, steps, x) for x in path_m.T], axis=1)
    moving = np.broadcast_to(microphones_m, (len(path_m), *microphones_m.shape[-2:]))
    fine = resample_poly(sound, _FINER, 1)
    fine_t = np.arange(fine.size) / (_FINER * rate)
    heard = _tail(sound, rate, moving.shape[1], t60_s)
    for image, gain in _images(path + CENTER_M, t60_s):
        for k in range(len(heard)):
            at = [np.interp(points, steps, x) for x in moving[:, k].T]
            distance = np.linalg.norm(image - CENTER_M - np.stack(at, axis=1), axis=1)
            r = np.interp(t, points, distance)
            late = np.interp(t - r / SOUND_SPEED_M_S, fine_t, fine, left=0.0)
            heard[k] += gain / r * late
    return heard


def _absorption(t60_s: float) -> float:
    x, y, z = ROOM_M
    surface = 2.0 * (x * y + y * z + z * x)
    return float(min(0.99, 0.161 * x * y * z / (surface * t60_s)))


def _tail(
    sound: NDArray[np.float64], rate: int, count: int, t60_s: float
) -> NDArray[np.float64]:
    """Returns late reverberation (count, samples), from the statistics of the room."""
    if t60_s == 0.0:
        return np.zeros((count, sound.size))
    rng = np.random.default_rng(0)
    t = np.arange(round(t60_s * rate)) / rate
    # Energy of the images whose sound arrives within a sample, from their density.
    density = 4.0 * np.pi * SOUND_SPEED_M_S / float(np.prod(ROOM_M)) / rate
    begin = (_MOST_BOUNCES + 1) * 2.0 / SOUND_SPEED_M_S
    level = np.sqrt(density) * 10.0 ** (-3.0 * t / t60_s) * (t > begin)
    response = level * rng.standard_normal((count, t.size))
    return fftconvolve(sound[np.newaxis], response, axes=1)[:, : sound.size]


def _images(
    path: NDArray[np.float64], t60_s: float
) -> list[tuple[NDArray[np.float64], float]]:
    """Returns the path of each early image in the room, and its gain."""
    if t60_s == 0.0:
        return [(path, 1.0)]
    kept = np.sqrt(1.0 - _absorption(t60_s))
    found = []
    for cell in product((-1, 0, 1), repeat=3):
        for flip in product((0, 1), repeat=3):
            bounces = sum(abs(2 * n - f) for n, f in zip(cell, flip, strict=True))
            if bounces <= _MOST_BOUNCES:
                sign = 1.0 - 2.0 * np.array(flip)
                image = sign * path + 2.0 * np.array(cell) * ROOM_M
                found.append((image, float(kept**bounces)))
    return found
