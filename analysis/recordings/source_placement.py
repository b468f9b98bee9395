"""From delays to a place, with only as much range as the geometry supports.

Range is in the small differences between a plane and a curved wave front. What is
not known of the array and of the air makes such differences where there are none, and
so do reflections. All three weigh the delays and count in the errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.far_field import locate_far_source
from analysis.arrays.range_posterior import FARTHEST_M, range_posterior
from analysis.recordings.aligned_delays import AlignedDelays
from analysis.recordings.array_geometry import KnownArray
from systems.hearing.multilateration import angles_of, locate_source
from systems.hearing.source_fix import NEAREST_M, SourceFix
from systems.sound.array_shape import ArrayShape

# Reflections move each channel by its own, for each part that is not coherent by
# this share of what sound takes along the array, or of the time within which an
# echo cannot be told apart. From simulated rooms.
_REFLECTED_SHARE = 0.015
_UNRESOLVED_S = 2e-4

# Waves are taken as curved where that lowers the chi-square of plane ones by more.
_CURVED = 1.0

# Ranges with errors beyond so many times the largest are not looked at more closely.
_HOPELESS = 2.0

# Sources may be beyond the farthest range, unless nearer by so many deviations.
_CERTAINLY = 2.0

# What the budget makes of delays depends on the place, and hardly so.
_ROUNDS = 2

# Sources are rarely nearer than half a metre, nor than two apertures: deviation
# of the inverse range, 1/m, and of its product with the aperture.
_INVERSE_RANGE, _APERTURES = 1.0, 0.5

# Directions that vary by more are none: of a source nearly above a flat array, or
# where microphones may stand anywhere.
_LARGEST_STD_RAD = math.radians(20.0)

# A place whose delays are off by more is no place: deviations of chi-square.
_MISFIT_DEVIATIONS = 5.0


@dataclass(frozen=True)
class PlacedSource:
    """A source, and which part of its errors no average makes smaller."""

    fix: SourceFix
    """With all errors: noise, reflections and the array's budget."""
    systematic: SourceFix
    """The same place with the errors of the budget alone."""


def place_source(delays: AlignedDelays, array: KnownArray) -> PlacedSource | None:
    """Where the sound of a stretch came from.

    Args:
        delays: Of the channels, with their errors.
        array: The microphones and their budget.

    Returns:
        The source; with a range where its standard deviation is at most the share
        of it that the array names. None where no place fits the delays, or where
        the budget supports no bearing.
    """
    placed = _placed(delays, array)
    # An upright row has no bearing at all, and tells the elevation.
    if placed and _LARGEST_STD_RAD < placed.fix.bearing_std < math.inf:
        return None
    return placed


def has_place(delays: AlignedDelays, array: KnownArray) -> bool:
    """Whether some place fits the delays, be its bearing ever so uncertain.

    Args:
        delays: Of the channels, with their errors.
        array: The microphones and their budget.

    Returns:
        False where the delays belong to no place at all.
    """
    return _placed(delays, array) is not None


def _placed(delays: AlignedDelays, array: KnownArray) -> PlacedSource | None:
    tau, shape, c = delays.tau, array.shape, array.c
    own = delays.covariance + _reflections(delays, array)
    bent = _inverse_range_std(shape)
    lying = shape.dimension == 2 and shape.kind == "plane"
    u = _direction(tau, own, array)
    far = locate_far_source(
        tau, own + _budget(u, 0.0, array), shape, c, inverse_range_std=bent
    )
    near, allowed = _near(tau, own, u, array)
    if (
        near.range_valid
        and near.range >= NEAREST_M
        and near.chi_square < _limit(shape.freedom)
        and near.chi_square < far.chi_square - _CURVED
    ):
        ranged = _marginal(near, tau, own, array)
        farthest = ranged.range + _CERTAINLY * ranged.range_std
        told = (
            ranged.range_std <= array.largest_range_error * ranged.range
            and farthest < FARTHEST_M
        )
        near = ranged if told else near
        systematic = _of_budget(near, own + allowed, allowed, shape, c)
        if not told:
            near, systematic = near.without_range(), systematic.without_range()
        return PlacedSource(near, systematic)
    allowed = _budget(u, 0.0, array)
    if lying:
        # A source above the plane has shorter delays than any within it.
        shape = ArrayShape.of(np.pad(shape.p_AM, ((0, 0), (0, 1))))
    far = locate_far_source(tau, own + allowed, shape, c, inverse_range_std=bent)
    systematic = locate_far_source(tau, allowed, shape, c, own)
    if lying:
        far, systematic = _level(far), _level(systematic)
    freedom = shape.freedom + (0 if lying else 1)
    fits = far.chi_square < _limit(freedom)
    return PlacedSource(far, systematic) if fits else None


def _direction(
    tau: NDArray[np.float64], own: NDArray[np.float64], array: KnownArray
) -> NDArray[np.float64]:
    """(d,) towards the source, as if it were far away."""
    shape = array.shape
    allowed = (array.budget.position_std / array.c) ** 2 * (
        np.eye(shape.count - 1) + 1.0
    )
    for _ in range(_ROUNDS):
        u = locate_far_source(tau, own + allowed, shape, array.c).p_AS
        allowed = _budget(u, 0.0, array)
    return u


def _near(
    tau: NDArray[np.float64],
    own: NDArray[np.float64],
    u: NDArray[np.float64],
    array: KnownArray,
) -> tuple[SourceFix, NDArray[np.float64]]:
    """The place at a finite range, and what the budget does to the delays there."""
    allowed = _budget(u, 0.0, array)
    for _ in range(_ROUNDS):
        near = locate_source(tau, own + allowed, array.shape, array.c)
        if not near.range_valid:
            break
        allowed = _budget(near.p_AS / near.range, 1.0 / near.range, array)
    return locate_source(tau, own + allowed, array.shape, array.c), allowed


def _marginal(
    near: SourceFix,
    tau: NDArray[np.float64],
    own: NDArray[np.float64],
    array: KnownArray,
) -> SourceFix:
    """The source at a range that counts all places, where one may be believed."""
    if near.range_std > _HOPELESS * array.largest_range_error * near.range:
        return near
    shape, w = array.shape, 1.0 / near.range
    at = range_posterior(
        tau,
        own,
        shape,
        array.budget,
        array.c,
        start=(near.p_AS * w, w, near.range_std * w * w),
        nearest_m=NEAREST_M,
    )
    across = (np.eye(at.u.size) - np.outer(at.u, at.u)) / at.range
    of_u = across @ at.covariance @ across
    bearing_std, elevation, elevation_std = angles_of(at.u, of_u, shape)
    return replace(
        near,
        bearing=math.atan2(at.u[1], at.u[0]),
        bearing_std=bearing_std,
        elevation=elevation,
        elevation_std=elevation_std,
        range=at.range,
        range_std=at.range_std,
        p_AS=at.range * at.u,
        covariance=at.covariance,
    )


def _budget(u: NDArray[np.float64], w: float, array: KnownArray) -> NDArray[np.float64]:
    return array.budget.delay_covariance(u, w, array.shape, array.c)


def _of_budget(
    near: SourceFix,
    whole: NDArray[np.float64],
    allowed: NDArray[np.float64],
    shape: ArrayShape,
    c: float,
) -> SourceFix:
    """The same place with the errors that a part of the delays' errors makes."""
    to_microphones = near.p_AS - shape.p_AM
    to_microphones /= np.linalg.norm(to_microphones, axis=1, keepdims=True)
    slopes = (to_microphones[1:] - to_microphones[0]) / c
    gain = near.covariance @ np.linalg.solve(whole, slopes).T
    of_p = gain @ allowed @ gain.T
    u = near.p_AS / near.range
    across = (np.eye(u.size) - np.outer(u, u)) / near.range
    bearing_std, _, elevation_std = angles_of(u, across @ of_p @ across, shape)
    return replace(
        near,
        bearing_std=bearing_std,
        elevation_std=elevation_std,
        range_std=math.sqrt(max(float(u @ of_p @ u), 0.0)),
        covariance=of_p,
    )


def _reflections(delays: AlignedDelays, array: KnownArray) -> NDArray[np.float64]:
    """(n - 1, n - 1) s^2 of delays by reflections that are alike in all bands."""
    share = _REFLECTED_SHARE * (1.0 - min(delays.coherence, 1.0))
    moved = share * min(array.shape.max_delay(array.c), _UNRESOLVED_S)
    return moved**2 * (np.eye(len(delays.tau)) + 1.0)


def tolerance(delays: AlignedDelays, array: KnownArray) -> NDArray[np.float64]:
    """Covariance of delays by all but noise, for a source far away.

    Args:
        delays: n - 1 of them, with their coherence.
        array: The microphones and their budget.

    Returns:
        (n - 1, n - 1) s^2, to be added to that from noise.
    """
    reflected = _reflections(delays, array)
    u = _direction(delays.tau, delays.covariance + reflected, array)
    return reflected + _budget(u, 0.0, array)


def _inverse_range_std(shape: ArrayShape) -> float:
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
