"""Arrays that are not where they are said to be, and what they measure."""

from __future__ import annotations

import math

import numpy as np

from analysis.arrays.calibration_sounds import MeasuredSound

SQUARE = np.array(
    [[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0], [-0.5, -0.5, 0.0], [0.5, -0.5, 0.0]]
)
SIX = np.array(
    [
        [0.5, 0.5, 0.0],
        [-0.5, 0.5, 0.2],
        [-0.5, -0.5, 0.0],
        [0.5, -0.5, 0.5],
        [0.0, 0.0, 0.7],
        [0.2, 0.1, -0.3],
    ]
)
_THIRDS = 2 * math.pi * np.arange(3) / 3
#: A triangle of 1.4 m and its middle: planar, and sees ranges straight ahead.
TRIANGLE = 0.8 * np.vstack(
    (np.zeros(3), np.stack((np.cos(_THIRDS), np.sin(_THIRDS), 0 * _THIRDS), axis=1))
)
C = 340.0
PLACE_STD, SPEED_STD, LATE_STD, SPOT_STD, NOISE_STD = 0.02, 3.4, 2e-6, 0.005, 5e-6


def spots_around(count, rng, height=(0.5, 2.0)):
    """(count, 3) places 2 to 5 m from the origin, all around."""
    azimuth = 2 * math.pi * (np.arange(count) + rng.random(count)) / count
    distance = rng.uniform(2.0, 5.0, count)
    return np.stack(
        (
            distance * np.cos(azimuth),
            distance * np.sin(azimuth),
            rng.uniform(*height, count),
        ),
        axis=1,
    )


def noise_covariance(count, noise_std=NOISE_STD):
    """Of differences against channel 0 of equal independent errors."""
    return noise_std**2 * (np.eye(count - 1) + 1.0)


def measured(
    places, c, late, spots, rng, *, known=True, noise_std=NOISE_STD, spot_std=SPOT_STD
):
    """Sounds with noise, their positions stated with errors or not at all."""
    sounds = []
    for k, spot in enumerate(spots):
        arrival = np.linalg.norm(spot - places, axis=1) / c + late
        arrival += noise_std * rng.standard_normal(len(places))
        stated = spot + spot_std * rng.standard_normal(spot.size)
        sounds.append(
            MeasuredSound(
                arrival[1:] - arrival[0],
                noise_covariance(len(places), noise_std),
                stated if known else None,
                spot_std,
                f"sound {k + 1}",
            )
        )
    return sounds


def drawn(nominal, rng):
    """Places, speed of sound and lateness of channels within their deviations."""
    places = nominal + PLACE_STD * rng.standard_normal(nominal.shape)
    late = LATE_STD * rng.standard_normal(len(nominal))
    return places, C + SPEED_STD * rng.standard_normal(), late
