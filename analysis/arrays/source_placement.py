"""Estimates a source position from delays, with a range only if the array supports it.

The range follows from the small difference between a plane and a curved wave front.
Three kinds of errors cause similar differences: errors of the array, errors of the
speed of sound, and reflections. All three determine the weights of the delays and are
part of the reported errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.aligned_delays import AlignedDelays
from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.far_field import locate_far_source
from analysis.arrays.range_posterior import farthest_m, range_posterior
from systems.hearing.multilateration import angles_of, locate_source
from systems.hearing.source_fix import NEAREST_M, SourceFix
from systems.sound.array_shape import ArrayShape

# _REFLECTED_SHARE: error from reflections, for each part of the sound that is not
#   coherent. The error is a share of the travel time along the array or of
#   _UNRESOLVED_S, whichever is shorter. Each channel has its own error. The value is
#   from simulated rooms.
# _UNRESOLVED_S: time within which an echo cannot be separated from the direct sound, s.
_REFLECTED_SHARE = 0.015
_UNRESOLVED_S = 2e-4

# Least reduction of chi-square for curved waves instead of plane waves.
_CURVED = 1.0

# Largest error of a range that is worth a closer computation, as a multiple of the
# largest range error to report.
_HOPELESS = 2.0

# A range is reported only if it is below the farthest range by this many standard
# deviations.
_CERTAINLY = 2.0

# Number of iterations. The effect of the array's errors on the delays depends slightly
# on the source position.
_ROUNDS = 2

# _INVERSE_RANGE: prior standard deviation of the inverse range, 1/m. Sources are rarely
#   nearer than 0.5 m.
# _APERTURES: prior standard deviation of the inverse range times the aperture. Sources
#   are rarely nearer than two apertures.
_INVERSE_RANGE, _APERTURES = 1.0, 0.5

# Largest standard deviation of a reported bearing, rad. It is exceeded by a source
# nearly above a flat array, or if the microphone positions are unknown.
_LARGEST_STD_RAD = math.radians(20.0)

# Largest misfit of the delays of a source position, in standard deviations of
# chi-square.
_MISFIT_DEVIATIONS = 5.0


@dataclass(frozen=True)
class PlacedSource:
    """A source position with its total errors and with its systematic errors.

    Averaging over time does not reduce the systematic errors.
    """

    fix: SourceFix
    """Source position with all errors: noise, reflections, and errors of the array."""
    systematic: SourceFix
    """The same source position with the errors of the array and the air only."""


def place_source(delays: AlignedDelays, array: KnownArray) -> PlacedSource | None:
    """Estimates the position of the source of a sound.

    A range is given if its standard deviation is at most the share
    ``largest_range_error`` of the range. The result is None if no position fits the
    delays, or if the bearing is too uncertain.
    """
    placed = _placed(delays, array)
    # An upright row cannot measure the bearing, but it measures the elevation.
    if placed and _LARGEST_STD_RAD < placed.fix.bearing_std < math.inf:
        return None
    return placed


def has_place(delays: AlignedDelays, array: KnownArray) -> bool:
    """Returns whether some source position fits the delays, however uncertain."""
    return _placed(delays, array) is not None


def _placed(delays: AlignedDelays, array: KnownArray) -> PlacedSource | None:
    tau, shape, c = delays.tau, array.shape, array.c
    own = delays.covariance + _reflections(delays, array)
    bent = min(_INVERSE_RANGE, _APERTURES / shape.aperture_m)
    lying = shape.dimension == 2 and shape.kind == "plane"
    plane = _plane_errors(tau, own, array)
    far = locate_far_source(tau, own + plane, shape, c, inverse_range_std=bent)
    near, allowed = _near(tau, own, plane, array)
    # The delays at a body are known for distant sources only.
    if (
        shape.body is None
        and near.range_valid
        and near.range >= NEAREST_M
        and near.chi_square < chi_square_limit(shape.freedom)
        and near.chi_square < far.chi_square - _CURVED
    ):
        ranged = _marginal(near, tau, own, array)
        farthest = ranged.range + _CERTAINLY * ranged.range_std
        told = (
            ranged.range_std <= array.largest_range_error * ranged.range
            and farthest < farthest_m(shape.aperture_m)
        )
        near = ranged if told else near
        systematic = _of_budget(near, own + allowed, allowed, shape, c)
        if not told:
            near, systematic = near.without_range(), systematic.without_range()
        return PlacedSource(near, systematic)
    if lying:
        # The delays of a source above the plane are shorter than those of any source in
        # it.
        shape = ArrayShape.of(np.pad(shape.p_AM, ((0, 0), (0, 1))))
        far = locate_far_source(tau, own + plane, shape, c, inverse_range_std=bent)
    systematic = locate_far_source(tau, plane, shape, c, own)
    if lying:
        far, systematic = _level(far), _level(systematic)
    freedom = shape.freedom + (0 if lying else 1)
    fits = far.chi_square < chi_square_limit(freedom)
    return PlacedSource(far, systematic) if fits else None


def _plane_errors(
    tau: NDArray[np.float64], own: NDArray[np.float64], array: KnownArray
) -> NDArray[np.float64]:
    """Returns the covariance of the array's delay errors for a distant source, s^2."""
    shape = array.shape
    allowed = (array.budget.position_std / array.c) ** 2 * (
        np.eye(shape.count - 1) + 1.0
    )
    for _ in range(_ROUNDS):
        u = locate_far_source(tau, own + allowed, shape, array.c).p_AS
        allowed = _budget(u, 0.0, array)
    return allowed


def _near(
    tau: NDArray[np.float64],
    own: NDArray[np.float64],
    allowed: NDArray[np.float64],
    array: KnownArray,
) -> tuple[SourceFix, NDArray[np.float64]]:
    """Estimates a position at a finite range, and the array's delay errors for it.

    The search begins with the delay errors ``allowed``.
    """
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
    """Averages the range over all likely source positions.

    If the range is too uncertain to report, the position stays as it is.
    """
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
    """Returns a position with the errors from the part ``allowed`` of delay errors."""
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
    """Returns the covariance of delay errors from reflections, (n - 1, n - 1) s^2.

    These errors are the same in all frequency bands.
    """
    share = _REFLECTED_SHARE * (1.0 - min(delays.coherence, 1.0))
    moved = share * min(array.shape.max_delay(array.c), _UNRESOLVED_S)
    return moved**2 * (np.eye(len(delays.tau)) + 1.0)


def tolerance(delays: AlignedDelays, array: KnownArray) -> NDArray[np.float64]:
    """Computes the (n - 1, n - 1) covariance of all delay errors except noise, s^2.

    It holds for a distant source, and is to be added to the covariance of the noise.
    """
    reflected = _reflections(delays, array)
    own = delays.covariance + reflected
    return reflected + _plane_errors(delays.tau, own, array)


def chi_square_limit(freedom: int) -> float:
    """Returns the largest chi-square of delays that fit a source position."""
    freedom = max(freedom, 1)
    return freedom + _MISFIT_DEVIATIONS * math.sqrt(2.0 * freedom)


def _level(fix: SourceFix) -> SourceFix:
    u = np.array([math.cos(fix.bearing), math.sin(fix.bearing)])
    across = np.array([-u[1], u[0]])
    covariance = fix.bearing_std**2 * np.outer(across, across)
    return replace(
        fix, elevation=None, elevation_std=None, p_AS=u, covariance=covariance
    )
