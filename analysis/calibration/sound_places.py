"""Where a sound was made: a place with its own uncertainty, or not known at all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.far_field import locate_far_source
from analysis.calibration.measured_sound import MeasuredSound
from analysis.calibration.wave_fronts import WaveFront
from systems.hearing.multilateration import locate_source
from systems.sound.array_shape import ArrayShape

# An unknown source is rarely nearer than this share of the aperture: so weak that
# it tells nothing, yet it keeps a range that cannot be heard from running away.
_NEAREST_APERTURES = 0.1

# In the line or plane of an array delays do not change with the direction across it:
# a search begins this far off, of a unit vector.
_LEAST_LIFT = 0.3

# Directions that an array cannot hear are as uncertain, rad.
_ANY_DIRECTION = 10.0


@dataclass(frozen=True)
class SoundPlace:
    """A place h / w, its d unknowns, and what was known of them before.

    The unknowns are those of a step: metres over their deviation where a position is
    stated, else directions across h, in rad, and the inverse range over its own.
    """

    h: NDArray[np.float64]
    """(d,) the place in m, or a unit vector to it, from the frame's origin."""
    w: float
    """1 of a stated place, else the inverse range, 1/m."""
    off: NDArray[np.float64]
    """(d,) unknowns less what was expected of them, in deviations."""
    weights: NDArray[np.float64]
    """(d,) of ``off`` in the least squares: 1, or 0 where nothing was expected."""
    deviation: float
    """Of a stated place's coordinates, m, or of the inverse range, 1/m."""
    stated: bool

    @classmethod
    def stated_at(cls, position: NDArray[np.float64], std: float) -> SoundPlace:
        """A place that was measured.

        Args:
            position: (d,) in the frame, m.
            std: Of each coordinate, m.

        Returns:
            The place as stated.
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
        """A place of which nothing is known but what is heard.

        Args:
            sound: Its delays.
            shape: The array as stated.
            c: Speed of sound as stated, m/s.
            budget: What is not known of both.

        Returns:
            The place that the array as stated would report.
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
        """(d,) of the unknowns before anything was heard."""
        return self.weights + (1.0 - self.weights) / _ANY_DIRECTION**2

    @property
    def position(self) -> NDArray[np.float64]:
        """(d,) m from the origin; infinite where the range cannot be told."""
        return self.h / self.w if self.w > 0.0 else np.full(self.h.shape, np.inf)

    def slopes(self, front: WaveFront) -> NDArray[np.float64]:
        """(n - 1, d) of the delays along the unknowns."""
        if self.stated:
            return front.by_h * self.deviation
        return np.column_stack(
            (front.by_h @ _across(self.h), front.by_w * self.deviation)
        )

    def moved(self, step: NDArray[np.float64]) -> SoundPlace:
        """The place after a step of its (d,) unknowns."""
        if self.stated:
            moved_to = self.h + self.deviation * step
            return replace(self, h=moved_to, off=self.off + step)
        h = self.h + _across(self.h) @ step[:-1]
        w = self.w + self.deviation * float(step[-1])
        # An inverse range of little less than 0 is a wave that is not curved.
        w = min(max(w, -0.1 * self.deviation), self.deviation)
        off = self.off.copy()
        off[-1] = w / self.deviation
        return replace(self, h=h / np.linalg.norm(h), w=w, off=off)


def _across(h: NDArray[np.float64]) -> NDArray[np.float64]:
    """(d, d - 1) orthonormal vectors across a direction."""
    basis: NDArray[np.float64] = np.linalg.svd(h[np.newaxis])[2][1:].T
    return basis
