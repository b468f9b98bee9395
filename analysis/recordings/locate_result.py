"""What was located in a recording: estimates over time, and their summary."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.channel_faults import ChannelFault
from analysis.recordings.heard_sources import HeardSource, HeardSources
from analysis.recordings.source_placement import PlacedSource
from systems.sound.array_shape import ArrayShape

# Estimates this near to the commonest direction are of one source, deg.
_NEAR_DEG = 15.0

# In a median no error counts as less than this share of the usual one.
_LEAST_ERROR = 0.3

# Of normally distributed values, standard deviation over median deviation.
_TO_STANDARD = 1.4826


@dataclass(frozen=True)
class SourceEstimate:
    """Where the sound of a stretch of time came from, in the geometry's frame."""

    t_s: float
    """Middle of the stretch, s from the start of the recording."""
    bearing_deg: float | None
    """Azimuth from the microphones' centroid, CCW from +x, in (-180, 180].
    None: an upright row of microphones cannot tell."""
    bearing_std_deg: float | None
    """Its standard deviation: noise, scattered reflections, errors of the array."""
    bearing_systematic_deg: float | None
    """The part of that by errors of the array, alike in all estimates."""
    elevation_deg: float | None
    """From the x-y plane. None: positions in the plane or a row cannot tell."""
    elevation_std_deg: float | None
    """Its standard deviation."""
    elevation_systematic_deg: float | None
    """The part of that by errors of the array."""
    range_m: float | None
    """Distance from the centroid; None where it cannot be told."""
    range_std_m: float | None
    """Its standard deviation."""
    range_systematic_m: float | None
    """The part of that by errors of the array."""

    @classmethod
    def of(cls, t_s: float, placed: PlacedSource) -> SourceEstimate:
        """From a place; what the array cannot tell becomes None.

        Args:
            t_s: Middle of the stretch, s from the start of the recording.
            placed: Place in the array's frame, m, with its errors.

        Returns:
            Angles in deg, range in m.
        """
        fix, systematic = placed.fix, placed.systematic
        bearing = math.isfinite(fix.bearing_std)
        elevation = fix.elevation_std is not None and math.isfinite(fix.elevation_std)
        return cls(
            t_s=t_s,
            bearing_deg=_wrapped_deg(math.degrees(fix.bearing)) if bearing else None,
            bearing_std_deg=math.degrees(fix.bearing_std) if bearing else None,
            bearing_systematic_deg=(
                math.degrees(systematic.bearing_std) if bearing else None
            ),
            elevation_deg=math.degrees(fix.elevation or 0.0) if elevation else None,
            elevation_std_deg=(
                math.degrees(fix.elevation_std or 0.0) if elevation else None
            ),
            elevation_systematic_deg=(
                math.degrees(systematic.elevation_std or 0.0) if elevation else None
            ),
            range_m=fix.range if fix.range_valid else None,
            range_std_m=fix.range_std if fix.range_valid else None,
            range_systematic_m=systematic.range_std if fix.range_valid else None,
        )


@dataclass(frozen=True, repr=False)
class LocateResult:
    """Estimates of the stretches in which a source was heard."""

    array: dict[str, Any]
    """Geometry, band and rate that were used."""
    shape: ArrayShape
    """The microphones."""
    estimates: list[SourceEstimate]
    """In order of time."""
    frames: int
    """Stretches of the recording, of which each may have an estimate."""
    faults: list[ChannelFault] = field(default_factory=list)
    """Channels that are not as they should be."""
    heard: HeardSources = field(default_factory=HeardSources)
    """All sources over the recording, and their tracks."""
    largest_range_error: float = 0.2
    """Ranges are given up to this standard deviation over range."""

    def __repr__(self) -> str:
        heard = f"{len(self.estimates)} of {self.frames} stretches heard"
        return f"<LocateResult {self.shape.count} microphones, {heard}>"

    def summary(self) -> dict[str, Any]:
        """Medians over the estimates of the main source, and what is not told.

        The main source is the one of ``heard.sources`` that most estimates are near;
        where most are near none of them, that of the commonest direction: the
        estimates near it, or all of them where most are not near any one direction.
        """
        main = _main_source(self.estimates, self.heard.sources)
        bearing, bearing_std = _median_angle(
            [(e.bearing_deg, e.bearing_std_deg) for e in main]
        )
        elevation, elevation_std = _median(
            [(e.elevation_deg, e.elevation_std_deg) for e in main]
        )
        ranges = [(e.range_m, e.range_std_m) for e in main if e.range_m is not None]
        # A range that few frames give is no property of the recording.
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
        """How many were heard; None where that is not told.

        It is not of a steady sound, of too short a recording, and by an array that
        tells no bearings.
        """
        count = len(self.heard.sources)
        return None if self.heard.steady or (self.estimates and not count) else count

    def _alternatives(
        self, bearing: float | None, elevation: float | None
    ) -> list[dict[str, float | None]]:
        """The other side of a row or plane."""
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
                "bearing_deg": _wrapped_deg(other),
                "elevation_deg": None
                if elevation is None
                else math.degrees(math.atan2(u[2], math.hypot(u[0], u[1]))),
            }
        ]

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command line."""
        return {
            "schema_version": 1,
            "array": self.array,
            "estimates": [asdict(estimate) for estimate in self.estimates],
            "summary": self.summary(),
            "sources": [asdict(source) for source in self.heard.sources],
            "tracks": [asdict(track) for track in self.heard.tracks],
        }


def _main_source(
    estimates: list[SourceEstimate], sources: Sequence[HeardSource]
) -> list[SourceEstimate]:
    """The estimates near the main source; all, where most are near no direction."""
    if not estimates:
        return []
    azimuth = np.radians([e.bearing_deg or 0.0 for e in estimates])
    height = np.radians([e.elevation_deg or 0.0 for e in estimates])
    # Elevations are far less certain than azimuths, where there are both.
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
    """(d, e) which angles are near which directions, all in rad."""
    off = np.angle(np.exp(1j * (angles - directions[:, np.newaxis])))
    return np.asarray(np.abs(off) <= math.radians(_NEAR_DEG))


def _median(
    estimates: Sequence[tuple[float | None, float | None]],
) -> tuple[float | None, float | None]:
    """Median of values with errors, and the error of a single one.

    Values count by their errors, as in a mean. Their error is the scatter about
    the median, or what is usually stated, whichever is larger: a few values
    that agree say little, and what they have in common nothing. None, None
    where there are no values.
    """
    rows = [row for row in estimates if row[0] is not None and row[1] is not None]
    if not rows:
        return None, None
    values, errors = np.array(rows, dtype=np.float64).T
    weights = 1.0 / np.maximum(errors, _LEAST_ERROR * np.median(errors)) ** 2
    centre = _weighted_median(values, weights)
    scatter = _TO_STANDARD * float(np.median(np.abs(values - centre)))
    return centre, max(scatter, float(np.median(errors)))


def _usual(values: Sequence[float | None]) -> float | None:
    """The median of what is known; None where nothing is."""
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def _weighted_median(
    values: NDArray[np.float64], weights: NDArray[np.float64]
) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    return float(np.interp(0.5 * weights.sum(), below, values[order]))


def _median_angle(
    estimates: Sequence[tuple[float | None, float | None]],
) -> tuple[float | None, float | None]:
    """As ``_median``, for azimuths in deg: about where most of them point."""
    known = [row for row in estimates if row[0] is not None]
    mean = sum(cmath.exp(1j * math.radians(angle or 0.0)) for angle, _ in known)
    centre = math.degrees(cmath.phase(mean))
    offset, scatter = _median(
        [(_wrapped_deg((angle or 0.0) - centre), error) for angle, error in known]
    )
    return None if offset is None else _wrapped_deg(centre + offset), scatter


def _wrapped_deg(angle: float) -> float:
    """The angle in (-180, 180]."""
    return 180.0 - (180.0 - angle) % 360.0
