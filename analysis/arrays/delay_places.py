"""Locates sounds from delays that a user measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.stats import chi2, norm, t as student

from analysis.arrays.aligned_delays import AlignedDelays
from analysis.arrays.array_geometry import ArrayGeometry, KnownArray
from analysis.arrays.far_field import locate_far_source
from analysis.arrays.given_delays import GivenSound, given_sounds
from analysis.arrays.place_medians import wrapped_deg
from analysis.arrays.source_placement import PlacedSource, place_source
from systems.framework.input_error import InputError
from systems.hearing.multilateration import locate_source
from systems.hearing.source_fix import SourceFix
from systems.sound.array_shape import ArrayShape

# The errors of delays are raised if chance exceeds their chi-square with less than this
# probability.
_CHANCE = 1e-3

# The misfit of a single sound counts up to the chi-square that chance exceeds with this
# probability.
_LEAST_CHANCE = 1e-4

# Least and largest standard deviation of arrival times that is searched for, s.
_LEAST_S, _LARGEST_S = 1e-10, 1.0

# Largest factor of stated standard deviations that is searched for.
_LARGEST_FACTOR = 1e6

# Largest number of sounds from which the common error of the delays is estimated.
_MOST_SOUNDS = 64

# Probability within two standard deviations of a Gaussian.
_TWO_SIGMA = float(norm.cdf(2.0) - norm.cdf(-2.0))

_IMPOSSIBLE = (
    "the delays are longer than sound can travel between the microphones; check that "
    "they are in s and the positions in m, and the order of the microphones"
)
_UNCERTAIN = (
    "the delays leave the direction uncertain by more than 20 deg; measure them, or "
    "the positions of the microphones, more exactly"
)


@dataclass(frozen=True, kw_only=True)
class DelayDirection:
    """A direction, or a position, that explains the delays of a sound."""

    bearing_deg: float | None = None
    """Azimuth from the centroid of the microphones, CCW from +x, in (-180, 180], deg.
    None if the array cannot measure it."""
    elevation_deg: float | None = None
    """Elevation from the x-y plane, deg. None if the array cannot measure it."""
    range_m: float | None = None
    """Distance from the centroid of the microphones, m. None if the delays do not
    determine it."""
    direction: tuple[float, ...] | None = None
    """(d,) unit vector from the centroid of the microphones to the source."""
    position_m: tuple[float, ...] | None = None
    """(d,) position of the source in the frame of the microphones' positions, m. None
    if the range is not known."""


@dataclass(frozen=True, kw_only=True)
class DelayEstimate(DelayDirection):
    """Direction or position of one sound, with its errors."""

    bearing_std_deg: float | None = None
    """Standard deviation of the bearing, deg."""
    bearing_systematic_deg: float | None = None
    """Part of it from errors of the array and the air, deg."""
    elevation_std_deg: float | None = None
    """Standard deviation of the elevation, deg."""
    elevation_systematic_deg: float | None = None
    """Part of it from errors of the array and the air, deg."""
    range_std_m: float | None = None
    """Standard deviation of the range, m."""
    range_systematic_m: float | None = None
    """Part of it from errors of the array and the air, m."""
    covariance: NDArray[np.float64] | None = None
    """(d, d) covariance of the position, m^2. Without a range, it is the covariance of
    the unit vector ``direction``."""
    alternatives: tuple[DelayDirection, ...] = ()
    """Other directions or positions that explain the delays about equally well."""
    chi_square: float | None = None
    """Sum of the squared residuals in standard deviations, with the errors as given."""
    freedom: int = 0
    """Degrees of freedom: the expected value of ``chi_square``."""
    error_scale: float = 1.0
    """Factor by which the given standard deviations of the delays were raised, because
    no place explains the delays within them. 1 if they were not raised."""
    left_out: tuple[int, ...] = ()
    """Microphones, from 0, whose delays are missing or impossible."""
    reason: str = ""
    """Why there is no result; empty if there is one."""


@dataclass(frozen=True)
class DelayPlaces:
    """Located sounds."""

    geometry: ArrayGeometry
    """The microphones."""
    estimates: tuple[DelayEstimate, ...]
    """One estimate per sound."""
    arrival_std_s: float | None
    """Standard deviation of the arrival times, estimated from the misfit of the delays,
    s. None if the covariance was given."""


def delay_places(
    delays: ArrayLike, geometry: ArrayGeometry, covariance: ArrayLike | None
) -> DelayPlaces:
    """Locates sounds from their delays; see ``phonotaxis.locate_delays``."""
    array = geometry.known
    sounds = given_sounds(delays, covariance, array)
    common, widened, std = 1.0, 1.0, None
    if covariance is None:
        std, freedom = common_arrival_std(sounds, array)
        common, widened = std, _widening(freedom)
    elif _misfit_in_common(sounds, array):
        common, freedom = _common_scale(sounds, array, 1.0, _LARGEST_FACTOR)
        widened = _widening(freedom)
    origin = np.mean(np.array(geometry.microphones), axis=0)
    estimates = tuple(
        _estimate(sound, array, origin, common, widened, stated=std is None)
        for sound in sounds
    )
    return DelayPlaces(geometry, estimates, std)


def common_arrival_std(
    sounds: Sequence[GivenSound], array: KnownArray
) -> tuple[float, int]:
    """Estimates the standard deviation of independent arrival times from the misfit.

    Returns the value, s, and its degrees of freedom. Raises ``InputError`` if the
    delays do not determine it.
    """
    if not _telling(sounds, array):
        unknowns = _solid(array.shape).unknowns
        raise InputError(
            "covariance",
            f"is needed: {array.shape.count} microphones have too few delays to show "
            f"their errors ({unknowns + 2} would do); give for example "
            "'std**2 * (np.eye(n - 1) + 1)' with the standard deviation of an arrival "
            "time in s",
        )
    return _common_scale(sounds, array, _LEAST_S, _LARGEST_S)


def _telling(sounds: Sequence[GivenSound], array: KnownArray) -> list[GivenSound]:
    """Returns some of the sounds whose delays show their errors."""
    usable = [s for s in sounds if s.usable and _freedom(s, array) > 0]
    return usable[:: max(-(-len(usable) // _MOST_SOUNDS), 1)]


def _misfit_in_common(sounds: Sequence[GivenSound], array: KnownArray) -> bool:
    """Returns whether most sounds fit worse than chance explains."""
    chosen = _telling(sounds, array)
    freedom = [_freedom(sound, array) for sound in chosen]
    # A single sound counts little, even if its errors are gross.
    most = chi2.isf(_LEAST_CHANCE, freedom)
    misfits = [_chi_square(sound, array, 1.0) for sound in chosen]
    total = float(np.minimum(misfits, most).sum())
    return bool(chosen) and bool(chi2.sf(total, sum(freedom)) < _CHANCE)


def _common_scale(
    sounds: Sequence[GivenSound], array: KnownArray, low: float, high: float
) -> tuple[float, int]:
    """Estimates the scale of the errors that all sounds have in common.

    With it, half of the sounds fit as well as half of all sounds should. A few sounds
    with gross errors therefore have little effect. Returns the scale, between ``low``
    and ``high``, and its degrees of freedom.
    """
    chosen = _telling(sounds, array)
    expected = [chi2.median(_freedom(sound, array)) for sound in chosen]

    def excess(log_std: float) -> float:
        ratios = [
            _chi_square(sound, array, math.exp(log_std)) / middle
            for sound, middle in zip(chosen, expected, strict=True)
        ]
        return float(np.median(ratios)) - 1.0

    log_std = _root(excess, low, high)
    return math.exp(log_std), sum(_freedom(sound, array) for sound in chosen)


def _root(excess: Callable[[float], float], low: float, high: float) -> float:
    """Finds the logarithm at which a falling function is 0, between two values."""
    start, end = math.log(low), math.log(high)
    if excess(start) <= 0.0:
        return start
    if excess(end) >= 0.0:
        return end
    return float(brentq(excess, start, end, xtol=0.01))


def _widening(freedom: int) -> float:
    """Factor for an error that was estimated with few degrees of freedom (Student)."""
    return float(student.ppf(0.5 + 0.5 * _TWO_SIGMA, freedom)) / 2.0


def _solid(shape: ArrayShape) -> ArrayShape:
    """Returns the array in space; sources are rarely exactly in a plane."""
    if shape.dimension == 2 and shape.kind == "plane":
        return ArrayShape.of(np.pad(shape.p_AM, ((0, 0), (0, 1))))
    return shape


def _freedom(sound: GivenSound, array: KnownArray) -> int:
    return _solid(array.shape).freedom - len(sound.left_out)


def _chi_square(sound: GivenSound, array: KnownArray, scale: float) -> float:
    """Computes the misfit of the best position or direction for a scale of errors."""
    own, shape, c = sound.covariance(scale), _solid(array.shape), array.c
    flat = array.shape.dimension
    allowed = (array.budget.position_std / c) ** 2 * (np.eye(len(sound.tau)) + 1.0)
    far = locate_far_source(sound.tau, own + allowed, shape, c)
    u = far.p_AS[:flat] / max(float(np.linalg.norm(far.p_AS[:flat])), 1e-9)
    allowed = array.budget.delay_covariance(u, 0.0, array.shape, c)
    far = locate_far_source(sound.tau, own + allowed, shape, c)
    near = locate_source(sound.tau, own + allowed, shape, c)
    if not near.range_valid:
        return far.chi_square
    return min(far.chi_square, near.chi_square)


def _estimate(
    sound: GivenSound,
    array: KnownArray,
    origin: NDArray[np.float64],
    common: float,
    widened: float,
    *,
    stated: bool,
) -> DelayEstimate:
    if not sound.usable:
        return DelayEstimate(left_out=sound.left_out, reason=_IMPOSSIBLE)
    freedom = _freedom(sound, array)
    misfit = _chi_square(sound, array, common)
    factor = 1.0
    if freedom > 0 and chi2.sf(misfit, freedom) < _CHANCE:

        def excess(log_factor: float) -> float:
            scaled = common * math.exp(log_factor)
            return _chi_square(sound, array, scaled) / freedom - 1.0

        factor = math.exp(_root(excess, 1.0, _LARGEST_FACTOR)) * _widening(freedom)
    scale = common * max(factor, widened)
    aligned = AlignedDelays(sound.tau, sound.covariance(scale), 1.0)
    placed = place_source(aligned, array)
    if placed is None:
        return DelayEstimate(left_out=sound.left_out, reason=_UNCERTAIN)
    raised = scale if stated else factor
    if stated and common > 1.0:
        misfit = _chi_square(sound, array, 1.0)
    return _told(placed, sound, array.shape, origin, misfit, freedom, raised)


def _told(
    placed: PlacedSource,
    sound: GivenSound,
    shape: ArrayShape,
    origin: NDArray[np.float64],
    misfit: float,
    freedom: int,
    factor: float,
) -> DelayEstimate:
    fix, systematic = placed.fix, placed.systematic
    others = [] if shape.side is not None else [fix.mirrored(shape)]
    if fix.twin is not None:
        others.append(_moved(fix, fix.twin))
    ranged = fix.range_valid
    return DelayEstimate(
        **vars(_direction(fix, origin)),
        bearing_std_deg=_degrees(fix.bearing_std),
        bearing_systematic_deg=_degrees(systematic.bearing_std),
        elevation_std_deg=_degrees(fix.elevation_std),
        elevation_systematic_deg=_degrees(systematic.elevation_std),
        range_std_m=fix.range_std if ranged else None,
        range_systematic_m=systematic.range_std if ranged else None,
        covariance=fix.covariance,
        alternatives=tuple(_direction(o, origin) for o in others if o is not None),
        chi_square=misfit,
        freedom=max(freedom, 0),
        error_scale=factor,
        left_out=sound.left_out,
    )


def _moved(fix: SourceFix, p_AS: NDArray[np.float64]) -> SourceFix:
    height = None if fix.elevation is None else math.atan2(p_AS[2], np.hypot(*p_AS[:2]))
    return replace(
        fix,
        bearing=math.atan2(p_AS[1], p_AS[0]),
        elevation=height,
        range=float(np.linalg.norm(p_AS)),
        p_AS=p_AS,
    )


def _direction(fix: SourceFix, origin: NDArray[np.float64]) -> DelayDirection:
    u = fix.p_AS / np.linalg.norm(fix.p_AS)
    known = math.isfinite(fix.bearing_std)
    high = fix.elevation_std is not None and math.isfinite(fix.elevation_std)
    return DelayDirection(
        bearing_deg=wrapped_deg(math.degrees(fix.bearing)) if known else None,
        elevation_deg=math.degrees(fix.elevation or 0.0) if high else None,
        range_m=fix.range if fix.range_valid else None,
        direction=tuple(float(x) for x in u),
        position_m=tuple(float(x) for x in fix.p_AS + origin)
        if fix.range_valid
        else None,
    )


def _degrees(std: float | None) -> float | None:
    return math.degrees(std) if std is not None and math.isfinite(std) else None
