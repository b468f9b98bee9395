"""Describes the microphones of a recording, and reads them from a geometry file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, ValidationError, model_validator

from analysis.arrays.array_body import ArrayBody
from analysis.arrays.array_budget import ArrayBudget, rotations
from diagrams.scenario.yaml_text import parse_yaml
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file
from systems.framework.parameters import Parameters, Positive
from systems.sound.acoustics import SOUND_SPEED_M_S, sound_speed
from systems.sound.array_shape import ArrayShape

# Largest distance between two microphones, m. Sound takes 15 s over this distance.
# Larger distances mean that the positions are not in meters.
_LARGEST_M = 5_000.0

# Largest standard deviation of positions, m, or the aperture if that is longer.
_LARGEST_STD_M = 1.0

# Largest coordinate of a microphone, m. Coordinates of maps have up to 10^7 m.
_FARTHEST_M = 1e8

# Least travel time of sound between recorders that are far apart, s. Beyond it, the
# windows of a compact array, 32 ms, do not contain the same sound in all channels.
_FAR_APART_S = 0.032

# Largest number of microphones. The computing time grows with the number of pairs.
_MOST_MICROPHONES = 64

LEAST_BAND_HZ = 500.0

#: Default lowest frequency of a recording and of a live stream, Hz.
LOWEST_HZ, LOWEST_LIVE_HZ = 300.0, 200.0
#: Default lowest frequency of recorders that are far apart, Hz. Of distant sounds, low
#: frequencies remain.
LOWEST_FAR_APART_HZ = 60.0
#: Default highest frequency, Hz. Lower frequencies suffice to find faults.
HIGHEST_HZ, HIGHEST_FAULTS_HZ = 15_000.0, 8_000.0
#: Upper limit of a default band, as a share of the sample rate. Near half the sample
# rate, the filters of recorders attenuate the sound.
TOP_OF_RATE = 0.45

# _PLACES_SHARE: default standard deviation of positions as a share of the aperture. It
#   corresponds to a tape measure for a large array, and to a circuit board for a small
#   one.
# _PLACES_M: least default standard deviation of positions, m.
# _TEMPERATURE_C: default standard deviation of a stated temperature, deg C.
# _SPEED_SHARE: default relative standard deviation of the speed of sound, if the
#   geometry states neither the speed nor the temperature.
_PLACES_SHARE, _PLACES_M = 0.01, 0.0005
_TEMPERATURE_C, _SPEED_SHARE = 2.0, 0.01

# Tolerance for the symmetry and the eigenvalues of a covariance, as a share of its
# largest variance.
_ROUNDING = 1e-6

# Pairs of fields of which a geometry states at most one.
_ALTERNATIVES = (
    ("sound_speed", "temperature_c"),
    ("position_std_m", "position_covariance_m2"),
    ("sound_speed_std", "temperature_std_c"),
)

_Coordinate = Annotated[float, Field(ge=-_FARTHEST_M, le=_FARTHEST_M)]
_Point2 = Annotated[tuple[_Coordinate, _Coordinate], Strict(False)]
_Point3 = Annotated[tuple[_Coordinate, _Coordinate, _Coordinate], Strict(False)]
_Points2 = Annotated[tuple[_Point2, ...], Strict(False)]
_Points3 = Annotated[tuple[_Point3, ...], Strict(False)]
_Channels = Annotated[tuple[Annotated[int, Field(ge=0)], ...], Strict(False)]
_Band = Annotated[tuple[Positive, Positive], Strict(False)]
_PlaceStd = Annotated[float, Field(ge=0.0)]
_PlaceStds = Annotated[tuple[_PlaceStd, ...], Strict(False)]
_Row = Annotated[tuple[float, ...], Strict(False)]
_Matrix = Annotated[tuple[_Row, ...], Strict(False)]
_Side = Literal["ahead", "behind", "above", "below"]


@dataclass(frozen=True)
class KnownArray:
    """Microphone array with the errors of its description."""

    shape: ArrayShape
    """The microphones, facing the stated side."""
    c: float
    """Speed of sound, m/s."""
    budget: ArrayBudget
    """Errors of the positions, of the speed of sound, and of the channels' sampling
    times."""
    gain_std_db: float = 2.0
    """Standard deviation of a channel's gain, dB."""
    largest_range_error: float = 0.2
    """Largest standard deviation of a reported range, as a share of the range."""
    centroid_m: tuple[float, ...] | None = None
    """Centroid of the microphones in the frame of the geometry file, m. None: zero."""

    @property
    def far_apart(self) -> bool:
        """Whether the microphones are recorders more than about 11 m apart in air."""
        return self.shape.max_delay(self.c) > _FAR_APART_S

    @property
    def misplaced_m(self) -> float:
        """Standard deviation of positions whose delays are those of free air, m."""
        body = self.shape.body
        return math.hypot(self.budget.position_std, body.bend_std_m if body else 0.0)


class ArrayGeometry(Parameters):
    """Contents of a geometry file.

    The default positions are those of the robot's own array.
    """

    microphones: _Points2 | _Points3 = ((0.0, 0.4), (0.0, 0.0), (0.0, -0.4))
    """Positions (x, y) or (x, y, z) of the microphones in the order of the channels, m.
    """
    channels: _Channels | None = None
    """Columns of the recording to use, counted from 0. None: the first columns."""
    sound_speed: float | None = Field(default=None, ge=100.0, le=8000.0)
    """Speed of sound, m/s. None: the speed at the stated temperature, or 340 m/s."""
    temperature_c: float | None = Field(default=None, ge=-50.0, le=60.0)
    """Air temperature, deg C."""
    band: _Band | None = None
    """Lowest and highest frequency of the sound, Hz. None: 300 Hz up to 15000 Hz or
    0.45 times the sample rate, whichever is lower. If nearly all sound is above 15000
    Hz, or if the microphones are more than about 11 m apart, ``locate`` finds the band
    of the sound instead."""
    position_std_m: _PlaceStd | _PlaceStds | None = None
    """Standard deviation of each coordinate of the microphones, m. Give one value for
    all microphones, or one value per microphone. None: 1 % of the aperture, but at
    least 0.5 mm."""
    position_covariance_m2: _Matrix | None = None
    """Covariance of the microphone coordinates, m^2, instead of ``position_std_m``.
    Give the covariance of one microphone, which then applies to all. Or give the
    covariance of all coordinates in the order of the microphones."""
    orientation_std_deg: float = Field(default=0.0, ge=0.0, le=90.0)
    """Standard deviation of the orientation of the whole array about each axis, deg. It
    adds to the errors of the positions."""
    sound_speed_std: float | None = Field(default=None, ge=0.0, le=400.0)
    """Standard deviation of the speed of sound, m/s. None: the value that follows from
    the standard deviation of the temperature. If the file states nothing about the air,
    it is 1 % of the speed."""
    temperature_std_c: float | None = Field(default=None, ge=0.0, le=50.0)
    """Standard deviation of the temperature, deg C. None: 2 deg C."""
    delay_std_s: float = Field(default=1e-6, ge=0.0, le=0.01)
    """Standard deviation of the sampling times of each channel, s."""
    gain_std_db: float = Field(default=2.0, ge=0.0, le=40.0)
    """Standard deviation of the gain of each channel, dB. The delays do not depend on
    it. It determines when a channel is reported as much louder than the other channels.
    """
    largest_range_error: float = Field(default=0.2, gt=0.0, le=1.0)
    """Largest standard deviation of a reported range, as a share of the range. Less
    certain ranges are not reported."""
    side: _Side | None = None
    """Side on which all sources are: ahead of or behind a row, above or below a plane.
    None: both sides are possible, and the mirrored direction is reported as an
    alternative."""

    body: ArrayBody | None = None
    """Body that carries the microphones. None: free air."""

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
        for one, other in _ALTERNATIVES:
            if getattr(self, one) is not None and getattr(self, other) is not None:
                raise InputError(
                    one, f"is given together with {other}; keep one of them"
                )
        self._check_band()
        shape = ArrayShape.of(self.microphones)
        if shape.aperture_m > _LARGEST_M:
            raise InputError(
                "microphones",
                f"{shape.aperture_m:g} m apart; give positions in m, at most "
                f"{_LARGEST_M:g} m apart",
            )
        self._check_budget(shape)
        if self.body is not None:
            self.body.check(self.microphones)
        if self.side is not None:
            shape.facing(self.side)
        return self

    def _check_band(self) -> None:
        if self.band is not None and self.band[0] >= self.band[1]:
            raise InputError("band", "must rise, for example [300, 8000]")
        if self.band is not None and self.band[1] - self.band[0] < LEAST_BAND_HZ:
            raise InputError(
                "band",
                f"{list(self.band)} is too narrow to measure delays; give at least "
                f"{LEAST_BAND_HZ:g} Hz",
            )

    def _check_budget(self, shape: ArrayShape) -> None:
        std, covariance = self.position_std_m, self.position_covariance_m2
        if isinstance(std, tuple) and len(std) != shape.count:
            raise InputError(
                "position_std_m",
                f"has {len(std)} values for {shape.count} microphones; give one "
                "for all, or one for each",
            )
        most = max(_LARGEST_STD_M, shape.aperture_m)
        if std is not None and np.max(std) > most:
            raise InputError(
                "position_std_m", f"is {np.max(std):g} m; give at most {most:g} m"
            )
        if covariance is not None:
            _check_covariance(covariance, shape)

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns of the recording to use, one per microphone."""
        return self.channels or tuple(range(len(self.microphones)))

    @property
    def c(self) -> float:
        """Speed of sound, m/s."""
        if self.sound_speed is not None:
            return self.sound_speed
        if self.temperature_c is not None:
            return sound_speed(self.temperature_c)
        return SOUND_SPEED_M_S

    @property
    def known(self) -> KnownArray:
        """The array with the errors of its description, as the estimators need it."""
        shape = ArrayShape.of(self.microphones)
        turns = math.radians(self.orientation_std_deg) * rotations(shape.p_AM)
        of_places = self._of_places(shape) + turns @ turns.T
        delay_std, speed_std = self.delay_std_s, self._speed_std()
        if self.body is not None:
            band = self.band or (LOWEST_HZ, HIGHEST_FAULTS_HZ)
            body = self.body.sphere(self.microphones, band, self.c)
            p = body.scale * np.array(self.microphones)
            shape = replace(ArrayShape.of(p), body=body)
            of_places = body.scale**2 * of_places
            delay_std = math.hypot(delay_std, body.arrival_std_s)
            # Delays that are too long by a share are those of slower sound.
            speed_std = math.hypot(speed_std, body.scale_std * self.c)
        return KnownArray(
            shape=shape if self.side is None else shape.facing(self.side),
            c=self.c,
            budget=ArrayBudget(of_places, speed_std, delay_std),
            gain_std_db=self.gain_std_db,
            largest_range_error=self.largest_range_error,
            centroid_m=tuple(np.mean(self.microphones, axis=0).tolist()),
        )

    def _of_places(self, shape: ArrayShape) -> NDArray[np.float64]:
        if self.position_covariance_m2 is not None:
            given = np.array(self.position_covariance_m2)
            alike = len(given) == shape.dimension
            return np.kron(np.eye(shape.count), given) if alike else given
        std = self.position_std_m
        if std is None:
            std = max(_PLACES_SHARE * shape.aperture_m, _PLACES_M)
        each = np.broadcast_to(np.array(std), shape.count)
        return np.diag(np.repeat(each**2, shape.dimension))

    def _speed_std(self) -> float:
        if self.sound_speed_std is not None:
            return self.sound_speed_std
        unsaid = self.sound_speed is None and self.temperature_c is None
        if unsaid and self.temperature_std_c is None:
            return _SPEED_SHARE * self.c
        std = self.temperature_std_c
        warmer = sound_speed(_TEMPERATURE_C if std is None else std)
        return warmer - sound_speed(0.0)


#: The robot's own array, built to an accuracy of 1 mm.
ROBOT_ARRAY = ArrayGeometry(position_std_m=0.001)


def _check_covariance(given: tuple[tuple[float, ...], ...], shape: ArrayShape) -> None:
    sizes = (shape.dimension, shape.p_AM.size)
    if len(given) not in sizes or any(len(row) != len(given) for row in given):
        raise InputError(
            "position_covariance_m2",
            f"has {len(given)} rows of {sorted({len(row) for row in given})}; give "
            f"{sizes[0]} x {sizes[0]} for a microphone, or {sizes[1]} x {sizes[1]} for "
            "all coordinates of all",
        )
    matrix = np.array(given)
    scale = max(float(np.abs(np.diag(matrix)).max()), 1e-30)
    if np.abs(matrix - matrix.T).max() > _ROUNDING * scale:
        raise InputError(
            "position_covariance_m2", "is not symmetric; give a covariance, m^2"
        )
    if np.linalg.eigvalsh(matrix)[0] < -_ROUNDING * scale:
        raise InputError(
            "position_covariance_m2",
            "has a negative variance in some direction; give a covariance, m^2",
        )


def usable_band(
    band_hz: tuple[float, float] | None,
    sample_rate_hz: float,
    lowest_hz: float = LOWEST_HZ,
    highest_hz: float = HIGHEST_HZ,
) -> tuple[float, float]:
    """Returns the stated band, or the default band at a sample rate."""
    return band_hz or (lowest_hz, min(highest_hz, TOP_OF_RATE * sample_rate_hz))


def make_geometry(
    geometry: ArrayGeometry | str | Path | Sequence[Sequence[float]] | None,
) -> ArrayGeometry:
    """Makes a geometry from a geometry, a path, a list of positions in m, or None.

    None stands for the robot's own array.
    """
    if geometry is None:
        return ROBOT_ARRAY
    if isinstance(geometry, ArrayGeometry):
        return geometry
    if isinstance(geometry, str | Path):
        return load_geometry(geometry)
    try:
        places = tuple(tuple(float(x) for x in place) for place in geometry)
        return ArrayGeometry.model_validate({"microphones": places})
    except ValidationError as error:
        raise InputError("geometry", _first_error(error)) from None
    except (TypeError, ValueError):
        raise InputError(
            "geometry",
            "is not a list of positions; give [x, y] or [x, y, z] of each in m",
        ) from None


def load_geometry(path: str | Path) -> ArrayGeometry:
    """Reads a YAML file with ``microphones`` and optionally the other fields."""
    path = require_file(path, "geometry", "YAML")
    try:
        content = parse_yaml(path.read_text(encoding="utf-8"), "geometry")
    except InputError as error:
        raise InputError(
            "geometry", f"{str(path)!r} is not usable as YAML: it {error.message}"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            "geometry",
            f"cannot read {str(path)!r} ({error}); give the path of a YAML file",
        ) from None
    if not isinstance(content, dict) or "microphones" not in content:
        raise InputError(
            "geometry",
            f"{str(path)!r} lists no microphones; write for example 'microphones: "
            "[[0, 0.4], [0, 0], [0, -0.4]]'",
        )
    try:
        return ArrayGeometry(**content)
    except ValidationError as error:
        raise InputError("geometry", f"{str(path)!r}: {_first_error(error)}") from None


def _first_error(error: ValidationError) -> str:
    first = error.errors()[0]
    # The path of the error also contains the members of a union, as names in brackets.
    where = ".".join(str(part) for part in first["loc"] if "[" not in str(part))
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] in {"tuple_type", "too_short", "too_long"}:
        message = f"is {first['input']}; give [x, y] or [x, y, z] of each microphone"
        if first["loc"][0] != "microphones":
            message = f"is {first['input']}; give a list, as in the documentation"
    if first["type"] == "extra_forbidden":
        message = "unknown key; remove it"
    return f"{where}: {message}" if where else message
