"""Holds the estimated position of a source in one stretch of a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from analysis.arrays.place_medians import wrapped_deg
from analysis.arrays.source_placement import PlacedSource


@dataclass(frozen=True)
class SourceEstimate:
    """Estimated source position for one stretch of time, in the geometry's frame."""

    t_s: float
    """Middle of the stretch, s from the start of the recording."""
    bearing_deg: float | None
    """Azimuth from the centroid of the microphones, CCW from +x, in (-180, 180], deg.
    None for an upright row of microphones, which cannot measure the azimuth."""
    bearing_std_deg: float | None
    """Standard deviation of the bearing, deg. It includes noise, scattered reflections
    and errors of the array."""
    bearing_systematic_deg: float | None
    """Part of the standard deviation from errors of the array, deg. These errors are
    the same in all estimates."""
    elevation_deg: float | None
    """Elevation from the x-y plane, deg. None if the array cannot measure it.
    Microphones in a row and positions without a z coordinate cannot."""
    elevation_std_deg: float | None
    """Standard deviation of the elevation, deg."""
    elevation_systematic_deg: float | None
    """Part of the standard deviation of the elevation from errors of the array, deg."""
    range_m: float | None
    """Distance from the centroid of the microphones, m. None if the delays do not
    determine it."""
    range_std_m: float | None
    """Standard deviation of the range, m."""
    range_systematic_m: float | None
    """Part of the standard deviation of the range from errors of the array, m."""
    position_m: tuple[float, ...] | None = None
    """Position (x, y) or (x, y, z) in the frame of the geometry file, m. None if there
    is no range."""
    position_covariance_m2: tuple[tuple[float, ...], ...] | None = None
    """Covariance of the position, including the errors of the array, m^2."""

    @classmethod
    def of(
        cls,
        t_s: float,
        placed: PlacedSource,
        centroid_m: tuple[float, ...] | None = None,
    ) -> SourceEstimate:
        """Makes an estimate from a source position. Unmeasurable values become None.

        Args:
            t_s: Middle of the stretch, s from the start of the recording.
            placed: Source position in the frame of the array, m, and its errors.
            centroid_m: Centroid of the microphones, m. None: zero.

        Returns:
            The estimate, with angles in deg and the range in m.
        """
        fix, systematic = placed.fix, placed.systematic

        def degrees(angle: float | None, std: float | None) -> float | None:
            if angle is None or std is None or not math.isfinite(std):
                return None
            return math.degrees(angle)

        bearing = degrees(fix.bearing, fix.bearing_std)
        ranged = fix.range_valid
        origin = np.array(centroid_m or np.zeros(fix.p_AS.size))
        return cls(
            t_s=t_s,
            bearing_deg=None if bearing is None else wrapped_deg(bearing),
            bearing_std_deg=degrees(fix.bearing_std, fix.bearing_std),
            bearing_systematic_deg=degrees(systematic.bearing_std, fix.bearing_std),
            elevation_deg=degrees(fix.elevation, fix.elevation_std),
            elevation_std_deg=degrees(fix.elevation_std, fix.elevation_std),
            elevation_systematic_deg=degrees(
                systematic.elevation_std, fix.elevation_std
            ),
            range_m=fix.range if ranged else None,
            range_std_m=fix.range_std if ranged else None,
            range_systematic_m=systematic.range_std if ranged else None,
            position_m=tuple((fix.p_AS + origin).tolist()) if ranged else None,
            position_covariance_m2=tuple(map(tuple, fix.covariance.tolist()))
            if ranged
            else None,
        )
