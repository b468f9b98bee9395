"""Where a source is, as an array of microphones hears it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from systems.sound.array_shape import ArrayShape

#: A source nearer than this to the centroid is not believed, m.
NEAREST_M = 0.2


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
    range_valid: bool
    """Whether the delays have a finite range, and one above its own error."""
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

    def without_range(self) -> SourceFix:
        """The same direction alone, for a range that is too uncertain."""
        if not self.range_valid:
            return self
        u = self.p_AS / np.linalg.norm(self.p_AS)
        across = (np.eye(u.size) - np.outer(u, u)) / np.linalg.norm(self.p_AS)
        return replace(
            self,
            range=0.0,
            range_valid=False,
            range_std=math.inf,
            p_AS=u,
            covariance=across @ self.covariance @ across,
        )

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
