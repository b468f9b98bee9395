"""The sounds that calibrate an array: recordings, and delays measured in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, ValidationError, model_validator

from diagrams.scenario.fields.explain import explain
from diagrams.scenario.loading import read_mapping
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file
from systems.framework.parameters import Parameters, Time

_MOST_SOUNDS = 500

# Least distance of a source from a microphone, m. A nearer source is no point source.
_NEAREST_M = 0.05
# Largest distance of a source from a microphone, m.
_FARTHEST_M = 1000.0

_File = Annotated[str, Field(min_length=1)]
_Files = Annotated[tuple[_File, ...], Strict(False), Field(min_length=1)]
_Starts = Annotated[tuple[float, ...], Strict(False)]
_Position = Annotated[
    tuple[float, ...], Strict(False), Field(min_length=2, max_length=3)
]


class CalibrationSound(Parameters):
    """A recording, or part of a recording, of one source at rest."""

    recording: _File | _Files
    """WAV or FLAC file, or one file per microphone; a relative path begins in the
    folder of the list."""
    starts_s: _Starts | None = None
    """When each file of several begins, s; none: all begin at the same time."""
    position_m: _Position | None = None
    """Where the source is, in the frame of the geometry file, m; none: not known."""
    position_std_m: float = Field(default=0.01, ge=0.0, le=100.0)
    """Standard deviation of each coordinate of that position, m."""
    from_s: Time = 0.0
    """Where the part begins, s."""
    to_s: Time | None = None
    """Where it ends, s; none: at the end of the recording."""

    @model_validator(mode="after")
    def _check(self) -> CalibrationSound:
        if self.to_s is not None and self.to_s <= self.from_s:
            raise InputError(
                "to_s",
                f"is {self.to_s:g}, not after from_s of {self.from_s:g}; raise it",
            )
        return self


class CalibrationSounds(Parameters):
    """A file for ``phonotaxis calibrate``."""

    sounds: Annotated[
        tuple[CalibrationSound, ...], Strict(False), Field(max_length=_MOST_SOUNDS)
    ]
    """The recordings."""
    folder: str = "."
    """Where relative paths of recordings begin."""

    def paths_of(self, sound: CalibrationSound) -> list[Path]:
        """Paths of the files of a sound's recording."""
        files = sound.recording
        files = (files,) if isinstance(files, str) else files
        return [Path(self.folder) / file for file in files]


def load_calibration_sounds(path: str | Path) -> CalibrationSounds:
    """Reads a list of sounds from a YAML file.

    If the file names no ``folder``, ``folder`` is that of the file. Raises
    ``InputError`` if the file is missing, is not YAML, or lists no sounds.
    """
    path = require_file(path, "sounds", "YAML")
    data = read_mapping(path)
    if not data.get("sounds"):
        raise InputError(
            "sounds",
            f"{str(path)!r} lists no sounds; write for example 'sounds: "
            f"[{{recording: a.wav, position_m: [2, 1, 0.5]}}]', one entry for each "
            "place",
        )
    try:
        return CalibrationSounds.model_validate({"folder": str(path.parent), **data})
    except ValidationError as error:
        raise explain(
            error, CalibrationSounds.model_json_schema(), "a list of sounds"
        ) from None


@dataclass(frozen=True)
class MeasuredSound:
    """Delays of one sound, from a source at rest, at n microphones."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, without array and air errors, s^2."""
    position: NDArray[np.float64] | None = None
    """(d,) position of the source in the microphones' frame, m. None: not known."""
    position_std: float = 0.0
    """Standard deviation of each coordinate of ``position``, m."""
    name: str = ""
    """Name of the sound in messages."""
    missing: int = 0
    """Number of delays that were not measured. Their variances are very large."""


def check_sounds(places: NDArray[np.float64], sounds: Sequence[MeasuredSound]) -> None:
    """Checks that sounds are suitable to calibrate microphones at (n, d) ``places``.

    Raises ``InputError`` if there are no sounds, if a sound does not have n - 1 delays,
    or if a source position is not plausible.
    """
    if not sounds:
        raise InputError(
            "sounds",
            "are empty; give at least one sound that was made at a known position",
        )
    for k, sound in enumerate(sounds):
        where = f"sounds.{k}"
        if sound.tau.shape != (len(places) - 1,):
            raise InputError(
                where,
                f"has {sound.tau.size} delays; {len(places)} microphones have "
                f"{len(places) - 1}",
            )
        if sound.position is not None:
            check_position(places, sound.position, f"{where}.position_m")


def check_position(
    places: NDArray[np.float64], position: NDArray[np.float64], field: str
) -> None:
    """Checks that a stated (d,) position of a sound is plausible.

    Raises ``InputError`` for ``field`` if the position does not have as many
    coordinates as the (n, d) microphone positions ``places``, if it is less than 5 cm
    from a microphone, or if it is more than 1 km from the nearest microphone.
    """
    dimension = places.shape[1]
    if position.shape != (dimension,):
        coordinates = ("[x, y]", "[x, y, z]")
        raise InputError(
            field,
            f"{position.tolist()} has {position.size} coordinates and the microphones "
            f"have {dimension}; give {coordinates[dimension - 2]}, or the microphones "
            f"as {coordinates[3 - dimension]}",
        )
    distances = np.linalg.norm(places - position, axis=1)
    nearest = int(distances.argmin())
    if distances[nearest] < _NEAREST_M:
        raise InputError(
            field,
            f"{position.tolist()} is {100.0 * distances[nearest]:.1f} cm from "
            f"microphone {nearest + 1}; make sounds at least "
            f"{100.0 * _NEAREST_M:g} cm away, and give positions in m",
        )
    if distances[nearest] > _FARTHEST_M:
        raise InputError(
            field,
            f"{position.tolist()} is {distances[nearest]:.4g} m from the microphones; "
            f"give positions in m, at most {_FARTHEST_M:g} m away",
        )
