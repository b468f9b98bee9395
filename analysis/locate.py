"""Range and bearing over time of a recording of three microphones in a row."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.array_geometry import ArrayGeometry, load_geometry
from systems.delay_plan import DelayPlan
from systems.signals import FRAME_PERIOD_S
from systems.sound_file import read_sound
from systems.source_fix import SourceFix
from systems.tdoa_estimator import TDOAParameters, localise

__all__ = ["ArrayGeometry", "LocateResult", "SourceEstimate", "load_geometry", "locate"]

_RATES_HZ = (8_000, 192_000)

# Below 41 kHz a frame of 25 ms has too few samples to tell sound from noise.
_LEAST_FRAME_SAMPLES = 1024

# A band may not reach up to half the sample rate, where recorders' filters fall.
_TOP_OF_RATE = 0.45


@dataclass(frozen=True)
class SourceEstimate:
    """Where the sound of one frame came from, in the geometry's frame."""

    t_s: float
    """Middle of the frame, s from the start of the recording."""
    bearing_deg: float
    """Azimuth from the middle microphone, CCW from +x, in (-180, 180]."""
    bearing_std_deg: float
    """Its standard deviation from noise."""
    elevation_deg: float | None
    """None: a row of microphones cannot tell."""
    range_m: float | None
    """Distance from the middle microphone; None where it cannot be told."""
    range_std_m: float | None
    """Its standard deviation from noise."""


@dataclass(frozen=True)
class LocateResult:
    """Estimates of the frames in which a source was heard, and their summary."""

    array: dict[str, Any]
    """Geometry, band and rate that were used."""
    estimates: list[SourceEstimate]
    """In order of time."""
    frames: int
    """Frames of the recording."""
    ahead_deg: float
    """Azimuth of straight ahead; the mirror image lies behind the row."""

    def summary(self) -> dict[str, Any]:
        """Medians over the estimates, and what the array cannot tell."""
        bearing = _median([e.bearing_deg - self.ahead_deg for e in self.estimates])
        ranges = [e.range_m for e in self.estimates if e.range_m is not None]
        # A range that few frames give is no property of the recording.
        enough = len(ranges) * 2 >= len(self.estimates)
        range_m = _median(ranges) if enough else None
        alternatives = []
        if bearing is not None:
            mirrored = _wrapped_deg(self.ahead_deg + 180.0 - bearing)
            alternatives = [{"bearing_deg": mirrored, "elevation_deg": None}]
            bearing = _wrapped_deg(self.ahead_deg + bearing)
        return {
            "bearing_deg": bearing,
            "elevation_deg": None,
            "range_m": range_m,
            "observable": ["bearing"] * (bearing is not None)
            + ["range"] * (range_m is not None),
            "ambiguity": "front_back",
            "alternatives": alternatives,
            "frames": self.frames,
            "frames_heard": len(self.estimates),
        }

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command line."""
        return {
            "schema_version": 1,
            "array": self.array,
            "estimates": [asdict(estimate) for estimate in self.estimates],
            "summary": self.summary(),
        }

    def to_text(self) -> str:
        """A few lines for a terminal."""
        summary = self.summary()
        heard = f"heard a source in {len(self.estimates)} of {self.frames} frames"
        if not self.estimates:
            return f"{heard}: nothing to locate"
        other = summary["alternatives"][0]["bearing_deg"]
        distance = summary["range_m"]
        lines = [
            heard,
            f"bearing {summary['bearing_deg']:.2f} deg, or {other:.2f} deg behind it",
            "range not observable" if distance is None else f"range {distance:.3f} m",
            "",
            "    t/s  bearing/deg      std  range/m      std",
        ]
        lines += [_text_row(estimate) for estimate in self.estimates]
        return "\n".join(lines)


def locate(path: str | Path, geometry: ArrayGeometry | None = None) -> LocateResult:
    """Locates the source of a recording, frame by frame.

    Args:
        path: WAV or FLAC with one channel a microphone, 8-192 kHz.
        geometry: The microphones; the robot's own array by default.

    Returns:
        ``LocateResult``. A range is reported where its standard deviation is
        smaller than itself. Errors of the microphones' places and of the speed
        of sound are not in the standard deviations.

    Raises:
        ValueError: The recording cannot be used; says why, and the remedy.
    """
    geometry = geometry or ArrayGeometry()
    samples, rate = read_sound(path, "recording")
    where = f"recording: {str(path)!r}"
    _check_recording(samples, rate, geometry, where)
    row, c = geometry.row(), geometry.c
    low, high = geometry.band or (300.0, min(15_000.0, _TOP_OF_RATE * rate))
    travel = row.spacing_m / c
    # Long arrays need frames that hold all three arrivals several times over.
    length = max(
        round(FRAME_PERIOD_S * rate), _LEAST_FRAME_SAMPLES, math.ceil(8 * travel * rate)
    )
    if samples.shape[1] < length:
        raise ValueError(
            f"{where} has {samples.shape[1]} samples, less than one frame of {length}; "
            "record longer"
        )
    plan = DelayPlan(
        sample_rate_hz=float(rate),
        frame_samples=length,
        max_delay_s=travel,
        low_hz=low,
        high_hz=high,
    )
    parameters = TDOAParameters(
        maximum_closure_s=max(1.5e-5, 0.5 / rate), maximum_relative_range_std=1.0
    )
    columns = [geometry.columns[k] for k in row.order]
    channels = np.ascontiguousarray(samples[columns], dtype=np.float32)
    starts = range(0, samples.shape[1] - length + 1, length)
    estimates = []
    for start in starts:
        frame = channels[:, start : start + length]
        fix = localise(frame, plan, parameters, row.spacing_m, c)
        if fix is not None:
            middle = (start + length / 2.0) / rate
            estimates.append(_estimate(fix, middle, row.ahead_rad))
    array = {
        "microphones": [list(place) for place in geometry.microphones],
        "channels": list(geometry.columns),
        "sound_speed_m_s": c,
        "band_hz": [low, high],
        "sample_rate_hz": rate,
        "frame_s": length / rate,
        "spacing_m": row.spacing_m,
    }
    return LocateResult(array, estimates, len(starts), math.degrees(row.ahead_rad))


def _check_recording(
    samples: NDArray[np.float64], rate: int, geometry: ArrayGeometry, where: str
) -> None:
    count, needed = len(samples), len(geometry.microphones)
    if max(geometry.columns) >= count:
        what = "is mono" if count == 1 else f"has {count} channels"
        raise ValueError(
            f"{where} {what}, but the array needs "
            f"{max(needed, max(geometry.columns) + 1)}; record every microphone on a "
            "channel of its own"
        )
    if geometry.channels is None and count > needed:
        raise ValueError(
            f"{where} has {count} channels, but the array {needed} microphones; name "
            "the channels to use in the geometry file, as 'channels: [0, 1, 2]'"
        )
    if not _RATES_HZ[0] <= rate <= _RATES_HZ[1]:
        raise ValueError(
            f"{where} has a sample rate of {rate} Hz; record at {_RATES_HZ[0]} to "
            f"{_RATES_HZ[1]} Hz"
        )
    if geometry.band is not None and rate < 2.0 * geometry.band[1]:
        raise ValueError(
            f"{where} has a sample rate of {rate} Hz, below twice the band's upper end "
            f"of {geometry.band[1]:g} Hz; lower the band or record at a higher rate"
        )


def _estimate(fix: SourceFix, middle: float, ahead: float) -> SourceEstimate:
    return SourceEstimate(
        t_s=middle,
        bearing_deg=_wrapped_deg(math.degrees(ahead + fix.bearing)),
        bearing_std_deg=math.degrees(fix.bearing_std),
        elevation_deg=None,
        range_m=fix.range if fix.range_valid else None,
        range_std_m=fix.range_std if fix.range_valid else None,
    )


def _wrapped_deg(angle: float) -> float:
    """The angle in (-180, 180]."""
    return 180.0 - (180.0 - angle) % 360.0


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None


def _text_row(estimate: SourceEstimate) -> str:
    row = f"{estimate.t_s:7.3f}  {estimate.bearing_deg:11.2f}"
    row += f"  {estimate.bearing_std_deg:7.3f}"
    if estimate.range_m is None or estimate.range_std_m is None:
        return f"{row}        -        -"
    return f"{row}  {estimate.range_m:7.3f}  {estimate.range_std_m:7.3f}"
