"""Where a source is, as an array of microphones hears it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape

#: A source nearer than this to the centroid is not believed, m.
NEAREST_M = 0.2

#: Statuses of a range. The frame has no sound.
NOTHING_HEARD = 0
#: There is a range.
RANGED = 1
#: The delays are those of a plane wave: no finite range fits.
PLANE_WAVE = 2
#: No place has these delays.
NO_PLACE = 3
#: The error of the range is too large.
UNCERTAIN = 4
#: A range is one unknown too many for the number of microphones.
TOO_FEW_MICROPHONES = 5
#: The frame has a sound, but the estimator rejects it.
REJECTED = 6


@register_jitable
def range_status(
    inverse_range: float,
    error: float = 0.0,
    largest_error: float = 1.0,
    enough: bool = True,  # noqa: FBT001, FBT002  # compiled code calls it by position
) -> int:
    """Whether the delays of a sound have a range, or why they have none.

    Args:
        inverse_range: The best fit, 1/m: 0 or less for a plane wave, NaN if no place
            has these delays.
        error: Of the range, in any measure.
        largest_error: Errors from this one on are too large, in the same measure.
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
    """A source seen from the microphones' centroid, with first-order errors.

    The errors count those of the delays alone, not those of the microphones'
    places or of the speed of sound.
    """

    bearing: float
    """Azimuth in the x-y plane, CCW from +x, in (-pi, pi], rad."""
    bearing_std: float
    """rad; infinity where the array cannot tell."""
    elevation: float | None
    """From the x-y plane, rad; None for positions in the plane and for a level
    row, which cannot tell."""
    elevation_std: float | None
    """rad; infinity where the array cannot tell."""
    range: float
    """m; 0 where it is not valid."""
    range_status: int
    """Whether there is a range, or why there is none, see ``range_status``."""
    range_std: float
    """m; infinity where the range is not valid."""
    p_AS: NDArray[np.float64]
    """(d,) m; of unit length where the range is not valid."""
    covariance: NDArray[np.float64]
    """(d, d) of p_AS, m^2; of the unit vector where the range is not valid."""
    chi_square: float = 0.0
    """Squares of the delays' residuals over their errors. Where the geometry is
    right it has ``ArrayShape.freedom`` as its mean."""
    twin: NDArray[np.float64] | None = None
    """(d,) another place, no mirror image, that fits as well, m."""

    @property
    def range_valid(self) -> bool:
        """Whether there is a range."""
        return self.range_status == RANGED

    def without_range(self) -> SourceFix:
        """The same direction alone, for a range that is too uncertain."""
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
        """The same, without its range if that is too uncertain.

        Args:
            share: The error of the range has to be below this share of it.

        Returns:
            This one, or one without a range.
        """
        if not self.range_valid:
            return self
        limit = share * self.range
        status = range_status(1.0 / self.range, self.range_std, limit)
        return self if status == RANGED else self.without_range()

    def mirrored(self, shape: ArrayShape) -> SourceFix | None:
        """The other candidate of an ambiguous array; None if there is none."""
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
