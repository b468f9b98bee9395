"""The unknowns of a calibration: the array, and the positions of the sounds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.calibration_sounds import MeasuredSound
from analysis.arrays.far_field import locate_far_source
from analysis.arrays.wave_fronts import WaveFront, wave_front
from systems.framework.input_error import InputError
from systems.hearing.multilateration import locate_source
from systems.sound.array_shape import ArrayShape

# A direction whose variance is below this share of the largest is taken as exact.
_EXACT = 1e-14

# An unknown source is assumed to be rarely nearer than this many apertures. This weak
# assumption hardly affects the estimate. It keeps an unobservable range finite.
_NEAREST_APERTURES = 0.1

# Least component of the initial unit vector across the array's line or plane. Within
# the line or plane, delays have zero slope across it, and the search would not start.
_LEAST_LIFT = 0.3

# Prior standard deviation of directions, which are otherwise unknown, rad.
_ANY_DIRECTION = 10.0


@dataclass(frozen=True)
class ArrayUnknowns:
    """The unknowns of an array: microphone positions, speed of sound, channel delays.

    For n microphones in d dimensions, the full vector holds n d coordinates, the speed
    of sound, and n delays. A delay that all channels share has no effect. The n delays
    therefore add up to 0. The m unknowns z are deviations from the stated values, in
    stated standard deviations.
    """

    places: NDArray[np.float64]
    """(n, d) stated microphone positions, m."""
    c: float
    """Stated speed of sound, m/s."""
    budget: ArrayBudget
    """Stated standard deviations of positions, speed of sound and delays."""

    @cached_property
    def origin(self) -> NDArray[np.float64]:
        """(d,) centroid of the microphones, m. Source positions are relative to it."""
        return np.asarray(self.places.mean(axis=0))

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        """(n d + 1 + n, m) change of the full vector per standard deviation of each z.

        Raises ``InputError`` if all uncertainties are stated as 0.
        """
        count = len(self.places)
        variances, axes = np.linalg.eigh(self.budget.of_places)
        kept = variances > _EXACT * max(float(variances[-1]), 1e-30)
        of_places = axes[:, kept] * np.sqrt(variances[kept])
        apart = np.linalg.svd(np.ones((1, count)))[2][1:].T * self.budget.delay_std
        scale = block_diag(of_places, self.budget.speed_std, apart)
        uncertain = np.any(scale != 0.0, axis=0)
        if not uncertain.any():
            raise InputError(
                "position_std_m",
                "is 0, as are all other uncertainties; state how uncertain the "
                "geometry is, for example 'position_std_m: 0.02'",
            )
        return np.compress(uncertain, scale, axis=1)

    @cached_property
    def prior_covariance(self) -> NDArray[np.float64]:
        """(n d + 1 + n, n d + 1 + n) covariance of the full vector, as stated."""
        return np.asarray(self.scale @ self.scale.T)

    def values(
        self, z: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """Converts z to (n, d) positions, speed of sound and (n,) channel delays."""
        stated = (self.places.ravel(), [self.c], np.zeros(len(self.places)))
        whole = np.concatenate(stated) + self.scale @ z
        size = self.places.size
        places = whole[:size].reshape(self.places.shape)
        return places, float(whole[size]), whole[size + 1 :]

    def front(
        self, z: NDArray[np.float64], h: NDArray[np.float64], w: float
    ) -> tuple[WaveFront, NDArray[np.float64]]:
        """Computes the delays of a source at h / w relative to ``origin``.

        The delays include those of the channels. The second result is their (n - 1, m)
        slopes along z, s.
        """
        places, c, late = self.values(z)
        front = wave_front(places - self.origin, max(c, 0.1 * self.c), h, w)
        own = np.eye(len(places))
        slopes = np.hstack(
            (front.by_places, front.by_speed[:, np.newaxis], own[1:] - own[0])
        )
        heard = front.delays + late[1:] - late[0]
        return replace(front, delays=heard), slopes @ self.scale


@dataclass(frozen=True)
class SoundPlace:
    """The position h / w of a sound's source, with its d unknowns and their prior.

    If the position was stated, the unknowns are its coordinates over their standard
    deviation. Otherwise, they are d - 1 changes of direction, in rad, and the inverse
    range over its standard deviation.
    """

    h: NDArray[np.float64]
    """(d,) position in m, or unit vector to the source, from the frame's origin."""
    w: float
    """1 for a stated position, else the inverse range, 1/m."""
    off: NDArray[np.float64]
    """(d,) unknowns minus their expected values, in standard deviations."""
    weights: NDArray[np.float64]
    """(d,) weights of ``off`` in the least squares: 1, or 0 without expectation."""
    deviation: float
    """Prior standard deviation of the coordinates, m, or of the inverse range, 1/m."""
    stated: bool
    """Whether the position was stated."""

    @classmethod
    def stated_at(cls, position: NDArray[np.float64], std: float) -> SoundPlace:
        """Makes a ``SoundPlace`` from a (d,) stated position from the origin, m."""
        return cls(
            h=position.copy(),
            w=1.0,
            off=np.zeros(position.size),
            weights=np.ones(position.size),
            deviation=std,
            stated=True,
        )

    @classmethod
    def heard(
        cls, sound: MeasuredSound, shape: ArrayShape, c: float, budget: ArrayBudget
    ) -> SoundPlace:
        """Locates a sound whose position is not stated, with the array as stated."""
        far = locate_far_source(sound.tau, sound.covariance, shape, c)
        whole = sound.covariance + budget.delay_covariance(far.p_AS, 0.0, shape, c)
        fix = locate_source(sound.tau, whole, shape, c)
        u, w = fix.p_AS / np.linalg.norm(fix.p_AS), 0.0
        if shape.ahead is not None and abs(u @ shape.ahead) < _LEAST_LIFT:
            u = u + (_LEAST_LIFT - u @ shape.ahead) * shape.ahead
        if fix.range_valid:
            w = 1.0 / max(fix.range, _NEAREST_APERTURES * shape.aperture_m)
        deviation = 1.0 / (_NEAREST_APERTURES * shape.aperture_m)
        expected = np.zeros(shape.dimension)
        expected[-1] = 1.0
        return cls(
            h=u / np.linalg.norm(u),
            w=w,
            off=expected * w / deviation,
            weights=expected,
            deviation=deviation,
            stated=False,
        )

    @property
    def precision(self) -> NDArray[np.float64]:
        """(d,) prior precisions of the unknowns."""
        return self.weights + (1.0 - self.weights) / _ANY_DIRECTION**2

    @property
    def position(self) -> NDArray[np.float64]:
        """(d,) position from the origin, m; infinite if the range is not observable."""
        return self.h / self.w if self.w > 0.0 else np.full(self.h.shape, np.inf)

    def slopes(self, front: WaveFront) -> NDArray[np.float64]:
        """(n - 1, d) slopes of the delays along the place's unknowns, s."""
        if self.stated:
            return front.by_h * self.deviation
        return np.column_stack(
            (front.by_h @ _across(self.h), front.by_w * self.deviation)
        )

    def moved(self, step: NDArray[np.float64]) -> SoundPlace:
        """Moves the place by a (d,) step of its unknowns."""
        if self.stated:
            moved_to = self.h + self.deviation * step
            return replace(self, h=moved_to, off=self.off + step)
        h = self.h + _across(self.h) @ step[:-1]
        w = self.w + self.deviation * float(step[-1])
        # An inverse range slightly below 0 stands for a plane wave.
        w = min(max(w, -0.1 * self.deviation), self.deviation)
        off = self.off.copy()
        off[-1] = w / self.deviation
        return replace(self, h=h / np.linalg.norm(h), w=w, off=off)


def _across(h: NDArray[np.float64]) -> NDArray[np.float64]:
    """(d, d - 1) orthonormal vectors perpendicular to a direction."""
    basis: NDArray[np.float64] = np.linalg.svd(h[np.newaxis])[2][1:].T
    return basis
