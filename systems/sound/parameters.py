"""Parameters of sounds, microphones, converter and room."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Duration,
    Frequency,
    Length,
    Parameters,
    Period,
    Point,
    Positive,
    Time,
)
from systems.framework.signals import SAMPLE_RATE_HZ, TICK_S, whole

#: Frequencies that the microphones pass, Hz (Han 2019, 4.1). The filter is applied to
#: the waveform of the loudspeaker. A linear filter that is the same for all microphones
#: commutes with propagation, apart from a Doppler shift of about 0.1 %.
MICROPHONE_BAND_HZ = (50.0, 18_000.0)

#: Sound pressure at full scale, Pa: the largest pressure that the converter does not
#: clip. The sensitivity of the microphones is -23 dB re 1 V/Pa. The gain of the
#: preamplifier is 40 dB (Han 2019, 4.1). The converter clips at 1.65 V (our choice).
FULL_SCALE_PA = 1.65 / 10.0 ** ((-23.0 + 40.0) / 20.0)

#: Length of the raised-cosine edges of every burst, s. The edges prevent clicks.
EDGE_S = 0.004


class SoundParameters(Parameters):
    """Waveform, level and schedule of the sound (Han 2019, 4.1: 0.5 s in every 2 s)."""

    kind: Literal["chirp", "band_noise", "tone", "horn", "siren", "wav"] = "chirp"
    """Waveform; ``wav`` plays the sound file ``file``."""
    file: str | None = None
    """Sound file (WAV, FLAC ...) with one channel and any sample rate and bit depth.
    Used only for ``kind: wav``."""
    low_hz: Frequency = 500.0
    """Lower end of the band of chirp and band noise, Hz."""
    high_hz: Frequency = 8_000.0
    """Upper end of the band of chirp and band noise, Hz."""
    tone_hz: Frequency = 2_000.0
    """Frequency of the tone and fundamental of the horn, Hz."""
    level_pa: Positive = 0.05
    """RMS pressure at 1 m while the source sounds, Pa (0.05 Pa is 68 dB). The peaks
    are at most four times this value. A sound with higher peaks is played at a lower
    level."""
    on_s: float = Field(default=0.5, ge=2 * EDGE_S, le=60.0)
    """Length of a burst, s."""
    period_s: Duration = 2.0
    """Time from the start of one burst to the start of the next, s. If it equals
    ``on_s``, the sound is continuous, apart from the soft edges of the bursts."""
    start_s: Time = 0.0
    """Start of the first burst, s."""

    @model_validator(mode="after")
    def _check(self) -> SoundParameters:
        if self.on_s > self.period_s:
            raise InputError(
                "on_s",
                f"{self.on_s} is longer than period_s {self.period_s}; shorten it",
            )
        if self.low_hz >= self.high_hz:
            raise InputError(
                "low_hz", f"{self.low_hz} is not below high_hz {self.high_hz}; lower it"
            )
        top = MICROPHONE_BAND_HZ[1]
        for name in ("high_hz", "tone_hz"):
            if getattr(self, name) > top:
                raise InputError(
                    f"{name}",
                    f"{getattr(self, name)} is above the {top:g} Hz that "
                    "the microphones pass; lower it",
                )
        if self.kind == "wav" and self.file is None:
            raise InputError("file", "kind is wav but no file is given; name a file")
        if self.kind != "wav" and self.file is not None:
            raise InputError(
                "file",
                f"{self.file!r} is not used by kind: {self.kind}; set kind to "
                "wav, or leave the file out",
            )
        return self

    def sounds(self, time: Any) -> Any:
        """Returns whether the source sounds at a time, s, or at an array of times."""
        phase = time - self.start_s
        return (phase >= 0.0) & (phase % self.period_s < self.on_s)


class MicArrayParameters(Parameters):
    """Microphones, amplifier and converter (Han 2019, 4.1)."""

    sample_rate_hz: float = Field(default=100_000.0, ge=1_000.0, le=SAMPLE_RATE_HZ)
    """Sample rate of the converter, Hz. It is at most the rate at which the sound is
    computed.

    There is no filter before the converter. Sound above half the sample rate is
    therefore aliased.
    """
    frame_s: Period = TICK_S
    """Length of a frame, and time from one frame to the next, s. The robot hears once
    per frame."""
    snr_db_at_1m: float = Field(default=30.0, ge=-40.0, le=150.0)
    """Level of the source at 1 m relative to the noise, dB.

    The noise is white and Gaussian up to half the sample rate. It has equal power in
    every channel and does not depend on distance.
    """
    adc_bits: int = Field(default=10, ge=2, le=16)
    """Resolution of the converter, bits."""
    ego_noise_file: str | None = None
    """Recording of the noise of the robot itself (WAV, FLAC ...). The recording is
    repeated without end.

    The recording has one channel for all microphones, or one channel for each
    microphone.
    """
    ego_noise_snr_db_at_1m: float = Field(default=20.0, ge=-40.0, le=150.0)
    """Level of the source at 1 m relative to the ego noise, dB."""

    @model_validator(mode="after")
    def _check(self) -> MicArrayParameters:
        if not whole(samples := self.frame_s * self.sample_rate_hz):
            raise InputError(
                "sample_rate_hz",
                f"{self.sample_rate_hz:g} Hz gives {samples:.4f} samples in a frame of "
                f"{self.frame_s:g} s; use {round(samples) / self.frame_s:g}",
            )
        return self

    @cached_property
    def frame_samples(self) -> int:
        """Number of samples per channel in a frame."""
        return round(self.frame_s * self.sample_rate_hz)

    @cached_property
    def full_scale(self) -> int:
        """Counts of the positive full scale."""
        return 2 ** (self.adc_bits - 1)

    @cached_property
    def counts_per_pa(self) -> float:
        """Number of counts per pascal."""
        return self.full_scale / FULL_SCALE_PA


#: Largest allowed number of reflections of one sound. It leads to more than four
#: million image sources.
GREATEST_ORDER = 150

#: Height of all loudspeakers and microphones above the floor of a room, m.
HEIGHT_M = 0.3

#: Period at which the poses for the reflections in a room are updated, s. It is rounded
#: to a whole number of frames.
UPDATE_PERIOD_S = 0.1


class RoomParameters(Parameters):
    """A shoebox room around the floor of W, only for sound: robots do not hit walls."""

    size_m: Annotated[tuple[Length, Length, Length], Strict(False)] = (
        7.0,
        7.0,
        3.0,
    )
    """Extents along x and y of W, and height, m."""
    corner_m: Point | None = None
    """Corner of smallest x and y, in the world frame W, m.

    If the corner is not set, the origin of W is in the middle of the floor.
    """
    reverberation_time_s: float = Field(default=0.4, ge=1e-3, le=20.0)
    """Time in which sound decays by 60 dB according to Sabine's formula, s.

    The simulated decay agrees with this time in compact rooms that absorb little. For
    example, take a room of 7 x 7 x 3 m and the settings 0.25, 0.4 and 0.6 s. The decay
    from -5 to -35 dB then corresponds to 0.25, 0.45 and 0.72 s.
    """
    absorption: float | None = Field(default=None, gt=0.0, le=1.0)
    """Share of the energy that the walls, floor and ceiling absorb at each reflection.

    If this field is set, it determines the reverberation time.
    """
    maximum_order: int | None = Field(default=None, ge=1, le=GREATEST_ORDER)
    """Largest number of reflections that one sound undergoes.

    If the field is not set, all reflections that arrive within the reverberation time
    are computed.
    """

    @model_validator(mode="after")
    def _check(self) -> RoomParameters:
        if self.size_m[2] <= HEIGHT_M:
            raise InputError(
                "size_m",
                f"the ceiling at {self.size_m[2]} m is not above the loudspeakers and "
                f"microphones at {HEIGHT_M} m; raise it",
            )
        return self

    @property
    def corner(self) -> NDArray[np.float64]:
        """(2,) corner of smallest x and y, in the world frame W, m."""
        if self.corner_m is None:
            return np.array(self.size_m[:2]) / -2.0
        return np.array(self.corner_m)

    def contains(self, p_W: ArrayLike) -> bool:
        """Returns whether all points (..., 2) in W are between the walls."""
        inside = np.asarray(p_W) - self.corner
        return bool(np.all((inside > 0.0) & (inside < self.size_m[:2])))

    def walls(self, c: float) -> tuple[float, float, int]:
        """Computes the acoustic properties of the walls.

        Args:
            c: Speed of sound, m/s.

        Returns:
            Three values: share of the energy that is absorbed at each reflection;
            reverberation time, s; and largest number of reflections that one sound
            undergoes.

        Raises:
            InputError: The reverberation time is too short for the size of the room, or
                it needs more reflections than ``GREATEST_ORDER``.
        """
        size = np.array(self.size_m)
        sabine = float(12.0 * math.log(10.0) / (c * np.sum(1.0 / size)))
        absorption, time = self.absorption, self.reverberation_time_s
        if absorption is not None:
            time = sabine / absorption
        elif time <= sabine:
            raise InputError(
                "room.reverberation_time_s",
                f"{time} s is too short for a room of "
                f"{self.size_m} m; {sabine:.2g} s would take walls that absorb all",
            )
        # By the Cauchy-Schwarz inequality, the sound of an image of order n travels at
        # least (n - 3) / sqrt(sum(size^-2)).
        order = math.ceil(c * time * math.sqrt(np.sum(size**-2.0))) + 2
        order = self.maximum_order or order
        if order > GREATEST_ORDER:
            raise InputError(
                "room.maximum_order",
                f"a reverberation time of {time:.2g} s takes "
                f"reflections of order {order} in a room of {self.size_m} m; set it to "
                f"{GREATEST_ORDER} or less",
            )
        return absorption or sabine / time, time, order
