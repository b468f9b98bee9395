"""Holds the estimates of a located source over time, and their summary."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.heard_sources import HeardSource, HeardSources
from analysis.arrays.recording_search import MAD_TO_STD
from analysis.arrays.source_placement import PlacedSource
from analysis.report.provenance import SCHEMA_VERSION
from systems.sound.array_shape import ArrayShape

# Estimates within this angle of the most common direction belong to one source, deg.
_NEAR_DEG = 15.0

# Least error that counts in a weighted median, as a share of the median error.
_LEAST_ERROR = 0.3


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

    @classmethod
    def of(cls, t_s: float, placed: PlacedSource) -> SourceEstimate:
        """Makes an estimate from a source position. Unmeasurable values become None.

        Args:
            t_s: Middle of the stretch, s from the start of the recording.
            placed: Source position in the frame of the array, m, and its errors.

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
        )


@dataclass(frozen=True, repr=False)
class LocatedSource:
    """Estimates for the stretches of a recording in which a source was heard."""

    array: dict[str, Any]
    """Geometry, frequency band and sample rate in use."""
    shape: ArrayShape
    """The microphones."""
    estimates: list[SourceEstimate]
    """Estimates in the order of time."""
    frames: int
    """Number of stretches of the recording. Each stretch has at most one estimate."""
    faults: list[ChannelFault] = field(default_factory=list)
    """Faults of the channels."""
    heard: HeardSources = field(default_factory=HeardSources)
    """All sources in the recording, and their tracks."""
    largest_range_error: float = 0.2
    """Largest standard deviation of a reported range, as a share of the range."""

    def __repr__(self) -> str:
        heard = f"{len(self.estimates)} of {self.frames} stretches heard"
        return f"<{type(self).__name__} {self.shape.count} microphones, {heard}>"

    def main_source(self) -> dict[str, Any]:
        """Summarizes the main source by medians, and lists what could not be measured.

        The estimates of the main source are the following:

        - If most estimates are near a source in ``heard.sources``, they are the
          estimates near the source that has the most estimates.
        - Otherwise, if most estimates are near one common direction, they are the
          estimates near this direction.
        - Otherwise, they are all estimates.

        Returns:
            Values by name. A value is None if it could not be measured.
        """
        main = _main_source(self.estimates, self.heard.sources)
        bearing, bearing_std = _median_angle(
            [(e.bearing_deg, e.bearing_std_deg) for e in main]
        )
        elevation, elevation_std = _median(
            [(e.elevation_deg, e.elevation_std_deg) for e in main]
        )
        ranges = [(e.range_m, e.range_std_m) for e in main if e.range_m is not None]
        # The summary has a range only if at least half of the estimates have one.
        enough = 2 * len(ranges) >= len(main)
        range_m, range_std = _median(ranges if enough else [])
        if (range_std or 0.0) > self.largest_range_error * (range_m or 0.0):
            range_m = range_std = None
        told = {"bearing": bearing, "elevation": elevation, "range": range_m}
        return {
            "bearing_deg": bearing,
            "bearing_std_deg": bearing_std,
            "bearing_systematic_deg": _usual([e.bearing_systematic_deg for e in main]),
            "elevation_deg": elevation,
            "elevation_std_deg": elevation_std,
            "elevation_systematic_deg": _usual(
                [e.elevation_systematic_deg for e in main]
            ),
            "range_m": range_m,
            "range_std_m": range_std,
            "range_systematic_m": _usual(
                [] if range_m is None else [e.range_systematic_m for e in main]
            ),
            "number_of_sources": self.number_of_sources,
            "observable": [name for name, value in told.items() if value is not None],
            "ambiguity": self.shape.ambiguity,
            "alternatives": self._alternatives(bearing, elevation),
            "frames": self.frames,
            "frames_heard": len(self.estimates),
            "frames_of_main_source": len(main),
            "faults": [asdict(fault) for fault in self.faults],
        }

    @property
    def number_of_sources(self) -> int | None:
        """Number of sources in the recording, or None if it is unknown.

        It is unknown in three cases: the sound is steady, the recording is too short,
        or the array cannot measure bearings.
        """
        count = len(self.heard.sources)
        return None if self.heard.steady or (self.estimates and not count) else count

    def _alternatives(
        self, bearing: float | None, elevation: float | None
    ) -> list[dict[str, float | None]]:
        """Returns the direction with the same delays on the other side of the array."""
        ahead = self.shape.ahead
        if ahead is None or bearing is None or self.shape.ambiguity == "none":
            return []
        azimuth, height = math.radians(bearing), math.radians(elevation or 0.0)
        level = math.cos(height)
        u = np.array(
            [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(height)]
        )[: ahead.size]
        u -= 2.0 * (u @ ahead) * ahead
        other = math.degrees(math.atan2(u[1], u[0]))
        return [
            {
                "bearing_deg": wrapped_deg(other),
                "elevation_deg": None
                if elevation is None
                else math.degrees(math.atan2(u[2], math.hypot(u[0], u[1]))),
            }
        ]

    def document(self) -> dict[str, Any]:
        """Returns the JSON document that the command line writes."""
        return {
            "schema_version": SCHEMA_VERSION,
            "array": self.array,
            "estimates": [asdict(estimate) for estimate in self.estimates],
            "summary": self.main_source(),
            "sources": [asdict(source) for source in self.heard.sources],
            "tracks": [asdict(track) for track in self.heard.tracks],
        }


def _main_source(
    estimates: list[SourceEstimate], sources: Sequence[HeardSource]
) -> list[SourceEstimate]:
    if not estimates:
        return []
    azimuth = np.radians([e.bearing_deg or 0.0 for e in estimates])
    height = np.radians([e.elevation_deg or 0.0 for e in estimates])
    # If the array measures both angles, elevations are much less certain than azimuths.
    upright = estimates[0].bearing_deg is None
    known = np.radians([] if upright else [s.bearing_deg for s in sources])
    near = _near(known, azimuth)
    if 2 * np.count_nonzero(near.any(axis=0)) < len(estimates):
        angles = height if upright else azimuth
        near = _near(angles, angles)
        if 2 * near.sum(axis=1).max() < len(estimates):
            return estimates
    commonest = near[int(near.sum(axis=1).argmax())]
    return [e for e, chosen in zip(estimates, commonest, strict=True) if chosen]


def _near(
    directions: NDArray[np.float64], angles: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Returns whether each angle is within 15 deg of each direction, both in rad.

    The shape is (directions, angles).
    """
    off = np.angle(np.exp(1j * (angles - directions[:, np.newaxis])))
    return np.asarray(np.abs(off) <= math.radians(_NEAR_DEG))


def _median(
    estimates: Sequence[tuple[float | None, float | None]],
) -> tuple[float | None, float | None]:
    """Returns the weighted median of values, and the error of a single value.

    Each estimate is a value and its standard deviation. The weight of a value is
    the inverse square of its error. A larger number of values does not reduce the error
    of the result, because the values may have a common error. The error is the scatter
    of the values around the median, or the median of their standard deviations,
    whichever is larger.
    """
    rows = [row for row in estimates if row[0] is not None and row[1] is not None]
    if not rows:
        return None, None
    values, errors = np.array(rows, dtype=np.float64).T
    weights = 1.0 / np.maximum(errors, _LEAST_ERROR * np.median(errors)) ** 2
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    center = float(np.interp(0.5 * weights.sum(), below, values[order]))
    scatter = MAD_TO_STD * float(np.median(np.abs(values - center)))
    return center, max(scatter, float(np.median(errors)))


def _usual(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def _median_angle(
    estimates: Sequence[tuple[float | None, float | None]],
) -> tuple[float | None, float | None]:
    """Computes ``_median`` of angles in deg, wrapped around their mean direction."""
    known = [row for row in estimates if row[0] is not None]
    mean = sum(cmath.exp(1j * math.radians(angle or 0.0)) for angle, _ in known)
    center = math.degrees(cmath.phase(mean))
    offset, scatter = _median(
        [(wrapped_deg((angle or 0.0) - center), error) for angle, error in known]
    )
    return None if offset is None else wrapped_deg(center + offset), scatter


def wrapped_deg(angle: float) -> float:
    """Returns an angle wrapped to (-180, 180], deg."""
    return 180.0 - (180.0 - angle) % 360.0
