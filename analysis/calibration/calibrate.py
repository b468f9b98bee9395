"""From recordings of known and unknown places to a calibrated array."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from analysis.calibration.calibrated_geometry import calibrated_fields
from analysis.calibration.calibration import Calibration, calibrate_array
from analysis.calibration.calibration_misfit import (
    CalibrationMisfit,
    calibration_misfit,
)
from analysis.calibration.calibration_sounds import CalibrationSounds
from analysis.calibration.measured_sound import MeasuredSound, check_position
from analysis.calibration.observability import (
    CalibrationGain,
    calibration_gains,
    gains_nothing,
)
from analysis.recordings.array_geometry import ArrayGeometry
from analysis.recordings.heard_sounds import HeardSound, heard_sound, sightings_of
from analysis.recordings.recording_search import Sighting
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file

# A wave whose length is less than so many deviations of the microphones' places may
# be taken for the one before or after it.
_DEVIATIONS_A_PERIOD = 5.0

# Where a geometry names no band, sounds are heard up to here, Hz.
_USUAL_TOP_HZ = 15_000.0


@dataclass(frozen=True)
class CalibrationRun:
    """An array, what it was calibrated with, and what came of it."""

    geometry: ArrayGeometry
    """As stated."""
    calibration: Calibration
    gains: list[CalibrationGain]
    """What became better known, and what did not."""
    misfit: CalibrationMisfit | None
    """What does not fit, if anything."""
    heard: list[HeardSound] = field(default_factory=list)
    """By ``calibration.sounds``; empty where delays were given."""
    remarks: list[str] = field(default_factory=list)
    """What is worth knowing of the recordings."""

    @property
    def gains_nothing(self) -> bool:
        """Whether the array is known no better than before."""
        return gains_nothing(self.calibration)


def calibrate(sounds: CalibrationSounds, geometry: ArrayGeometry) -> CalibrationRun:
    """Refines an array by recordings that it made.

    Args:
        sounds: Recordings, and where their sources are.
        geometry: The array, and how well it is known.

    Returns:
        The calibrated array.

    Raises:
        InputError: A recording cannot be used, or a position makes no sense; or
            nothing is heard in any of them.
    """
    places = np.array(geometry.microphones)
    for k, listed in enumerate(sounds.sounds):
        path = sounds.path_of(listed)
        if listed.position_m is not None:
            position = np.array(listed.position_m)
            check_position(places, position, f"sounds.{k}.position_m")
        require_file(path, f"sounds.{k}.recording", "WAV or FLAC")
    top_hz = _top_hz(
        geometry, float(np.sqrt(np.mean(np.diag(geometry.known.budget.of_places))))
    )
    first = calibration_run(*_listened(sounds, geometry, geometry, top_hz))
    if first.misfit is not None or first.gains_nothing or math.isinf(top_hz):
        return first
    # Where microphones are known better, higher frequencies tell more.
    known = ArrayGeometry.model_validate(calibrated_fields(first.calibration, geometry))
    top_hz = _top_hz(geometry, _shape_std(first))
    return calibration_run(*_listened(sounds, geometry, known, top_hz))


def _listened(
    sounds: CalibrationSounds,
    geometry: ArrayGeometry,
    known: ArrayGeometry,
    top_hz: float,
) -> tuple[list[MeasuredSound], ArrayGeometry, list[HeardSound], list[str]]:
    """What an array, as far as it is known by now, hears in all recordings."""
    measured: list[MeasuredSound] = []
    heard: list[HeardSound] = []
    remarks: list[str] = []
    for k, listed in enumerate(sounds.sounds):
        name = f"sound {k + 1} ({Path(listed.recording).name})"
        found, said = _sightings(sounds, k, known, top_hz)
        remarks += [f"{name}: {remark}" for remark in said]
        if not found:
            remarks.append(f"{name}: it has no detectable sound, and it is left out")
            continue
        sound = heard_sound(found, known.known.shape, known.c)
        if 2 * sound.used <= sound.stretches:
            remarks.append(
                f"{name}: of {sound.stretches} stretches {sound.used} agree; its "
                "source moves, or there are other sources"
            )
        place = listed.position_m
        heard.append(sound)
        measured.append(
            MeasuredSound(
                sound.tau,
                sound.covariance,
                None if place is None else np.array(place),
                listed.position_std_m,
                name,
            )
        )
    if not measured:
        raise InputError(
            "sounds",
            "no recording has a detectable sound; record single loud sounds in a "
            "quiet place, and check the positions of the microphones (in m)",
        )
    return measured, geometry, heard, remarks


def _sightings(
    sounds: CalibrationSounds, k: int, known: ArrayGeometry, top_hz: float
) -> tuple[list[Sighting], list[str]]:
    """Stretches of one recording: of all frequencies, if the low ones are silent."""
    listed = sounds.sounds[k]
    path, part = sounds.path_of(listed), (listed.from_s, listed.to_s)
    try:
        found, said = sightings_of(path, known, *part, top_hz)
        if not found and math.isfinite(top_hz):
            found, said = sightings_of(path, known, *part)
    except InputError as error:
        raise InputError(f"sounds.{k}.{error.field}", error.message) from None
    return found, said


def _top_hz(geometry: ArrayGeometry, std: float) -> float:
    """Up to where microphones that are off by so much, m, hear alike; or infinity."""
    highest = _USUAL_TOP_HZ if geometry.band is None else geometry.band[1]
    top = geometry.c / (_DEVIATIONS_A_PERIOD * max(std, 1e-9))
    return top if top < highest else math.inf


def _shape_std(run: CalibrationRun) -> float:
    """What is left of the places but shifts and turns of all together, m."""
    stds = {gain.name: gain.after for gain in run.gains}
    return stds.get("shape of the array", stds.get("places of microphones", 0.0))


def calibration_run(
    sounds: Sequence[MeasuredSound],
    geometry: ArrayGeometry,
    heard: list[HeardSound] | None = None,
    remarks: list[str] | None = None,
) -> CalibrationRun:
    """Refines an array by delays.

    Args:
        sounds: The delays, and where their sources are.
        geometry: The array, and how well it is known.
        heard: What they were heard from, if from recordings.
        remarks: Of the recordings.

    Returns:
        The calibrated array.

    Raises:
        InputError: The sounds are none for this array.
    """
    calibration = calibrate_array(
        np.array(geometry.microphones),
        geometry.c,
        geometry.known.budget,
        sounds,
        geometry.known.shape,
    )
    return CalibrationRun(
        geometry,
        calibration,
        calibration_gains(calibration),
        calibration_misfit(calibration),
        heard or [],
        remarks or [],
    )
