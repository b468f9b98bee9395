"""Calibrates an array by measured delays, and judges it by the angles of a turntable.

The file is ``calibration/pyramic_tdoa.json`` of the Pyramic data set (Scheibler and
co-authors, github.com/fakufaku/pyramic-dataset, CC BY 4.0): delays of 48 microphones in
an anechoic chamber, for 3 loudspeakers and 180 angles of a turntable, and the places of
the microphones as measured by hand. Every second angle calibrates the array, in unknown
directions. The other angles are located, and their bearings compared with the
turntable's, minus the mean difference of each loudspeaker.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phonotaxis import ArrayGeometry, calibrate_delays, locate_delays
from phonotaxis.delays import DelayResult
from studies.tables import Table

_COLUMNS = (
    "places",
    "sounds",
    "median error, deg",
    "largest, deg",
    "stated std, deg",
    "within 1 std, %",
    "within 2 std, %",
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of this study."""
    parser.add_argument("--delays", type=Path, required=True, metavar="FILE.json")
    parser.add_argument(
        "--position-std-m", type=float, default=0.003, help="of the places by hand"
    )


def run(options: argparse.Namespace) -> Iterator[Table]:
    """Yields the errors of the bearings before and after the calibration."""
    data = json.loads(options.delays.read_text("utf-8"))
    # Axes: loudspeakers, angles, microphones.
    delays = np.array(data["delays"]).transpose(2, 1, 0)
    stated = ArrayGeometry(
        microphones=tuple(map(tuple, np.array(data["microphones"]).T)),
        sound_speed=data["sound_speed_mps"],
        sound_speed_std=0.5,
        position_std_m=options.position_std_m,
    )
    angles_deg = np.linspace(0.0, 360.0, delays.shape[1], endpoint=False)
    even, odd = delays[:, ::2], delays[:, 1::2]
    every = even.reshape(-1, even.shape[-1])
    calibrated = calibrate_delays(every, stated).geometry
    rows = [
        _row(name, odd, angles_deg[1::2], geometry)
        for name, geometry in (("by hand", stated), ("calibrated", calibrated))
    ]
    yield Table("Bearings of the other angles", _COLUMNS, rows)


def _row(
    name: str,
    delays: NDArray[np.float64],
    angles_deg: NDArray[np.float64],
    geometry: ArrayGeometry,
) -> list[object]:
    found = locate_delays(delays.reshape(-1, delays.shape[-1]), geometry)
    off = _errors(found, angles_deg, len(delays))
    stds = np.array([e.bearing_std_deg or np.nan for e in found.estimates])
    z = np.abs(off) / stds
    return [
        name,
        int(np.isfinite(off).sum()),
        round(float(np.nanmedian(np.abs(off))), 3),
        round(float(np.nanmax(np.abs(off))), 2),
        round(float(np.nanmedian(stds)), 3),
        round(100.0 * float(np.nanmean(z < 1.0))),
        round(100.0 * float(np.nanmean(z < 2.0))),
    ]


def _errors(
    found: DelayResult, angles_deg: NDArray[np.float64], loudspeakers: int
) -> NDArray[np.float64]:
    """(sounds,) bearings minus angles and minus the mean of each loudspeaker, deg."""
    bearings = np.array(
        [np.nan if e.bearing_deg is None else e.bearing_deg for e in found.estimates]
    )
    off = bearings.reshape(loudspeakers, -1) - angles_deg
    off = np.degrees(np.angle(np.exp(1j * np.radians(off))))
    return np.asarray((off - np.nanmean(off, axis=1, keepdims=True)).ravel())
