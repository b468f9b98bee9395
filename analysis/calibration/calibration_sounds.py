"""Reads the list of recordings that calibrate an array."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, Strict, ValidationError, model_validator

from diagrams.scenario.fields.explain import explain
from diagrams.scenario.loading import read_mapping
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file
from systems.framework.parameters import Parameters, Time

_MOST_SOUNDS = 500

_Position = Annotated[
    tuple[float, ...], Strict(False), Field(min_length=2, max_length=3)
]


class CalibrationSound(Parameters):
    """A recording, or part of a recording, of one source at rest."""

    recording: str = Field(min_length=1)
    """WAV or FLAC; a relative path begins in the folder of the list."""
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

    def path_of(self, sound: CalibrationSound) -> Path:
        """Path of a sound's recording."""
        return Path(self.folder) / sound.recording


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
