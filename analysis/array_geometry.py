"""Microphones of a recording: where they stand, and how to read that."""

from __future__ import annotations

import math
from io import StringIO
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, ValidationError, model_validator
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from systems.acoustics import AcousticParameters
from systems.parameters import Parameters, Point, Positive

__all__ = ["ArrayGeometry", "Row", "load_geometry"]

_Point3 = Annotated[tuple[float, float, float], Strict(False)]
_Points = Annotated[tuple[Point, ...], Strict(False)]
_Points3 = Annotated[tuple[_Point3, ...], Strict(False)]
_Channels = Annotated[tuple[Annotated[int, Field(ge=0)], ...], Strict(False)]
_Band = Annotated[tuple[Positive, Positive], Strict(False)]

# How far a microphone may stand off the ideal row, as a share of the spacing.
_TOLERANCE = 0.01


class Row(Parameters):
    """Three equally spaced microphones in a row, from left to right."""

    order: tuple[int, int, int]
    """Columns of the recording: left, middle, right of one who looks ahead."""
    spacing_m: Positive
    """Distance between neighbours, m."""
    ahead_rad: float
    """Azimuth of straight ahead in the frame of the geometry, rad."""


class ArrayGeometry(Parameters):
    """A geometry file. The default is the robot's own array."""

    microphones: _Points | _Points3 = ((0.0, 0.4), (0.0, 0.0), (0.0, -0.4))
    """Places (x, y) or (x, y, z) in the order of the channels, m."""
    channels: _Channels | None = None
    """Columns of the file to use, from 0; none: the first ones."""
    sound_speed: Positive | None = None
    """Speed of sound, m/s; none: 340, or from the temperature."""
    temperature_c: float | None = Field(default=None, ge=-50.0, le=60.0)
    """Temperature, deg C."""
    band: _Band | None = None
    """Band of the sound, Hz; none: 300 to 15000 or 0.45 of the sample rate."""

    @model_validator(mode="after")
    def _check(self) -> ArrayGeometry:
        count = len(self.microphones)
        if self.channels is not None:
            if len(self.channels) != count:
                raise ValueError(
                    f"channels: {len(self.channels)} named for {count} microphones; "
                    "name one for each"
                )
            if len(set(self.channels)) != count:
                raise ValueError("channels: one is named twice; name each once")
        if self.sound_speed is not None and self.temperature_c is not None:
            raise ValueError(
                "sound_speed: given together with temperature_c; keep one of them"
            )
        if self.band is not None and self.band[0] >= self.band[1]:
            raise ValueError("band: must rise, as [300, 8000]")
        self.row()
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

    def row(self) -> Row:
        """The microphones as a row.

        Ahead is the side of the row towards +x, or towards +y for a row along
        x: the order of the channels does not matter.

        Raises:
            ValueError: They are not three, equally spaced, in a level line.
        """
        places = np.array(self.microphones)
        if len(places) != 3:
            raise ValueError(
                f"microphones: {len(places)} given; arrays of three in a row are "
                "supported"
            )
        along = _farthest(places)
        spacing = float(np.linalg.norm(along)) / 2.0
        if spacing == 0.0:
            raise ValueError("microphones: all stand in one place; give their places")
        unit = along / (2.0 * spacing)
        if places.shape[1] == 3 and abs(unit[2]) > _TOLERANCE:
            raise ValueError("microphones: the row must be level; give equal heights")
        # Ahead is the unit vector turned by -90 degrees.
        if unit[1] < -1e-9 or (abs(unit[1]) <= 1e-9 and unit[0] > 0.0):
            unit = -unit
        offsets = places - places.mean(axis=0)
        positions = offsets @ unit
        order = np.argsort(-positions)
        ideal = np.outer(np.array([spacing, 0.0, -spacing]), unit)
        errors = np.linalg.norm(offsets[order] - ideal, axis=1)
        if errors.max() > _TOLERANCE * spacing:
            raise ValueError(
                "microphones: not three equally spaced in a row (off by "
                f"{errors.max() * 1e3:.1f} mm); only such arrays are supported"
            )
        return Row(
            order=(int(order[0]), int(order[1]), int(order[2])),
            spacing_m=spacing,
            ahead_rad=math.atan2(-unit[0], unit[1]),
        )


def _farthest(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vector between the two microphones that are farthest apart."""
    vectors = [b - a for k, a in enumerate(places) for b in places[k + 1 :]]
    return max(vectors, key=lambda v: float(v @ v))


def load_geometry(path: str | Path) -> ArrayGeometry:
    """Reads a geometry file.

    Args:
        path: YAML with ``microphones`` and optionally ``channels``,
            ``sound_speed`` or ``temperature_c``, and ``band``.

    Raises:
        ValueError: The file is missing, not YAML or makes no sense; the
            message names the field and the remedy.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        content = YAML(typ="safe").load(StringIO(text))
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(
            f"geometry: cannot read {str(path)!r} ({error}); give the path of a "
            "YAML file"
        ) from None
    except YAMLError as error:
        reason = " ".join(str(error).split())
        raise ValueError(
            f"geometry: {str(path)!r} is not YAML ({reason}); see the documentation"
        ) from None
    if not isinstance(content, dict) or "microphones" not in content:
        raise ValueError(
            f"geometry: {str(path)!r} names no microphones; write for instance "
            "'microphones: [[0, 0.4], [0, 0], [0, -0.4]]'"
        )
    try:
        return ArrayGeometry(**content)
    except ValidationError as error:
        raise ValueError(f"geometry: {str(path)!r}: {_first_error(error)}") from None


def _first_error(error: ValidationError) -> str:
    first = error.errors()[0]
    # Members of a union stand in the path, too, by names with brackets.
    where = ".".join(str(part) for part in first["loc"] if "[" not in str(part))
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        message = "unknown key; remove it"
    return f"{where}: {message}" if where else message
