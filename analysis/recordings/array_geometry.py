"""Microphones of a recording: where they stand, and how to read that."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, Strict, ValidationError, model_validator

from diagrams.yaml_text import parse_yaml
from systems.framework.input_error import InputError
from systems.framework.parameters import Parameters, Point, Positive
from systems.sound.acoustics import AcousticParameters
from systems.sound.array_shape import ArrayShape

__all__ = ["ArrayGeometry", "load_geometry"]

# Positions that are farther apart are in other units than metres.
_LARGEST_M = 30.0

# The work grows with the number of pairs.
_MOST_MICROPHONES = 64

_LEAST_BAND_HZ = 500.0

_Point3 = Annotated[tuple[float, float, float], Strict(False)]
_Points = Annotated[tuple[Point, ...], Strict(False)]
_Points3 = Annotated[tuple[_Point3, ...], Strict(False)]
_Channels = Annotated[tuple[Annotated[int, Field(ge=0)], ...], Strict(False)]
_Band = Annotated[tuple[Positive, Positive], Strict(False)]


class ArrayGeometry(Parameters):
    """A geometry file. The default is the robot's own array."""

    microphones: _Points | _Points3 = ((0.0, 0.4), (0.0, 0.0), (0.0, -0.4))
    """Places (x, y) or (x, y, z) in the order of the channels, m."""
    channels: _Channels | None = None
    """Columns of the file to use, from 0; none: the first ones."""
    sound_speed: float | None = Field(default=None, ge=100.0, le=8000.0)
    """Speed of sound, m/s; none: 340, or from the temperature."""
    temperature_c: float | None = Field(default=None, ge=-50.0, le=60.0)
    """Temperature, deg C."""
    band: _Band | None = None
    """Band of the sound, Hz; none: 300 to 15000 or 0.45 of the sample rate."""

    @model_validator(mode="after")
    def _check(self) -> ArrayGeometry:
        count = len(self.microphones)
        if count > _MOST_MICROPHONES:
            raise InputError(
                "microphones",
                f"{count} given; give at most {_MOST_MICROPHONES}, and name their "
                "columns in 'channels'",
            )
        if self.channels is not None:
            if len(self.channels) != count:
                raise InputError(
                    "channels",
                    f"{len(self.channels)} named for {count} microphones; "
                    "name one for each",
                )
            if len(set(self.channels)) != count:
                raise InputError("channels", "one is named twice; name each once")
        if self.sound_speed is not None and self.temperature_c is not None:
            raise InputError(
                "sound_speed", "given together with temperature_c; keep one of them"
            )
        if self.band is not None and self.band[0] >= self.band[1]:
            raise InputError("band", "must rise, as [300, 8000]")
        if self.band is not None and self.band[1] - self.band[0] < _LEAST_BAND_HZ:
            raise InputError(
                "band",
                f"{list(self.band)} is too narrow to tell delays; give at least "
                f"{_LEAST_BAND_HZ:g} Hz",
            )
        aperture = ArrayShape.of(self.microphones).aperture_m
        if aperture > _LARGEST_M:
            raise InputError(
                "microphones",
                f"{aperture:g} m apart; give positions in m, at most "
                f"{_LARGEST_M:g} m apart",
            )
        return self

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns of the recording, one a microphone."""
        return self.channels or tuple(range(len(self.microphones)))

    @property
    def c(self) -> float:
        """Speed of sound, m/s."""
        if self.sound_speed is not None:
            return self.sound_speed
        return AcousticParameters(temperature_c=self.temperature_c).c


def load_geometry(path: str | Path) -> ArrayGeometry:
    """Reads a geometry file.

    Args:
        path: YAML with ``microphones`` and optionally ``channels``,
            ``sound_speed`` or ``temperature_c``, and ``band``.

    Raises:
        InputError: The file is missing, not YAML or makes no sense; the
            message names the field and the remedy.
    """
    path = Path(path)
    try:
        content = parse_yaml(path.read_text(encoding="utf-8"), "geometry")
    except InputError as error:
        raise InputError(
            "geometry", f"{str(path)!r} is not YAML that can be used; {error.message}"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            "geometry",
            f"cannot read {str(path)!r} ({error}); give the path of a YAML file",
        ) from None
    if not isinstance(content, dict) or "microphones" not in content:
        raise InputError(
            "geometry",
            f"{str(path)!r} names no microphones; write for instance "
            "'microphones: [[0, 0.4], [0, 0], [0, -0.4]]'",
        )
    try:
        return ArrayGeometry(**content)
    except ValidationError as error:
        raise InputError("geometry", f"{str(path)!r}: {_first_error(error)}") from None


def _first_error(error: ValidationError) -> str:
    first = error.errors()[0]
    # Members of a union stand in the path, too, by names with brackets.
    where = ".".join(str(part) for part in first["loc"] if "[" not in str(part))
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] in {"tuple_type", "too_short", "too_long"}:
        message = f"is {first['input']}; give [x, y] or [x, y, z] of each microphone"
        if first["loc"][0] != "microphones":
            message = f"is {first['input']}; give a list, as in the documentation"
    if first["type"] == "extra_forbidden":
        message = "unknown key; remove it"
    return f"{where}: {message}" if where else message
