"""Holds the estimates of a located source over time, and their summary."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from analysis.arrays.agreed_sources import AgreedSources, agree_sources
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.heard_sources import HeardSources
from analysis.arrays.place_medians import median, median_angle, usual, wrapped_deg
from analysis.arrays.source_estimate import SourceEstimate
from analysis.report.provenance import SCHEMA_VERSION
from systems.sound.array_shape import ArrayShape


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
    """Sources and tracks of the votes."""
    largest_range_error: float = 0.2
    """Largest standard deviation of a reported range, as a share of the range."""
    remarks: tuple[str, ...] = ()
    """Messages about the files of the recording, for example that one is truncated."""

    def __repr__(self) -> str:
        heard = f"{len(self.estimates)} of {self.frames} stretches heard"
        return f"<{type(self).__name__} {self.shape.count} microphones, {heard}>"

    def main_source(self) -> dict[str, Any]:
        """Summarizes the main source by medians, and lists what could not be measured.

        The main source is the first of ``sources``. If no estimate is near it, its
        values come from the votes.

        Returns:
            Values by name. A value is None if it could not be measured.
        """
        agreed = self.agreed
        main = [self.estimates[k] for k in agreed.main]
        bearing, bearing_std = median_angle(
            [(e.bearing_deg, e.bearing_std_deg) for e in main]
        )
        elevation, elevation_std = median(
            [(e.elevation_deg, e.elevation_std_deg) for e in main]
        )
        if not main and agreed.sources:
            first = agreed.sources[0]
            bearing, bearing_std = first.bearing_deg, first.bearing_std_deg
            elevation, elevation_std = first.elevation_deg, first.elevation_std_deg
        ranges = [(e.range_m, e.range_std_m) for e in main if e.range_m is not None]
        # The summary has a range only if at least half of the estimates have one.
        enough = 2 * len(ranges) >= len(main)
        range_m, range_std = median(ranges if enough else [])
        if (range_std or 0.0) > self.largest_range_error * (range_m or 0.0):
            range_m = range_std = None
        told = {"bearing": bearing, "elevation": elevation, "range": range_m}
        return {
            "bearing_deg": bearing,
            "bearing_std_deg": bearing_std,
            "bearing_systematic_deg": usual([e.bearing_systematic_deg for e in main]),
            "elevation_deg": elevation,
            "elevation_std_deg": elevation_std,
            "elevation_systematic_deg": usual(
                [e.elevation_systematic_deg for e in main]
            ),
            "range_m": range_m,
            "range_std_m": range_std,
            "range_systematic_m": usual(
                [] if range_m is None else [e.range_systematic_m for e in main]
            ),
            **_position([] if range_m is None else main),
            "number_of_sources": self.number_of_sources,
            "doubt": agreed.doubt,
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

        It is unknown if ``agreed.doubt`` states a reason.
        """
        return None if self.agreed.doubt else len(self.agreed.sources)

    @cached_property
    def agreed(self) -> AgreedSources:
        """The list of sources on which votes, estimates and faults agree."""
        return agree_sources(self.heard, self.estimates, self.faults, self.shape)

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
            "sources": [asdict(source) for source in self.agreed.sources],
            "tracks": [asdict(track) for track in self.agreed.tracks],
            "remarks": list(self.remarks),
        }


def _position(estimates: Sequence[SourceEstimate]) -> dict[str, Any]:
    """Returns the median position of estimates, and the covariance of a single one.

    A larger number of estimates does not reduce the covariance, because the estimates
    may have a common error.
    """
    placed = [e for e in estimates if e.position_m is not None]
    if not placed:
        return {"position_m": None, "position_covariance_m2": None}
    covariance = np.median([e.position_covariance_m2 for e in placed], axis=0)
    center = np.median([e.position_m for e in placed], axis=0)
    return {
        "position_m": center.tolist(),
        "position_covariance_m2": covariance.tolist(),
    }
