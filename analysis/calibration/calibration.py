"""Where microphones stand, from sounds: what fits best, and how well it is known.

Maximum a posteriori by Levenberg's method. All that is stated of the array counts
with its uncertainty, and so do stated positions of sounds; what is not known of a
sound's place is worked out with it. The places of sounds are eliminated sound by
sound, so that a hundred sounds cost a hundred times as much as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import ArrayBudget
from analysis.calibration.array_unknowns import ArrayUnknowns
from analysis.calibration.measured_sound import MeasuredSound, check_sounds
from analysis.calibration.sound_places import SoundPlace
from systems.hearing.multilateration import whitening_matrix
from systems.sound.array_shape import ArrayShape

_STEPS = 200
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-12, 1e9
_SETTLED = 1e-5  # of the sum of squares, relative to it and to a single delay

# Of the steepest: damps steps along what delays hardly change with, such as across
# the plane of an array.
_LEAST_SLOPE = 0.1


@dataclass(frozen=True)
class Fit:
    """One sound about the solution, in deviations of its measured delays."""

    residual: NDArray[np.float64]
    """(n - 1,) measured less expected."""
    by_array: NDArray[np.float64]
    """(n - 1, m) slopes of what is expected along the array's unknowns."""
    by_place: NDArray[np.float64]
    """(n - 1, d) the same along those of the sound's place."""
    root: NDArray[np.float64]
    """(n - 1, n - 1) makes deviations of delays in s."""
    place: SoundPlace


@dataclass(frozen=True)
class Calibration:
    """A calibrated array of n microphones."""

    unknowns: ArrayUnknowns
    """What was stated."""
    places: NDArray[np.float64]
    """(n, d) microphones in the geometry's frame, m."""
    c: float
    """Speed of sound, m/s."""
    channel_delays: NDArray[np.float64]
    """(n,) by which channels are late, less their mean, s."""
    covariance: NDArray[np.float64]
    """(n d + 1 + n, same) joint, of places, speed of sound and channel delays."""
    information: NDArray[np.float64]
    """(m, m) that the sounds have of the unknowns, those in deviations."""
    z: NDArray[np.float64]
    """(m,) the unknowns: by how many deviations all is off what was stated."""
    fits: tuple[Fit, ...]
    """A sound each."""
    sounds: tuple[MeasuredSound, ...]
    chi_square: float
    """Of delays, stated positions and stated geometry together."""
    freedom: int
    """What chi-square is expected to be."""
    settled: bool
    """Whether the search came to an end."""

    @property
    def of_places(self) -> NDArray[np.float64]:
        """(n d, n d) covariance of the places, m^2."""
        return self.covariance[: self.places.size, : self.places.size]

    @property
    def speed_std(self) -> float:
        """Of the speed of sound, m/s."""
        return float(np.sqrt(self.covariance[self.places.size, self.places.size]))

    @property
    def source_positions(self) -> NDArray[np.float64]:
        """(sounds, d) in the geometry's frame, m; infinite without a range."""
        positions = [fit.place.position for fit in self.fits]
        return np.array(positions) + self.unknowns.origin


def calibrate_array(
    places: NDArray[np.float64],
    c: float,
    budget: ArrayBudget,
    sounds: Sequence[MeasuredSound],
    shape: ArrayShape | None = None,
) -> Calibration:
    """Refines places of microphones, speed of sound and delays of channels.

    The frame is that of the stated positions of sounds, as far as the microphones'
    stated places in it are uncertain; with no such sounds that of the places.

    Args:
        places: (n, d) stated, m.
        c: Speed of sound as stated, m/s.
        budget: What is not known of these.
        sounds: What was heard.
        shape: The same places, looking to the side of sources without positions.

    Returns:
        The array, and how well it is known.

    Raises:
        InputError: The sounds are none for this array, or all is stated as exact.
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
        freedom=len(sounds) * (len(places) - 1) - free,
        settled=settled,
    )


def place_weight(fit: Fit) -> NDArray[np.float64]:
    """(n - 1, n - 1) weight of a sound's residuals, its place being worked out."""
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
    """What a sound's place can explain, taken out of its delays.

    Returns:
        (n - 1, n - 1) weight of residuals; (d, n - 1) the best step of the place for
        a residual; and (d,) that by what was expected of the place alone.
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
    """A step of the array's unknowns, and the places that go with it."""
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
