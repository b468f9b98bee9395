"""Finds bins with one wave, and fits a plane wave to their phases.

A bin is one frequency at one time. If only one wave reaches an array, the covariance of
the channels over a few frames has the rank 1. Its nonzero eigenvalues are equal to
those of the matrix of products between the frames. This matrix is smaller if an array
has more microphones than there are frames. It can be computed for all groups of frames
at once.

The slowness of a wave is its direction divided by its speed. In this module, it is
relative to that of sound, so the slowness of a sound wave has the length 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape

#: Number of frames in a covariance.
GROUP_FRAMES = 4

# Least ratio of the narrowest to the widest extent of the short pairs. Only then do the
# short pairs span the array.
_LEAST_SPAN = 0.3

# Largest ratio of the lengths of two pairs that count as equally long.
_ALIKE = 1.05

# _LARGEST: largest measured slowness along the line or plane of an array. It may
#   exceed 1 because phases are noisy.
# _LEAST_LEVEL: least horizontal component of a direction, for arrays that cannot
#   measure elevations. A source with a smaller component is not level with the array.
_LARGEST, _LEAST_LEVEL = 1.08, 0.35
# Least measured slowness of an array in space, which measures all components. The true
# value is 1.
_LEAST_IN_SPACE = 0.85

# Above the frequency at which the phases of the shortest pairs wrap, all pairs together
# still determine the direction:
# - _BEYOND: largest usable frequency, as a multiple of the frequency at which phases
#   wrap.
# - _APART: least difference in slowness between two distinct directions.
# - _ALMOST: a direction is ambiguous if a distinct direction fits nearly as well,
#   within this difference of the mean cosine of the phase errors.
_BEYOND, _APART, _ALMOST = 1.3, 0.6, 0.2
# Largest phase change along the array between two neighboring guesses, rad.
_GUESS_STEP_RAD = 1.0
# Largest number of guesses. Wide arrays with short pairs need more, so their band ends
# at the frequency at which phases wrap.
_MOST_GUESSES = 4_000

# Largest root-mean-square phase error of all pairs relative to a plane wave, rad.
_LARGEST_RESIDUAL_RAD = 0.6

# Largest root-mean-square error of the path differences of a clear plane wave, as a
# share of the distances between the microphones. In rooms, the median is 0.05; if the
# channels are in a wrong order or late, it is 0.2 or more.
_CLEAR_MISFIT = 0.12


class PlaneFits(NamedTuple):
    """Directions of the bins to which a plane wave fits.

    A bin is one frequency at one time.
    """

    azimuth: NDArray[np.float64]
    """(m,) azimuths from +x toward +y, rad."""
    elevation: NDArray[np.float64]
    """(m,) elevations, rad. NaN if the array cannot measure them."""
    fits: NDArray[np.bool_]
    """(k,) True for the m of k bins to which a plane wave fits."""
    clearly: NDArray[np.bool_]
    """(k,) True for the bins whose phases are clearly those of a plane wave at the
    speed of sound. If the positions or the order of the microphones are wrong, few bins
    are."""


@dataclass(frozen=True)
class PhasePlane:
    """Fits plane waves to the phases at the microphones of an array.

    The fit starts with pairs of microphones so close together that phases do not wrap.
    To make a fit for an array, call ``PhasePlane.of``.
    """

    shape: ArrayShape
    c: float
    """Speed of sound, m/s."""
    short: NDArray[np.int64]
    """(s,) numbers of the short pairs in ``shape.pairs``."""
    wraps_hz: float
    """Frequency at which the phase along the longest of the short pairs changes by half
    a period, Hz."""
    guesses: NDArray[np.float64]
    """(g, r) initial directions for frequencies above ``wraps_hz``, as components along
    ``shape.span``. Empty if these frequencies are not used."""
    to_slowness: NDArray[np.float64]
    """(r, s) matrix that converts path differences of the short pairs, m, to components
    of the direction along ``shape.span``."""
    refine: NDArray[np.float64]
    """(r, p) matrix that converts path differences of all pairs, m, to components of
    the direction along ``shape.span``."""
    paths: NDArray[np.float64]
    """(p, r) path to the first microphone of each pair minus the path to its second
    microphone, per component of the direction, m."""

    @classmethod
    def of(cls, shape: ArrayShape, c: float) -> PhasePlane:
        """Makes the fit for an array from the shortest pairs that span the array."""
        i, j = shape.pairs.T
        paths = (shape.p_AM[j] - shape.p_AM[i]) @ shape.span.T
        for longest in np.sort(shape.distances_m):
            short = np.flatnonzero(shape.distances_m <= _ALIKE * longest)
            extent = np.linalg.svd(paths[short], compute_uv=False)
            rank = len(shape.span)
            if len(short) >= rank and extent[rank - 1] >= _LEAST_SPAN * extent[0]:
                break
        wraps_hz = 0.5 * c / float(shape.distances_m[short].max())
        return cls(
            shape=shape,
            c=c,
            short=short,
            wraps_hz=wraps_hz,
            guesses=_guesses(shape, c / (_BEYOND * wraps_hz)),
            to_slowness=np.linalg.pinv(paths[short]),
            refine=np.linalg.pinv(paths),
            paths=paths,
        )

    @property
    def highest_hz(self) -> float:
        """Highest frequency at which a wave can be fitted, Hz."""
        return _BEYOND * self.wraps_hz if len(self.guesses) else self.wraps_hz

    def fit(
        self, pattern: NDArray[np.complex128], frequency_hz: NDArray[np.float64]
    ) -> PlaneFits:
        """Fits a plane wave to each of (k, n) complex amplitudes at the n microphones.

        A common factor of the n amplitudes has no effect. The (k,) frequencies are at
        most ``highest_hz``.
        """
        i, j = self.shape.pairs.T
        phase = np.angle(pattern[:, j] * pattern[:, i].conj())
        number = (2.0 * np.pi / self.c * frequency_hz)[:, np.newaxis]
        slowness = phase[:, self.short] @ self.to_slowness.T / number
        wrapped = frequency_hz > self.wraps_hz
        clear = np.ones(len(phase), dtype=bool)
        if wrapped.any():
            slowness[wrapped], clear[wrapped] = self._guessed(
                phase[wrapped], number[wrapped, 0]
            )
        # The phases of long pairs are unwrapped with the slowness from the short pairs.
        left = phase - number * (slowness @ self.paths.T)
        left -= 2.0 * np.pi * np.rint(left / (2.0 * np.pi))
        turn = left @ self.refine.T / number
        slowness += turn
        left -= number * (turn @ self.paths.T)
        residual = np.sqrt(np.mean(left**2, axis=1))
        u, length = self._directions(slowness)
        level = np.hypot(u[:, 0], u[:, 1])
        fits = clear & (residual < _LARGEST_RESIDUAL_RAD)
        wide = np.sqrt(np.mean(self.shape.distances_m**2))
        misfit = residual / (number[:, 0] * wide)
        clearly = clear & (misfit < _CLEAR_MISFIT) & (length <= _LARGEST)
        fits &= length <= _LARGEST
        if "elevation" not in self.shape.angles:
            fits &= level >= _LEAST_LEVEL
        if self.shape.ahead is None and self.shape.dimension == 3:
            fits &= length >= _LEAST_IN_SPACE
        u = u[fits]
        elevation = np.full(len(u), np.nan)
        if "elevation" in self.shape.angles:
            elevation = np.arctan2(u[:, 2], np.hypot(u[:, 0], u[:, 1]))
        return PlaneFits(np.arctan2(u[:, 1], u[:, 0]), elevation, fits, clearly)

    def _guessed(
        self, phase: NDArray[np.float64], number: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Finds the guessed direction that fits the phases of all pairs best.

        The results are the (k, r) best guesses, and whether no clearly different guess
        fits nearly as well.
        """
        slowness = np.empty((len(phase), self.guesses.shape[1]))
        clear = np.empty(len(phase), dtype=bool)
        paths = self.paths @ self.guesses.T
        for wave_number in np.unique(number):
            mine = np.flatnonzero(number == wave_number)
            waves = np.exp(-1j * wave_number * paths)
            cosine = (np.exp(1j * phase[mine]) @ waves).real / len(paths)
            best = cosine.argmax(axis=1)
            highest = cosine[np.arange(len(mine)), best]
            others = np.where(self._apart[best], cosine, -1.0).max(axis=1)
            slowness[mine] = self.guesses[best]
            clear[mine] = others < highest - _ALMOST
        return slowness, clear

    @cached_property
    def _apart(self) -> NDArray[np.bool_]:
        """(g, g) whether two guesses are clearly different."""
        off = self.guesses[:, np.newaxis] - self.guesses
        return np.asarray(np.linalg.norm(off, axis=2) > _APART)

    def _directions(
        self, slowness: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Converts measured slownesses to directions, and returns their lengths.

        The directions are unit vectors if the component perpendicular to the array can
        be computed.
        """
        length = np.linalg.norm(slowness, axis=1)
        u = slowness @ self.shape.span
        if self.shape.ahead is not None:
            u /= np.maximum(length, 1.0)[:, np.newaxis]
            off = np.sqrt(np.maximum(0.0, 1.0 - np.minimum(length, 1.0) ** 2))
            u += off[:, np.newaxis] * self.shape.ahead
        return u, length


def _guesses(shape: ArrayShape, wavelength_m: float) -> NDArray[np.float64]:
    """Returns a (g, r) grid of directions, as components along ``shape.span``."""
    step = _GUESS_STEP_RAD * wavelength_m / (2.0 * np.pi * shape.aperture_m)
    count = int(np.ceil(2.0 / step)) + 1
    if count ** len(shape.span) > _MOST_GUESSES:
        return np.empty((0, len(shape.span)))
    axes = [np.linspace(-1.0, 1.0, count)] * len(shape.span)
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes))
    length = np.linalg.norm(grid, axis=1)
    least = 0.0 if shape.ahead is not None or shape.dimension < 3 else 1.0 - step
    return np.asarray(grid[(length <= 1.0) & (length >= least)])


def _products(spectra: NDArray[np.complex64]) -> list[NDArray[np.complex64]]:
    """Returns products of each frame with the frame m later, for m = 0, 1, 2, 3.

    Each product is summed over the channels and has the shape (frames - m, bins).
    """
    frames = len(spectra)
    return [
        np.einsum("fnb,fnb->fb", spectra[: frames - m], spectra[m:].conj())
        for m in range(GROUP_FRAMES)
    ]


def _running(values: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Returns the sums of ``size`` consecutive rows, starting at each row."""
    count = len(values) - size + 1
    return np.sum([values[k : k + count] for k in range(size)], axis=0)


def group_powers(spectra: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Computes the (g, b) power of each group of frames, summed over the channels.

    Group k consists of the frames k ... k + ``GROUP_FRAMES`` - 1 of the (f, n, b)
    spectra.
    """
    power = np.einsum("fnb->fb", spectra.real**2 + spectra.imag**2)
    return _running(power, GROUP_FRAMES)


def find_rank_one(
    spectra: NDArray[np.complex64], candidates: NDArray[np.bool_], least_ratio: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.complex128]]:
    """Finds those of the (g, b) candidate bins that contain only one wave.

    A bin is one frequency in one group of frames. The results are the (k,) numbers of
    the groups and of the frequencies of these bins, and their (k, n) dominant
    eigenvectors, with any length and phase.
    """
    products = _products(spectra)
    power = _running(products[0].real, GROUP_FRAMES)
    # Sum of the squared eigenvalues.
    squares = _running(np.abs(products[0]) ** 2, GROUP_FRAMES)
    for m in range(1, GROUP_FRAMES):
        squares += 2.0 * _running(np.abs(products[m]) ** 2, GROUP_FRAMES - m)
    # Least sum of squares at this ratio, as a share of the squared sum of the
    # eigenvalues.
    rest = GROUP_FRAMES - 1
    least = (1.0 + rest / least_ratio**2) / (1.0 + rest / least_ratio) ** 2
    group, bins = np.nonzero(candidates & (squares >= least * power**2) & (power > 0.0))
    if not len(group):
        return group, bins, np.empty((0, spectra.shape[1]), dtype=np.complex128)
    frames = group[:, np.newaxis] + np.arange(GROUP_FRAMES)
    snapshots = spectra[frames, :, bins[:, np.newaxis]].astype(np.complex128)
    gram = snapshots @ snapshots.conj().transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(gram)
    found = values[:, -1] >= least_ratio * values[:, -2]
    first = vectors[found, :, -1].conj()
    pattern = np.einsum("kf,kfn->kn", first, snapshots[found])
    return group[found], bins[found], pattern
