"""Predicts what an array can resolve: errors over direction and distance.

The noise of the delays is the Cramer-Rao bound for a sound of unknown waveform. Its
spectrum is flat in the band, and each microphone adds independent noise. The errors of
the array and of the air are those that the geometry states. Echoes are not included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import (
    HIGHEST_FAULTS_HZ,
    LOWEST_HZ,
    ArrayGeometry,
    KnownArray,
)
from analysis.arrays.range_posterior import farthest_m
from analysis.arrays.voting.single_waves import PhasePlane
from analysis.arrays.wave_fronts import wave_front
from systems.framework.input_error import InputError
from systems.hearing.multilateration import whitening_matrix
from systems.hearing.source_fix import NEAREST_M
from systems.sound.array_shape import ArrayShape

#: Bearings and elevations of the table, deg, and distances, m.
BEARINGS_DEG = tuple(float(b) for b in range(-165, 181, 15))
ELEVATIONS_DEG = (0.0, 30.0, 60.0)
DISTANCES_M = (0.5, 1.0, 2.0, 4.0, 8.0)

# Prior standard deviation of the inverse range: sources are rarely nearer than 0.5 m,
# and rarely nearer than two apertures.
_INVERSE_RANGE, _APERTURES = 1.0, 0.5

# Prior standard deviation of an angle: nothing is known.
_ANY_DIRECTION_RAD = 10.0
# Prior standard deviation of an inverse range of which nothing is known, 1/m.
_ANY_INVERSE_RANGE = 1e4

# Standard deviation of an angle that counts as not observable, rad.
_UNKNOWN_RAD = math.radians(60.0)

# Number of distances of the search for the farthest range.
_RANGES = 88


@dataclass(frozen=True)
class Sounding:
    """The sound for which errors are predicted."""

    snr_db: float
    """Level of the sound over the noise of a microphone, in the band, dB."""
    seconds: float
    """Duration of the sound, s."""
    band_hz: tuple[float, float]
    """Lowest and highest frequency, Hz."""

    def arrival_std(self, count: int) -> float:
        """Least standard deviation of the arrival times at ``count`` microphones, s.

        The covariance of the delays is its square times (1 + identity matrix).
        """
        snr = 10.0 ** (self.snr_db / 10.0)
        low, high = (2.0 * math.pi * f for f in self.band_hz)
        squares = (high**3 - low**3) / (3.0 * 2.0 * math.pi)
        seen = count * snr**2 / (1.0 + count * snr)
        return 1.0 / math.sqrt(2.0 * self.seconds * seen * squares)


@dataclass(frozen=True)
class PredictedError:
    """Predicted standard deviations for one position of a source."""

    bearing_deg: float
    elevation_deg: float | None
    """Elevation of the source; None if the array cannot measure it."""
    distance_m: float | None
    """Distance of the source; None: far away."""
    bearing_std_deg: float | None
    """Standard deviation of the bearing; None if it is not observable."""
    bearing_systematic_deg: float | None
    """Part of it from errors of the array and the air."""
    elevation_std_deg: float | None
    elevation_systematic_deg: float | None
    range_std_m: float | None
    """Standard deviation of the range; None if it is not observable."""
    range_systematic_m: float | None


@dataclass(frozen=True)
class Improvement:
    """Median errors of far sources if one property of the array is better."""

    change: str
    bearing_std_deg: float | None
    elevation_std_deg: float | None
    farthest_range_m: float | None
    """Median of the farthest ranges over all bearings; None if there is no range."""


@dataclass(frozen=True)
class ArrayResolution:
    """What an array can resolve."""

    geometry: ArrayGeometry
    sounding: Sounding
    arrival_std_s: float
    """Least standard deviation of an arrival time, from the noise, s."""
    ambiguity: str
    """Directions with equal delays: ``none``, ``front_back`` or ``mirror``."""
    angles: tuple[str, ...]
    """Angles that the array measures."""
    lowest_hz: float
    """Half a wavelength equals the aperture at this frequency. At lower frequencies,
    all microphones hear the echoes of a room in phase."""
    highest_hz: float
    """Half a wavelength equals the distance of neighbors at this frequency. At higher
    frequencies, a tone has several possible directions."""
    far: tuple[PredictedError, ...]
    """Errors of far sources over bearing and elevation."""
    near: tuple[PredictedError, ...]
    """Errors over bearing and distance, at elevation 0."""
    farthest_range_m: tuple[float | None, ...]
    """Farthest range that is reported, for each of ``BEARINGS_DEG``, m."""
    improvements: tuple[Improvement, ...]


def resolution(
    geometry: ArrayGeometry, snr_db: float = 20.0, seconds: float = 0.5
) -> ArrayResolution:
    """Predicts errors over direction and distance; see ``array_resolution``."""
    if not math.isfinite(snr_db) or not -40.0 <= snr_db <= 80.0:
        raise InputError("snr_db", f"is {snr_db}; give -40 to 80 dB")
    if not math.isfinite(seconds) or not 0.0 < seconds <= 3600.0:
        raise InputError("seconds", f"is {seconds}; give more than 0, up to 3600 s")
    sounding = Sounding(
        snr_db, seconds, geometry.band or (LOWEST_HZ, HIGHEST_FAULTS_HZ)
    )
    array = geometry.known
    shape = array.shape
    std = sounding.arrival_std(shape.count)
    heights = ELEVATIONS_DEG if "elevation" in shape.angles else (0.0,)
    far = [
        predicted_error(array, std, b, e, None) for e in heights for b in BEARINGS_DEG
    ]
    near = [
        predicted_error(array, std, b, 0.0, r)
        for r in DISTANCES_M
        for b in BEARINGS_DEG
    ]
    return ArrayResolution(
        geometry=geometry,
        sounding=sounding,
        arrival_std_s=std,
        ambiguity=shape.ambiguity,
        angles=shape.angles,
        lowest_hz=array.c / (2.0 * shape.aperture_m),
        highest_hz=PhasePlane.of(shape, array.c).wraps_hz,
        far=tuple(far),
        near=tuple(near),
        farthest_range_m=tuple(farthest_range(array, std, b) for b in BEARINGS_DEG),
        improvements=tuple(_improvements(geometry, sounding)),
    )


def predicted_error(
    array: KnownArray,
    arrival_std_s: float,
    bearing_deg: float,
    elevation_deg: float,
    distance_m: float | None,
) -> PredictedError:
    """Predicts the errors for a source at one position, to first order.

    Args:
        array: The microphones and their errors.
        arrival_std_s: Standard deviation of independent arrival times, s.
        bearing_deg: Bearing of the source, deg.
        elevation_deg: Elevation of the source, deg. It is 0 for arrays in the plane.
        distance_m: Distance of the source from the centroid, m. None: far away.

    Returns:
        The standard deviations.
    """
    shape = array.shape
    azimuth, height = math.radians(bearing_deg), math.radians(elevation_deg)
    level = math.cos(height)
    u = np.array([level * math.cos(azimuth), level * math.sin(azimuth)])
    around = np.array([-math.sin(azimuth), math.cos(azimuth)]) * level
    turns = [around]
    if shape.dimension == 3:
        u = np.append(u, math.sin(height))
        up = -math.sin(height) * np.array([math.cos(azimuth), math.sin(azimuth)])
        turns = [np.append(around, 0.0), np.append(up, level)]
    w = 0.0 if distance_m is None else 1.0 / distance_m
    measured = [name in shape.angles for name in ("bearing", "elevation")]
    turns = [turn for turn, known in zip(turns, measured, strict=False) if known]
    # A row is also ambiguous in elevation, which is taken as known.
    noise = arrival_std_s**2 * (np.eye(shape.count - 1) + 1.0)
    allowed = array.budget.delay_covariance(u, w, shape, array.c)
    front = wave_front(shape.p_AM, array.c, u, w)
    slopes = np.column_stack([*(front.by_h @ turn for turn in turns), front.by_w])
    prior = min(_INVERSE_RANGE, _APERTURES / shape.aperture_m)
    whole, systematic = _errors(slopes, noise, allowed, prior)
    told = iter(range(len(turns)))
    index = [next(told) if known else None for known in measured]
    bearing, elevation = (_angle(whole, systematic, k) for k in index)
    ranged: tuple[float | None, float | None] = (None, None)
    if distance_m is not None and shape.body is None:
        ranged = _range(slopes, noise, allowed, distance_m, array.largest_range_error)
    return PredictedError(
        bearing_deg,
        elevation_deg if measured[1] else None,
        distance_m,
        *bearing,
        *elevation,
        *ranged,
    )


def _errors(
    slopes: NDArray[np.float64],
    noise: NDArray[np.float64],
    allowed: NDArray[np.float64],
    prior: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Variances of all unknowns, and their part from the errors of the array.

    The last unknown is the inverse range, with a prior standard deviation.
    """
    root = whitening_matrix(noise + allowed)
    seen = root @ slopes
    information = seen.T @ seen
    priors = np.full(len(information), _ANY_DIRECTION_RAD)
    priors[-1] = prior
    covariance = np.linalg.inv(information + np.diag(priors**-2.0))
    gain = covariance @ seen.T @ root
    return np.diag(covariance), np.diag(gain @ allowed @ gain.T)


def _angle(
    whole: NDArray[np.float64], systematic: NDArray[np.float64], k: int | None
) -> tuple[float | None, float | None]:
    if k is None or not 0.0 < whole[k] < _UNKNOWN_RAD**2:
        return None, None
    return math.degrees(math.sqrt(whole[k])), math.degrees(math.sqrt(systematic[k]))


def _range(
    slopes: NDArray[np.float64],
    noise: NDArray[np.float64],
    allowed: NDArray[np.float64],
    distance_m: float,
    largest_error: float,
) -> tuple[float | None, float | None]:
    if len(slopes) < slopes.shape[1]:
        return None, None
    whole, systematic = _errors(slopes, noise, allowed, _ANY_INVERSE_RANGE)
    std = distance_m**2 * math.sqrt(float(whole[-1]))
    if not 0.0 < std <= largest_error * distance_m:
        return None, None
    return std, distance_m**2 * math.sqrt(float(systematic[-1]))


def farthest_range(
    array: KnownArray, arrival_std_s: float, bearing_deg: float
) -> float | None:
    """Finds the farthest distance at which the range is reported, m; None if none."""
    farthest = None
    last = farthest_m(array.shape.aperture_m)
    for distance_m in np.geomspace(NEAREST_M, last, _RANGES):
        found = predicted_error(array, arrival_std_s, bearing_deg, 0.0, distance_m)
        if found.range_std_m is None:
            break
        farthest = float(distance_m)
    return farthest


def _improvements(geometry: ArrayGeometry, sounding: Sounding) -> list[Improvement]:
    known, count = geometry.known, len(geometry.microphones)
    std = sounding.arrival_std(count)
    budget = known.budget
    exact = replace(budget, of_places=1e-12 * np.eye(len(budget.of_places)))
    wider = replace(ArrayShape.of(2.0 * known.shape.p_AM), body=known.shape.body)
    if known.shape.side is not None:
        wider = wider.facing(known.shape.side)
    louder = replace(sounding, snr_db=sounding.snr_db + 10.0).arrival_std(count)
    changes = [
        ("as stated", known, std),
        ("exact positions", replace(known, budget=exact), std),
        (
            "exact sampling times",
            replace(known, budget=replace(budget, delay_std=0.0)),
            std,
        ),
        (
            "exact speed of sound",
            replace(known, budget=replace(budget, speed_std=0.0)),
            std,
        ),
        ("twice the aperture", replace(known, shape=wider), std),
        ("10 dB less noise", known, louder),
    ]
    if known.shape.body is not None:
        changes = [c for c in changes if c[1].shape is known.shape]
    return [_median_errors(*change) for change in changes]


def _median_errors(change: str, array: KnownArray, std: float) -> Improvement:
    # Elevations near the horizon are the least certain ones of a plane array.
    height = 30.0 if "elevation" in array.shape.angles else 0.0
    every = [predicted_error(array, std, b, height, None) for b in BEARINGS_DEG]
    ranges = [farthest_range(array, std, b) or 0.0 for b in BEARINGS_DEG[::2]]
    farthest = float(np.median(ranges))
    return Improvement(
        change,
        _median([e.bearing_std_deg for e in every]),
        _median([e.elevation_std_deg for e in every]),
        farthest if farthest > 0.0 else None,
    )


def _median(values: list[float | None]) -> float | None:
    known = [math.inf if value is None else value for value in values]
    middle = float(np.median(known))
    return middle if math.isfinite(middle) else None
