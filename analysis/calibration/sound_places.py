"""Where a sound was made: at a stated, uncertain position, or at an unknown one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.far_field import locate_far_source
from analysis.arrays.wave_fronts import WaveFront
from analysis.calibration.measured_sound import MeasuredSound
from systems.hearing.multilateration import locate_source
from systems.sound.array_shape import ArrayShape

# An unknown source is assumed to be rarely nearer than this many apertures. This weak
# assumption hardly affects the estimate. It keeps an unobservable range finite.
_NEAREST_APERTURES = 0.1

# Least component of the initial unit vector across the array's line or plane. Within
# the line or plane, delays have zero slope across it, and the search would not start.
_LEAST_LIFT = 0.3

# Prior standard deviation of directions, which are otherwise unknown, rad.
_ANY_DIRECTION = 10.0


@dataclass(frozen=True)
class SoundPlace:
    """The position of a sound's source, with its d unknowns and their prior.

    The position is h / w. The unknowns depend on whether the position was stated:

    - If stated, they are the d coordinates over their standard deviation.
    - If not stated, they are d - 1 changes of direction, in rad, and the inverse range
      over its standard deviation.
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
        """Makes a ``SoundPlace`` from a stated position.

        Args:
            position: (d,) position relative to the frame's origin, m.
            std: Standard deviation of each coordinate, m.

        Returns:
            The place at the stated position.
        """
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
        """Makes the initial ``SoundPlace`` of a sound whose position is not stated.

        Args:
            sound: The measured delays.
            shape: The array as stated.
            c: Stated speed of sound, m/s.
            budget: Uncertainties of the array and of the speed of sound.

        Returns:
            The place as located by the array as stated.
        """
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
