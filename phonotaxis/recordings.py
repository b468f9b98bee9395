"""Sources and arrays that follow from recordings of a microphone array."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from analysis.arrays.array_geometry import ArrayGeometry, make_geometry
from analysis.arrays.calibrate import (
    CalibrationRun,
    calibrate as run_calibration,
    calibrated_geometry,
)
from analysis.arrays.calibration_plots import plot_calibration
from analysis.arrays.calibration_sounds import (
    CalibrationSounds,
    load_calibration_sounds,
)
from analysis.arrays.calibration_text import (
    calibration_document,
    calibration_text,
    write_calibration,
)
from analysis.arrays.locate import located
from analysis.arrays.locate_plots import plot_locate, write_locate
from analysis.arrays.locate_result import LocatedSource
from analysis.arrays.locate_text import locate_text
from analysis.arrays.recorded_samples import (
    RecordedSamples,
    Recording,
    recorded_samples,
)
from phonotaxis.result import Prepared, Result, ignore

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AnyResult = TypeVar("AnyResult", bound=Result)

__all__ = ["CalibrationResult", "LocateResult", "calibrate", "locate"]


class LocateResult(LocatedSource, Result):
    """Estimates for the stretches of a recording in which a source was heard."""

    def __str__(self) -> str:
        """Summary and estimates, for a terminal."""
        return locate_text(self)

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages about the files, and faults of the channels."""
        return (*self.remarks, *(fault.message for fault in self.faults))

    def plot(self) -> Figure:
        """Draws the angles and the range over time, and the plan view."""
        return plot_locate(self)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes ``locate.json`` and ``locate.png``.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        write_locate(self, document, directory)


@dataclass(frozen=True, repr=False)
class CalibrationResult(Result):
    """A calibrated array."""

    run: CalibrationRun

    def __repr__(self) -> str:
        calibration = self.run.calibration
        return (
            f"<CalibrationResult {len(calibration.places)} microphones, "
            f"{len(calibration.sounds)} sounds>"
        )

    @property
    def geometry(self) -> ArrayGeometry:
        """The calibrated array, which ``locate`` and ``listen`` accept."""
        return calibrated_geometry(self.run.calibration, self.run.geometry)

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of ``phonotaxis calibrate``."""
        return calibration_document(self.run)

    def __str__(self) -> str:
        """How much better the array is known than before, for a terminal."""
        return calibration_text(self.run)

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages about the recordings."""
        return tuple(self.run.remarks)

    def plot(self) -> Figure:
        """Draws the stated and the calibrated microphones from above."""
        return plot_calibration(self.run)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes ``array.yaml`` and ``calibration.json``.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        write_calibration(document, directory)


def locate(
    recording: Recording,
    geometry: ArrayGeometry | str | Path | Sequence[Sequence[float]] | None = None,
    *,
    sample_rate_hz: float | None = None,
    starts_s: Sequence[float] | None = None,
) -> LocateResult:
    """Locates the source of a recording in each short stretch of time.

    A warning of the logger ``phonotaxis``, and ``notes`` of the result, state each
    fault of the files and of the channels.

    Args:
        recording: WAV or FLAC file with one channel per microphone, at 8-500 kHz. Or a
            list of files whose channels together are those of the microphones, in
            their order. Or (n, samples) recorded samples, one row per microphone.
        geometry: Geometry of the microphones, the path of a geometry file, or a list of
            positions (x, y) or (x, y, z) in m. None: the robot's own array.
        sample_rate_hz: Rate of recorded samples, Hz. None for a file, which states its
            own rate.
        starts_s: Time at which each of several files begins, s, from any common moment.
            Only the time that all files cover is used, and times of the result count
            from its beginning. None: all files begin at the same time.

    Returns:
        The estimates over time. Their standard deviations include the errors that the
        geometry states. A range is reported if its standard deviation is at most the
        share ``largest_range_error`` of the range.

    Raises:
        InputError: The recording cannot be used. The message states the cause and the
            remedy.
    """
    geometry = make_geometry(geometry)
    recorded = recorded_samples(recording, geometry, sample_rate_hz, starts_s)
    return prepare_locate(recorded, geometry).run(ignore)


def prepare_locate(
    recorded: RecordedSamples, geometry: ArrayGeometry
) -> Prepared[LocateResult]:
    """Prepares the search for sources in a recording; see ``locate``."""
    return Prepared(
        run=lambda _: logged(LocateResult(**vars(located(recorded, geometry))))
    )


def calibrate(
    sounds: CalibrationSounds | str | Path,
    geometry: ArrayGeometry | str | Path | Sequence[Sequence[float]] | None = None,
) -> CalibrationResult:
    """Calibrates a microphone array by recordings of sounds at known positions.

    A warning of the logger ``phonotaxis``, and ``notes`` of the result, state what is
    wrong with a recording.

    Args:
        sounds: Recordings and positions of their sources, or the YAML file that lists
            them.
        geometry: Stated positions of the microphones, with their uncertainties: a
            geometry, the path of a geometry file, or a list of positions (x, y) or
            (x, y, z) in m. None: the robot's own array, with default uncertainties.

    Returns:
        The calibrated array, and how much better it is known than before.

    Raises:
        InputError: A recording cannot be used, a position is not plausible, or no
            recording contains a detectable sound.
    """
    if not isinstance(sounds, CalibrationSounds):
        sounds = load_calibration_sounds(sounds)
    known = ArrayGeometry() if geometry is None else make_geometry(geometry)
    return prepare_calibration(sounds, known).run(ignore)


def prepare_calibration(
    sounds: CalibrationSounds, geometry: ArrayGeometry
) -> Prepared[CalibrationResult]:
    """Prepares a calibration; see ``calibrate``."""
    return Prepared(
        run=lambda _: logged(CalibrationResult(run_calibration(sounds, geometry)))
    )


def logged(result: AnyResult) -> AnyResult:
    """Logs the notes of a result as warnings."""
    for note in result.notes:
        logging.getLogger("phonotaxis").warning("%s", note)
    return result
