"""Defines the estimated position of a source, and the status of its range."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape

#: Least distance of a source from the centroid of the microphones, m. A nearer source
#: is rejected.
NEAREST_M = 0.2

#: Status of a range: the audio frame has no sound.
NOTHING_HEARD = 0
#: Status: there is a range.
RANGED = 1
#: Status: the delays are those of a plane wave, so no finite range fits.
PLANE_WAVE = 2
#: Status: no position has these delays.
NO_PLACE = 3
#: Status: the error of the range is too large.
UNCERTAIN = 4
#: Status: there are too few microphones for a range in addition to the direction.
TOO_FEW_MICROPHONES = 5
#: Status: the frame has a sound, but the estimator rejects the sound.
REJECTED = 6


@register_jitable
def range_status(
    inverse_range: float,
    error: float = 0.0,
    largest_error: float = 1.0,
    enough: bool = True,  # noqa: FBT001, FBT002  # compiled code calls it by position
) -> int:
    """Returns whether the delays of a sound give a range, or why they give none.

    Args:
        inverse_range: Inverse range that fits best, 1/m. It is 0 or less for a plane
            wave, and NaN if no position has these delays.
        error: Error of the range, in any measure.
        largest_error: Limit of the error in the same measure. The range is valid if the
            error is below the limit.
        enough: Whether there are enough microphones for a range.

    Returns:
        ``RANGED``, ``PLANE_WAVE``, ``NO_PLACE``, ``UNCERTAIN`` or
        ``TOO_FEW_MICROPHONES``.
    """
    if not enough:
        return TOO_FEW_MICROPHONES
    if math.isnan(inverse_range):
        return NO_PLACE
    if inverse_range <= 0.0:
        return PLANE_WAVE
    return RANGED if error < largest_error else UNCERTAIN


@dataclass(frozen=True)
class SourceFix:
    """Estimated source relative to the centroid of the microphones, with its errors.

    The errors follow from the errors of the delays, to first order. They do not include
    the effect of errors of the microphone positions or of the speed of sound.
    """

    bearing: float
    """Azimuth in the x-y plane, CCW from +x, in (-pi, pi], rad."""
    bearing_std: float
    """Standard deviation of the bearing, rad. It is infinite if the array cannot
    measure the bearing."""
    elevation: float | None
    """Elevation from the x-y plane, rad. None for positions in a plane, and for a level
    row of microphones, which cannot measure the elevation."""
    elevation_std: float | None
    """Standard deviation of the elevation, rad. It is infinite if the array cannot
    measure the elevation."""
    range: float
    """Distance from the centroid, m; 0 if it is not valid."""
    range_status: int
    """Result of the function ``range_status``: whether there is a range, or why there
    is none."""
    range_std: float
    """Standard deviation of the range, m; infinite if the range is not valid."""
    p_AS: NDArray[np.float64]
    """(d,) position of the source relative to the centroid, m. If the range is not
    valid, it is a unit vector toward the source."""
    covariance: NDArray[np.float64]
    """(d, d) covariance of ``p_AS``, m^2. If the range is not valid, it is the
    covariance of the unit vector."""
    chi_square: float = 0.0
    """Sum of the squared residuals of the delays, whitened by the covariance of the
    delays. Its expected value is ``ArrayShape.freedom``."""
    twin: NDArray[np.float64] | None = None
    """(d,) another position that fits the delays about equally well and is no mirror
    image, m. None if there is no such position."""

    @property
    def range_valid(self) -> bool:
        """Whether the range is valid."""
        return self.range_status == RANGED

    def without_range(self) -> SourceFix:
        """Returns the same direction without the range, which is too uncertain."""
        if not self.range_valid:
            return self
        u = self.p_AS / np.linalg.norm(self.p_AS)
        across = (np.eye(u.size) - np.outer(u, u)) / np.linalg.norm(self.p_AS)
        return replace(
            self,
            range=0.0,
            range_status=UNCERTAIN,
            range_std=math.inf,
            p_AS=u,
            covariance=across @ self.covariance @ across,
        )

    def within_error(self, share: float) -> SourceFix:
        """Returns the same estimate, without its range if the range is too uncertain.

        Args:
            share: Limit of the error of the range, as a share of the range.

        Returns:
            This estimate if the error of its range is below the limit. Otherwise the
            same direction without a range.
        """
        if not self.range_valid:
            return self
        limit = share * self.range
        status = range_status(1.0 / self.range, self.range_std, limit)
        return self if status == RANGED else self.without_range()

    def mirrored(self, shape: ArrayShape) -> SourceFix | None:
        """Returns the other candidate of an ambiguous array; None if there is none."""
        if shape.ahead is None:
            return None
        flip = np.eye(shape.dimension) - 2.0 * np.outer(shape.ahead, shape.ahead)
        p_AS = flip @ self.p_AS
        return replace(
            self,
            bearing=math.atan2(p_AS[1], p_AS[0]),
            elevation=None
            if self.elevation is None
            else math.atan2(p_AS[2], math.hypot(p_AS[0], p_AS[1])),
            p_AS=p_AS,
            covariance=flip @ self.covariance @ flip.T,
            twin=None if self.twin is None else flip @ self.twin,
        )
