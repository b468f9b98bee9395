"""Calibrates an array from recordings of sounds at known and unknown positions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import rotations
from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.calibration import Calibration, calibrate_array
from analysis.arrays.calibration_misfit import (
    CalibrationMisfit,
    calibration_misfit,
)
from analysis.arrays.calibration_sounds import (
    CalibrationSounds,
    MeasuredSound,
    check_position,
)
from analysis.arrays.heard_sounds import HeardSound, heard_sound, sightings_of
from analysis.arrays.observability import (
    CalibrationGain,
    calibration_gains,
    gains_nothing,
)
from analysis.arrays.recording_search import Sighting
from diagrams.scenario.yaml_text import LARGEST_BYTES
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file
from systems.sound.array_shape import ArrayShape

# Shortest usable wavelength, in standard deviations of the microphone positions. With
# a shorter wave, one period may be mistaken for the next.
_DEVIATIONS_A_PERIOD = 5.0

# Highest frequency used if the geometry file states no band, Hz.
_USUAL_TOP_HZ = 15_000.0

_Side = Literal["ahead", "behind", "above", "below"]

# Fields that the calibration replaces.
_REPLACED = frozenset(
    {
        "microphones",
        "position_std_m",
        "position_covariance_m2",
        "orientation_std_deg",
        "sound_speed",
        "sound_speed_std",
        "temperature_c",
        "temperature_std_c",
    }
)

# Fields that a file holds if it has no room for the covariance.
_LOSSY = ("position_std_m", "orientation_std_deg")

# _DIGITS: significant digits to try for a covariance, finest first.
# _AROUND: characters of YAML that surround each number.
_DIGITS, _AROUND = (17, 9), 8


@dataclass(frozen=True)
class CalibrationRun:
    """The result of calibrating an array, with the array as stated."""

    geometry: ArrayGeometry
    """The array as stated, before calibration."""
    calibration: Calibration
    gains: list[CalibrationGain]
    """How much better each quantity of the array is known than before."""
    misfit: CalibrationMisfit | None
    """The likeliest cause if sounds and geometry disagree; None if they agree."""
    heard: list[HeardSound] = field(default_factory=list)
    """One entry per sound of ``calibration.sounds``; empty if delays were given."""
    remarks: list[str] = field(default_factory=list)
    """Messages about recordings, such as a recording without detectable sound."""


def calibrate(sounds: CalibrationSounds, geometry: ArrayGeometry) -> CalibrationRun:
    """Calibrates an array from recordings that the array made.

    A first pass uses only frequencies that the stated position errors allow. If the
    first pass improves the array and fits, a second pass uses higher frequencies.
    Raises ``InputError`` if a recording cannot be used, if a source position is not
    plausible, or if no recording contains a detectable sound.
    """
    places = np.array(geometry.microphones)
    require_free_air(geometry)
    for k, listed in enumerate(sounds.sounds):
        if listed.position_m is not None:
            position = np.array(listed.position_m)
            check_position(places, position, f"sounds.{k}.position_m")
        for path in sounds.paths_of(listed):
            require_file(path, f"sounds.{k}.recording", "WAV or FLAC")
    top_hz = _top_hz(
        geometry, float(np.sqrt(np.mean(np.diag(geometry.known.budget.of_places))))
    )
    first = _pass(sounds, geometry, geometry, top_hz)
    fits = first.misfit is None
    if not fits or gains_nothing(first.calibration) or math.isinf(top_hz):
        return first
    # Better known microphone positions allow higher frequencies, which say more.
    known = calibrated_geometry(first.calibration, geometry)
    top_hz = _top_hz(geometry, _shape_std(first))
    return _pass(sounds, geometry, known, top_hz)


def require_free_air(geometry: ArrayGeometry) -> None:
    """Raises ``InputError`` if the array has a body."""
    if geometry.body is not None:
        raise InputError(
            "body", "arrays on a body cannot be calibrated; measure the positions"
        )


def _pass(
    sounds: CalibrationSounds,
    geometry: ArrayGeometry,
    known: ArrayGeometry,
    top_hz: float,
) -> CalibrationRun:
    """Calibrates the array from delays that are measured with the ``known`` array."""
    measured: list[MeasuredSound] = []
    heard: list[HeardSound] = []
    remarks: list[str] = []
    for k, listed in enumerate(sounds.sounds):
        files = [path.name for path in sounds.paths_of(listed)]
        name = f"sound {k + 1} ({files[0]}{', ...' if len(files) > 1 else ''})"
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
        heard.append(sound)
        place, std = listed.position_m, listed.position_std_m
        position = None if place is None else np.array(place)
        measured.append(MeasuredSound(sound.tau, sound.covariance, position, std, name))
    if not measured:
        raise InputError(
            "sounds",
            "no recording has a detectable sound; record single loud sounds in a "
            "quiet place, and check the positions of the microphones (in m)",
        )
    return calibration_run(measured, geometry, heard, remarks)


def _sightings(
    sounds: CalibrationSounds, k: int, known: ArrayGeometry, top_hz: float
) -> tuple[list[Sighting], list[str]]:
    """Finds the parts of one recording that contain sound below ``top_hz``.

    If the recording is silent there, the search uses all frequencies.
    """
    listed = sounds.sounds[k]
    files, starts_s = sounds.paths_of(listed), listed.starts_s
    part = listed.from_s, listed.to_s
    try:
        found, said = sightings_of(files, known, *part, top_hz, starts_s)
        if not found and math.isfinite(top_hz):
            found, said = sightings_of(files, known, *part, starts_s=starts_s)
    except InputError as error:
        raise InputError(f"sounds.{k}.{error.field}", error.message) from None
    return found, said


def _top_hz(geometry: ArrayGeometry, std: float) -> float:
    """Highest frequency usable with position errors of ``std`` m; inf for no limit."""
    highest = _USUAL_TOP_HZ if geometry.band is None else geometry.band[1]
    top = geometry.c / (_DEVIATIONS_A_PERIOD * max(std, 1e-9))
    return top if top < highest else math.inf


def _shape_std(run: CalibrationRun) -> float:
    """RMS position error without shifts, rotations and scaling of the array, m."""
    stds = {gain.name: gain.after for gain in run.gains}
    return stds.get("shape of the array", stds.get("places of microphones", 0.0))


def calibration_run(
    sounds: Sequence[MeasuredSound],
    geometry: ArrayGeometry,
    heard: list[HeardSound] | None = None,
    remarks: list[str] | None = None,
) -> CalibrationRun:
    """Calibrates an array from measured delays between microphones.

    Raises ``InputError`` if the sounds do not match the array, for example in their
    number of delays.
    """
    places, known = np.array(geometry.microphones), geometry.known
    found = calibrate_array(places, geometry.c, known.budget, sounds, known.shape)
    gains, misfit = calibration_gains(found), calibration_misfit(found)
    return CalibrationRun(geometry, found, gains, misfit, heard or [], remarks or [])


def calibrated_geometry(
    calibration: Calibration, geometry: ArrayGeometry
) -> ArrayGeometry:
    """Makes the geometry of a calibrated array, with the whole covariance."""
    fields = {
        **calibrated_fields(calibration, geometry),
        "position_covariance_m2": _symmetric(calibration.of_places).tolist(),
    }
    for lossy in _LOSSY:
        fields.pop(lossy, None)
    return ArrayGeometry.model_validate(fields)


def calibrated_fields(
    calibration: Calibration, geometry: ArrayGeometry
) -> dict[str, Any]:
    """Computes the fields of a geometry file for a calibrated array.

    Fields that were not calibrated are copied from the array as stated. If the array is
    too large for a covariance in the file, the file holds one standard deviation per
    microphone, and that of the orientation of the array. If the calibrated microphones
    no longer lie in a plane or line, the field ``side`` is left out.
    """
    fields = {
        "microphones": calibration.places.tolist(),
        **_uncertainty(calibration),
        "sound_speed": calibration.c,
        "sound_speed_std": calibration.speed_std,
    }
    dropped = set(_REPLACED)
    if geometry.side is not None and not _has_side(calibration, geometry.side):
        dropped.add("side")
    kept = geometry.model_dump(mode="json", exclude_none=True, exclude=dropped)
    return {**fields, **kept}


def _has_side(calibration: Calibration, side: _Side) -> bool:
    try:
        ArrayShape.of(calibration.places).facing(side)
    except InputError:
        return False
    return True


def _uncertainty(calibration: Calibration) -> dict[str, Any]:
    symmetric = _symmetric(calibration.of_places)
    for digits in _DIGITS:
        if symmetric.size * (digits + _AROUND) < LARGEST_BYTES:
            rows = [[float(f"{x:.{digits}g}") for x in row] for row in symmetric]
            return {"position_covariance_m2": rows}
    places = calibration.places
    turns = rotations(places)
    # Turns of the whole array are not independent errors of its microphones.
    turned = turns @ np.linalg.pinv(turns, rcond=1e-9)
    shape = np.eye(len(symmetric)) - turned
    variances = np.diag(shape @ symmetric @ shape).reshape(places.shape)
    of_turns = np.trace(turned @ symmetric @ turned) / np.trace(turns @ turns.T)
    return {
        "position_std_m": np.sqrt(variances.mean(axis=1)).tolist(),
        "orientation_std_deg": math.degrees(math.sqrt(of_turns)),
    }


def _symmetric(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    return (covariance + covariance.T) / 2.0
