"""From delays to a place, with only as much range as can be believed.

Range is in the small differences between a plane and a curved wave front. Two
things make such differences where there are none: a wrong speed of sound or
room reflections, which draw delays towards those of sound from all around,
namely zero; and microphones that do not stand where the geometry says. A range
is believed where it is certain in spite of both.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.recording_search import Sighting
from systems.hearing.far_field import locate_far_source
from systems.hearing.multilateration import locate_source
from systems.hearing.source_fix import SourceFix
from systems.hearing.steered_response import NEAREST_M
from systems.sound.array_shape import ArrayShape

__all__ = ["inverse_range_std", "place_source", "tolerance"]

# What is not known of the speed of sound, of the microphones' places in m, and
# the share by which reflections alone would shorten the delays.
_SPEED_TOLERANCE = 0.01
_PLACE_TOLERANCE_M = 0.0005
_REFLECTION_SHARE = 0.3

# Waves are taken as curved where that lowers the chi-square of plane ones by
# more than the first number; the range is believed from the second one on.
_CURVED, _CERTAIN = 1.0, 9.0

# Sources are rarely nearer than half a metre, nor than two apertures: deviation
# of the inverse range, 1/m, and of its product with the aperture.
_INVERSE_RANGE, _APERTURES = 1.0, 0.5

# A source nearly above a flat array has no bearing that could be told, if it
# varies by more within the tolerances.
_LARGEST_STD_RAD = math.radians(20.0)

# A place whose delays are off by more is no place: deviations of chi-square.
_MISFIT_DEVIATIONS = 5.0


def place_source(sighting: Sighting, shape: ArrayShape, c: float) -> SourceFix | None:
    """Where the sound of a stretch came from.

    Args:
        sighting: Delays and their errors.
        shape: The microphones.
        c: Speed of sound, m/s.

    Returns:
        The source; with a range where its standard deviation is below it even
        if the tolerances above are counted, which they are not in the standard
        deviations themselves. None where no place fits the delays, or where the
        bearing cannot be told.
    """
    tau, covariance = sighting.tau, sighting.covariance
    allowed = tolerance(sighting, c)
    bent = inverse_range_std(shape)
    far = locate_far_source(tau, covariance, shape, c, allowed, inverse_range_std=bent)
    near = locate_source(tau, covariance + allowed, shape, c)
    if (
        near.range_valid
        and near.range >= NEAREST_M
        and near.chi_square < _limit(shape.freedom)
        and near.chi_square < far.chi_square - _CURVED
    ):
        fix = locate_source(tau, covariance, shape, c)
        certain = near.chi_square < far.chi_square - _CERTAIN
        return fix if certain else fix.without_range()
    if shape.dimension == 2 and shape.kind == "plane":
        # A source above the plane has shorter delays than any within it.
        lifted = ArrayShape.of(np.pad(shape.p_AM, ((0, 0), (0, 1))))
        far = _level(
            locate_far_source(
                tau, covariance, lifted, c, allowed, inverse_range_std=bent
            )
        )
        within = locate_far_source(tau, covariance + allowed, lifted, c)
        if within.bearing_std > _LARGEST_STD_RAD:
            return None
    return far if far.chi_square < _limit(shape.freedom + 1) else None


def tolerance(sighting: Sighting, c: float) -> NDArray[np.float64]:
    """Covariance of delays by what is not known of the air and of the array.

    Args:
        sighting: Its n - 1 delays and its coherence.
        c: Speed of sound, m/s.

    Returns:
        (n - 1, n - 1) s^2, to be added to that from noise.
    """
    tau = sighting.tau
    shrink = _SPEED_TOLERANCE**2
    shrink += (_REFLECTION_SHARE * (1.0 - min(sighting.coherence, 1.0))) ** 2
    places = (_PLACE_TOLERANCE_M / c) ** 2 * (np.eye(len(tau)) + 1.0)
    return shrink * np.outer(tau, tau) + places


def inverse_range_std(shape: ArrayShape) -> float:
    """Of a source that was not heard yet, 1/m."""
    return min(_INVERSE_RANGE, _APERTURES / shape.aperture_m)


def _limit(freedom: int) -> float:
    """A chi-square above this is a misfit."""
    freedom = max(freedom, 1)
    return freedom + _MISFIT_DEVIATIONS * math.sqrt(2.0 * freedom)


def _level(fix: SourceFix) -> SourceFix:
    """The azimuth alone, as of a source within the plane."""
    u = np.array([math.cos(fix.bearing), math.sin(fix.bearing)])
    across = np.array([-u[1], u[0]])
    covariance = fix.bearing_std**2 * np.outer(across, across)
    return replace(
        fix, elevation=None, elevation_std=None, p_AS=u, covariance=covariance
    )
