"""Checks delays that a user measured, and leaves out those that are impossible."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.body_delays import free_air_delays
from systems.framework.input_error import InputError

# Longest possible delay, as a multiple of the travel time between two microphones. On a
# rigid body, sound takes up to 1.5 times as long as through free air.
_LONGEST = 1.5

# Errors of a delay and of positions that are still possible, in standard deviations.
_DEVIATIONS = 4.0

# Error of a delay that is still possible if its covariance is unknown, as a share of
# the longest travel time in the array.
_UNKNOWN_SHARE = 0.25

# Standard deviation of a delay that was left out, as a multiple of the longest travel
# time in the array. It makes the weight of the delay negligible.
_NO_WEIGHT = 30.0

# Least number of channels that give a direction.
_LEAST_CHANNELS = 3

# Tolerance for the symmetry and the eigenvalues of a covariance, as a share of its
# largest variance.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class GivenSound:
    """Delays of one sound at n microphones."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0, s. Delays that were left out are 0."""
    noise: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays as given, s^2. If none was given, it is
    that of arrival times with a standard deviation of 1 s."""
    blank: NDArray[np.float64]
    """(n - 1, n - 1) very large covariance of the delays that were left out, s^2."""
    left_out: tuple[int, ...] = ()
    """Microphones that were left out, from 0."""

    @property
    def usable(self) -> bool:
        """Whether at least three microphones are left."""
        return len(self.tau) + 1 - len(self.left_out) >= _LEAST_CHANNELS

    def covariance(self, scale: float = 1.0) -> NDArray[np.float64]:
        """Returns the covariance for standard deviations ``scale`` times as large."""
        return scale**2 * self.noise + self.blank


def given_sounds(
    delays: ArrayLike, covariance: ArrayLike | None, array: KnownArray
) -> list[GivenSound]:
    """Checks the delays of k sounds, and leaves out impossible delays.

    A delay is impossible if it is not finite, or longer than sound can travel between
    the two microphones.

    Args:
        delays: (n - 1,) or (k, n - 1) delays t_k - t_0, s.
        covariance: (n - 1, n - 1) covariance for all sounds, or (k, n - 1, n - 1), s^2.
            None if it is unknown.
        array: The n microphones.

    Returns:
        The sounds.

    Raises:
        InputError: An array has a wrong shape, or the covariance is none.
    """
    tau = _delays(delays, array.shape.count)
    size = tau.shape[1]
    if covariance is None:
        each = np.broadcast_to(np.eye(size) + 1.0, (len(tau), size, size))
    else:
        each = _covariances(covariance, tau)
    known = covariance is not None
    pairs = zip(tau, each, strict=True)
    return [_possible(row, own, array, known=known) for row, own in pairs]


def _delays(delays: ArrayLike, count: int) -> NDArray[np.float64]:
    try:
        tau = np.array(delays, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("delays", "are not numbers; give delays in s") from None
    if tau.ndim in (1, 2) and tau.shape[-1] == count:
        raise InputError(
            "delays",
            f"have {count} values a sound for {count} microphones; give the delays "
            "after microphone 0, for example times[1:] - times[0]",
        )
    if tau.ndim not in (1, 2) or tau.shape[-1] != count - 1 or not tau.size:
        raise InputError(
            "delays",
            f"have the shape {tau.shape}; {count} microphones need ({count - 1},), or "
            f"(sounds, {count - 1})",
        )
    return np.atleast_2d(tau)


def _covariances(
    covariance: ArrayLike, tau: NDArray[np.float64]
) -> NDArray[np.float64]:
    sounds, size = tau.shape
    try:
        given = np.array(covariance, dtype=np.float64)
    except (TypeError, ValueError):
        given = np.empty(0)
    if given.shape not in ((size, size), (sounds, size, size)):
        raise InputError(
            "covariance",
            f"has the shape {given.shape}; give ({size}, {size}) for all sounds, or "
            f"({sounds}, {size}, {size}), in s^2",
        )
    if not np.isfinite(given).all():
        raise InputError("covariance", "is not finite; give numbers in s^2")
    scale = max(float(np.abs(given).max()), 1e-30)
    if np.abs(given - np.swapaxes(given, -1, -2)).max() > _ROUNDING * scale:
        raise InputError("covariance", "is not symmetric; give a covariance in s^2")
    if np.linalg.eigvalsh(given).min() < -_ROUNDING * scale:
        raise InputError(
            "covariance", "has a negative variance; give a covariance in s^2"
        )
    return np.broadcast_to(given, (sounds, size, size))


def _possible(
    tau: NDArray[np.float64],
    covariance: NDArray[np.float64],
    array: KnownArray,
    *,
    known: bool,
) -> GivenSound:
    """Leaves out the fewest channels, so that all other delays are possible."""
    shape = array.shape
    arrival = np.concatenate(([0.0], tau))
    travel = np.linalg.norm(shape.p_AM[:, None] - shape.p_AM, axis=2) / array.c
    if known:
        of_times = np.pad(covariance, ((1, 0), (1, 0)))
        own = np.diag(of_times)
        variance = own[:, None] + own - 2.0 * of_times
    else:
        variance = np.full(travel.shape, (_UNKNOWN_SHARE * travel.max()) ** 2)
    budget = array.budget
    variance = variance + 2.0 * (
        (budget.position_std / array.c) ** 2 + budget.delay_std**2
    )
    limit = _LONGEST * travel + _DEVIATIONS * np.sqrt(np.maximum(variance, 0.0))
    with np.errstate(invalid="ignore"):
        wrong = ~(np.abs(arrival[:, None] - arrival) <= limit)
    left_out = tuple(sorted(_worst(wrong)))
    none = (_NO_WEIGHT * shape.max_delay(array.c)) ** 2
    blank = np.zeros(covariance.shape)
    kept = np.setdiff1d(np.arange(shape.count), left_out)
    if kept.size:
        arrival -= arrival[0 if 0 in kept else kept].mean()
    arrival[list(left_out)] = 0.0
    for k in left_out:
        if k:
            blank[k - 1, k - 1] += none
        else:
            blank += none
    tau = arrival[1:] - arrival[0]
    tau = free_air_delays(tau, covariance + blank, shape, array.c)
    return GivenSound(tau, covariance, blank, left_out)


def _worst(wrong: NDArray[np.bool_]) -> Iterator[int]:
    """Yields the channel with the most wrong pairs until no wrong pair remains."""
    wrong = wrong.copy()
    while wrong.any():
        # Of equals, the later channel: the delays of channel 0 are the reference.
        k = len(wrong) - 1 - int(np.argmax(wrong.sum(axis=1)[::-1]))
        yield k
        wrong[k], wrong[:, k] = False, False
