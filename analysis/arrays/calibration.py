"""Estimates microphone positions from sounds, with their covariance.

The estimate is the maximum a posteriori, found by Levenberg's method. Stated properties
of the array and stated positions of sounds count with their stated uncertainties. The
unknown coordinates of a sound are estimated together with the array. Each sound's
coordinates are eliminated separately. The computing time therefore grows only in
proportion to the number of sounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.calibration_sounds import MeasuredSound, check_sounds
from analysis.arrays.unknowns import ArrayUnknowns, SoundPlace
from systems.hearing.multilateration import whitening_matrix
from systems.sound.array_shape import ArrayShape

_STEPS = 200
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-12, 1e9
# The search ends if a step changes the sum of squares J by at most _SETTLED (1 + J).
_SETTLED = 1e-5

# Least squared slope for damping, as a share of the largest. The floor damps steps that
# hardly change the delays, such as those across the plane of an array.
_LEAST_SLOPE = 0.1


@dataclass(frozen=True)
class Fit:
    """Residuals and slopes of one sound, linearized about the solution.

    All delays are in standard deviations of the measured delays.
    """

    residual: NDArray[np.float64]
    """(n - 1,) measured minus expected delays."""
    by_array: NDArray[np.float64]
    """(n - 1, m) slopes of the expected delays along the array's unknowns."""
    by_place: NDArray[np.float64]
    """(n - 1, d) slopes of the expected delays along the sound's coordinates."""
    root: NDArray[np.float64]
    """(n - 1, n - 1) matrix that converts delays in s to standard deviations."""
    place: SoundPlace


@dataclass(frozen=True)
class Calibration:
    """A calibrated array of n microphones."""

    unknowns: ArrayUnknowns
    """The array as stated."""
    places: NDArray[np.float64]
    """(n, d) microphone positions in the geometry's frame, m."""
    c: float
    """Speed of sound, m/s."""
    channel_delays: NDArray[np.float64]
    """(n,) delays of the channels minus their mean, s."""
    covariance: NDArray[np.float64]
    """(n d + 1 + n, n d + 1 + n) joint covariance of microphone coordinates, speed of
    sound and channel delays, in this order."""
    information: NDArray[np.float64]
    """(m, m) Fisher information of the sounds on the scaled unknowns z."""
    z: NDArray[np.float64]
    """(m,) differences from the stated values, in stated standard deviations."""
    fits: tuple[Fit, ...]
    """One fit per sound."""
    sounds: tuple[MeasuredSound, ...]
    chi_square: float
    """Sum of squared residuals of delays, stated positions and stated geometry."""
    freedom: int
    """Degrees of freedom: the expected value of ``chi_square``."""
    settled: bool
    """Whether the search converged."""

    @property
    def of_places(self) -> NDArray[np.float64]:
        """(n d, n d) covariance of the microphone positions, m^2."""
        return self.covariance[: self.places.size, : self.places.size]

    @property
    def speed_std(self) -> float:
        """Standard deviation of the speed of sound, m/s."""
        return float(np.sqrt(self.covariance[self.places.size, self.places.size]))

    @property
    def source_positions(self) -> NDArray[np.float64]:
        """(sounds, d) in the geometry's frame, m; infinite if the range is unknown."""
        positions = [fit.place.position for fit in self.fits]
        return np.array(positions) + self.unknowns.origin


def calibrate_array(
    places: NDArray[np.float64],
    c: float,
    budget: ArrayBudget,
    sounds: Sequence[MeasuredSound],
    shape: ArrayShape | None = None,
) -> Calibration:
    """Estimates microphone positions, speed of sound, and channel delays.

    If sounds have stated positions, these and the stated (n, d) microphone positions
    ``places`` together define the coordinate frame, weighted by their uncertainties.
    Otherwise, the stated microphone positions define the frame. ``shape`` has the same
    positions and faces the sources without stated positions. By default, it is built
    from ``places``. Raises ``InputError`` if the sounds do not match the array, or if
    all uncertainties are stated as 0.
    """
    places = np.asarray(places, dtype=np.float64)
    check_sounds(places, sounds)
    unknowns = ArrayUnknowns(places, float(c), budget)
    shape = shape or ArrayShape.of(places)
    spots = [
        SoundPlace.heard(sound, shape, c, budget)
        if sound.position is None
        else SoundPlace.stated_at(sound.position - unknowns.origin, sound.position_std)
        for sound in sounds
    ]
    roots = [whitening_matrix(sound.covariance) for sound in sounds]
    z, fits, settled = _search(unknowns, sounds, roots, spots)
    information = _information(fits, z.size)
    half = np.linalg.inv(np.linalg.cholesky(np.eye(z.size) + information)).T
    found, speed, late = unknowns.values(z)
    free = sum(places.shape[1] for sound in sounds if sound.position is None)
    missing = sum(sound.missing for sound in sounds)
    return Calibration(
        unknowns=unknowns,
        places=found,
        c=speed,
        channel_delays=late,
        covariance=(unknowns.scale @ half) @ (unknowns.scale @ half).T,
        information=information,
        z=z,
        fits=tuple(fits),
        sounds=tuple(sounds),
        chi_square=_cost(z, fits),
        freedom=len(sounds) * (len(places) - 1) - free - missing,
        settled=settled,
    )


def place_weight(fit: Fit) -> NDArray[np.float64]:
    """(n - 1, n - 1) weight of a sound's residuals with its position eliminated."""
    weight = _eliminated(fit, 0.0)[0]
    return (weight + weight.T) / 2.0


def _search(
    unknowns: ArrayUnknowns,
    sounds: Sequence[MeasuredSound],
    roots: list[NDArray[np.float64]],
    spots: list[SoundPlace],
) -> tuple[NDArray[np.float64], list[Fit], bool]:
    z = np.zeros(unknowns.scale.shape[1])
    fits = _fits(unknowns, z, sounds, roots, spots)
    cost, damping = _cost(z, fits), _FIRST_DAMPING
    for _ in range(_STEPS):
        step, spots_next = _step(z, fits, damping)
        tried = _fits(unknowns, z + step, sounds, roots, spots_next)
        lower = cost - _cost(z + step, tried)
        if lower >= 0.0:
            z, fits, cost = z + step, tried, cost - lower
            damping = max(0.1 * damping, _LEAST_DAMPING)
        else:
            damping *= 10.0
        if abs(lower) <= _SETTLED * (1.0 + cost):
            return z, fits, True
        if damping > _MOST_DAMPING:
            break
    return z, fits, False


def _fits(
    unknowns: ArrayUnknowns,
    z: NDArray[np.float64],
    sounds: Sequence[MeasuredSound],
    roots: list[NDArray[np.float64]],
    spots: Sequence[SoundPlace],
) -> list[Fit]:
    fits = []
    for sound, root, spot in zip(sounds, roots, spots, strict=True):
        front, by_array = unknowns.front(z, spot.h, spot.w)
        fits.append(
            Fit(
                residual=root @ (sound.tau - front.delays),
                by_array=root @ by_array,
                by_place=root @ spot.slopes(front),
                root=root,
                place=spot,
            )
        )
    return fits


def _cost(z: NDArray[np.float64], fits: Sequence[Fit]) -> float:
    off = [float(f.place.weights @ f.place.off**2) for f in fits]
    return float(z @ z) + sum(float(f.residual @ f.residual) for f in fits) + sum(off)


def _information(fits: Sequence[Fit], size: int) -> NDArray[np.float64]:
    total = np.zeros((size, size))
    for fit in fits:
        total += fit.by_array.T @ place_weight(fit) @ fit.by_array
    return (total + total.T) / 2.0


def _eliminated(
    fit: Fit, damping: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Eliminates the d unknown coordinates of a sound from its delays.

    Returns the (n - 1, n - 1) weight of the residuals, the (d, n - 1) gain from
    residuals to the best step of the coordinates, and the (d,) step toward the expected
    coordinates.
    """
    within = fit.by_place.T @ fit.by_place
    along = np.diag(within)
    along = np.maximum(along, _LEAST_SLOPE * along.max()) + fit.place.precision
    whole = within + np.diag(fit.place.precision + damping * along)
    expected = -fit.place.weights * fit.place.off
    sides = np.column_stack((fit.by_place.T, expected))
    steps = np.asarray(np.linalg.solve(whole, sides), dtype=np.float64)
    gain, pull = steps[:, :-1], steps[:, -1]
    return np.eye(len(fit.residual)) - fit.by_place @ gain, gain, pull


def _step(
    z: NDArray[np.float64], fits: Sequence[Fit], damping: float
) -> tuple[NDArray[np.float64], list[SoundPlace]]:
    """Computes a step of the array's unknowns, and the moved sound positions."""
    hessian, slope = np.eye(z.size), -z
    parts = []
    for fit in fits:
        weight, gain, pull = _eliminated(fit, damping)
        left = weight @ fit.residual - fit.by_place @ pull
        hessian = hessian + fit.by_array.T @ weight @ fit.by_array
        slope = slope + fit.by_array.T @ left
        parts.append((gain, pull))
    hessian = hessian + damping * np.diag(np.diag(hessian))
    step = np.asarray(np.linalg.solve(hessian, slope), dtype=np.float64)
    moved = [
        fit.place.moved(gain @ (fit.residual - fit.by_array @ step) + pull)
        for fit, (gain, pull) in zip(fits, parts, strict=True)
    ]
    return step, moved
