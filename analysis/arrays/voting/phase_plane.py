"""A plane wave fitted to the phases that one frequency has at the microphones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape

# Short pairs span the array if their narrowest extent is this share of their widest.
_LEAST_SPAN = 0.3

# Pairs that are longer by less than this are as long.
_ALIKE = 1.05

#: Sound along an array's line or plane may seem slower or faster by this share: phases
#: are noisy. Lower: nearly overhead, where a bearing means nothing.
_LARGEST, _LEAST_LEVEL = 1.08, 0.35
# An array in space measures all of the slowness, which sound has.
_LEAST_IN_SPACE = 0.85

# Beyond where phases of the shortest pairs wrap, all pairs together still tell where a
# wave is from, up to this many times that frequency; but for directions that differ by
# more than so much of the slowness and fit nearly as well: a mean cosine of the phases.
_BEYOND, _APART, _ALMOST = 1.3, 0.6, 0.2
# Guesses are so near to each other, in phase along the array, rad.
_GUESS_STEP_RAD = 1.0
# Wide arrays with short pairs would need more: they end where phases wrap.
_MOST_GUESSES = 4_000

# Largest phase by which pairs may be off the plane wave, RMS over all pairs, rad.
_LARGEST_RESIDUAL_RAD = 0.6


class PlaneFits(NamedTuple):
    """Directions of those bins that a plane wave fits."""

    azimuth: NDArray[np.float64]
    """(m,) rad, from +x towards +y."""
    elevation: NDArray[np.float64]
    """(m,) rad; NaN where the array does not tell it."""
    fits: NDArray[np.bool_]
    """(k,) which of the bins those are."""


@dataclass(frozen=True)
class PhasePlane:
    """Pairs of an array that are short enough for their phases not to wrap.

    Make one by ``PhasePlane.of``.
    """

    shape: ArrayShape
    c: float
    """Speed of sound, m/s."""
    short: NDArray[np.int64]
    """(s,) which of ``shape.pairs`` they are."""
    wraps_hz: float
    """Where sound along the longest of them turns by half a period, Hz."""
    guesses: NDArray[np.float64]
    """(g, r) directions, along ``shape.span``, to begin with above that; none: the
    array is not used there."""
    to_slowness: NDArray[np.float64]
    """(r, s) along ``shape.span``, from the paths between short pairs."""
    refine: NDArray[np.float64]
    """(r, p) the same from all pairs."""
    paths: NDArray[np.float64]
    """(p, r) path to each pair's first microphone less that to its second one, for
    each component of the direction, m."""

    @classmethod
    def of(cls, shape: ArrayShape, c: float) -> PhasePlane:
        """The shortest pairs that span what the array spans.

        Args:
            shape: The microphones.
            c: Speed of sound, m/s.

        Returns:
            What fits plane waves to them.
        """
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
        """Up to which waves can be fitted, Hz."""
        return _BEYOND * self.wraps_hz if len(self.guesses) else self.wraps_hz

    def fit(
        self, pattern: NDArray[np.complex128], frequency_hz: NDArray[np.float64]
    ) -> PlaneFits:
        """Directions of plane waves.

        Args:
            pattern: (k, n) what the channels have in common, up to any factor.
            frequency_hz: (k,) Hz, up to ``highest_hz``.

        Returns:
            Those that a plane wave fits.
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
        # The long pairs' phases are taken as near as they can be to the short ones'.
        left = _wrapped(phase - number * (slowness @ self.paths.T))
        turn = left @ self.refine.T / number
        slowness += turn
        left -= number * (turn @ self.paths.T)
        residual = np.sqrt(np.mean(left**2, axis=1))
        u, length = self._directions(slowness)
        level = np.hypot(u[:, 0], u[:, 1])
        fits = clear & (residual < _LARGEST_RESIDUAL_RAD)
        fits &= (length <= _LARGEST) & (level >= _LEAST_LEVEL)
        if self.shape.ahead is None and self.shape.dimension == 3:
            fits &= length >= _LEAST_IN_SPACE
        u = u[fits]
        elevation = np.full(len(u), np.nan)
        if "elevation" in self.shape.angles:
            elevation = np.arctan2(u[:, 2], np.hypot(u[:, 0], u[:, 1]))
        return PlaneFits(np.arctan2(u[:, 1], u[:, 0]), elevation, fits)

    def _guessed(
        self, phase: NDArray[np.float64], number: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(k, r) guesses that fit best, and (k,) where no other fits nearly as well."""
        slowness = np.empty((len(phase), self.guesses.shape[1]))
        clear = np.empty(len(phase), dtype=bool)
        apart = np.linalg.norm(self.guesses[:, np.newaxis] - self.guesses, axis=2)
        apart = apart > _APART
        paths = self.paths @ self.guesses.T
        for wave_number in np.unique(number):
            mine = np.flatnonzero(number == wave_number)
            waves = np.exp(-1j * wave_number * paths)
            cosine = (np.exp(1j * phase[mine]) @ waves).real / len(paths)
            best = cosine.argmax(axis=1)
            highest = cosine[np.arange(len(mine)), best]
            others = np.where(apart[best], cosine, -1.0).max(axis=1)
            slowness[mine] = self.guesses[best]
            clear[mine] = others < highest - _ALMOST
        return slowness, clear

    def _directions(
        self, slowness: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Directions (k, d), and (k,) how long the slowness is that is measured.

        The directions have unit length where that is known.
        """
        length = np.linalg.norm(slowness, axis=1)
        u = slowness @ self.shape.span
        if self.shape.ahead is not None:
            u /= np.maximum(length, 1.0)[:, np.newaxis]
            off = np.sqrt(np.maximum(0.0, 1.0 - np.minimum(length, 1.0) ** 2))
            u += off[:, np.newaxis] * self.shape.ahead
        return u, length


def _guesses(shape: ArrayShape, wavelength_m: float) -> NDArray[np.float64]:
    """(g, r) slownesses side by side, all that sound from afar may have."""
    step = _GUESS_STEP_RAD * wavelength_m / (2.0 * np.pi * shape.aperture_m)
    count = int(np.ceil(2.0 / step)) + 1
    if count ** len(shape.span) > _MOST_GUESSES:
        return np.empty((0, len(shape.span)))
    axes = [np.linspace(-1.0, 1.0, count)] * len(shape.span)
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes))
    length = np.linalg.norm(grid, axis=1)
    least = 0.0 if shape.ahead is not None or shape.dimension < 3 else 1.0 - step
    return np.asarray(grid[(length <= 1.0) & (length >= least)])


def _wrapped(phase: NDArray[np.float64]) -> NDArray[np.float64]:
    return phase - 2.0 * np.pi * np.rint(phase / (2.0 * np.pi))
