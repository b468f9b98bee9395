"""From sound pressure to counts: microphone, amplifier and converter."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field, Strict, model_validator

from systems.framework.finite import check_finite
from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Fraction,
    Parameters,
    Period,
    Positive,
    Time,
)
from systems.framework.signals import SAMPLE_RATE_HZ, TICK_S, whole

__all__ = [
    "MicArrayParameters",
    "MicrophoneFaultParameters",
    "channel_skew",
    "check_faults",
    "convert",
]


class MicrophoneFaultParameters(Parameters):
    """A microphone that fails in a run, and how."""

    microphone: int = Field(default=1, ge=1, le=64)
    """Which one, from 1."""
    kind: Literal["dead", "frozen"] = "dead"
    """``dead``: its counts are 0; ``frozen``: they rest at a quarter of full scale."""
    start_s: Time = 0.0
    """When that begins, s."""


class MicArrayParameters(Parameters):
    """Microphones, amplifier and converter (Han 2019, 4.1)."""

    sample_rate_hz: float = Field(default=100_000.0, ge=1_000.0, le=SAMPLE_RATE_HZ)
    """Rate of the converter, Hz; at most that at which sound is computed.

    No filter stands before the converter: what sounds above half the rate is folded.
    """
    frame_s: Period = TICK_S
    """Length of a frame, and time from one to the next, s: so often the robot hears."""
    snr_db_at_1m: float = Field(default=30.0, ge=-40.0, le=150.0)
    """Level of the source at 1 m over the noise, dB.

    The noise is white and Gaussian up to half the sample rate, of equal power in every
    channel and independent of distance.
    """
    sensitivity_db: float = Field(default=-23.0, ge=-120.0, le=40.0)
    """Sensitivity of the microphones, dB re 1 V/Pa."""
    preamplifier_gain_db: float = Field(default=40.0, ge=-40.0, le=120.0)
    """Gain between microphone and converter, dB."""
    adc_full_scale_v: Positive = 1.65
    """Voltage at which the converter clips, V, of either sign."""
    adc_bits: int = Field(default=10, ge=2, le=16)
    """Resolution of the converter, bits."""
    channel_skew_s: Annotated[tuple[Time, ...], Strict(False)] = ()
    """Time by which each channel is sampled later, s; below one sample.

    One time for each microphone, or none where all are sampled at once.
    """

    ego_noise_file: str | None = None
    """Recording of the robot's own noise (WAV, FLAC ...), repeated for ever.

    One channel for all microphones, or one for each.
    """
    ego_noise_snr_db_at_1m: float = Field(default=20.0, ge=-40.0, le=150.0)
    """Level of the source at 1 m over the ego noise at top speed, dB."""
    ego_noise_share_at_rest: Fraction = 1.0
    """Amplitude of the ego noise at rest over that at top speed; linear between."""
    position_tolerance_m: float = Field(default=0.0, ge=0.0, le=0.1)
    """Each microphone stands off its place by up to this in x and in y, m.

    This error and the next two are uniform, and drawn once from the seed.
    """
    delay_tolerance_s: float = Field(default=0.0, ge=0.0, le=1e-4)
    """Each channel is sampled up to this earlier or later, s."""
    gain_tolerance_db: float = Field(default=0.0, ge=0.0, le=40.0)
    """The gain of each channel, noise included, is off by up to this, dB."""
    faults: Annotated[
        tuple[MicrophoneFaultParameters, ...], Strict(False), Field(max_length=64)
    ] = ()
    """Microphones that fail in a run."""

    @model_validator(mode="after")
    def _check(self) -> MicArrayParameters:
        sample = 1.0 / self.sample_rate_hz
        if not all(0.0 <= skew < sample for skew in self.channel_skew_s):
            raise InputError(
                "channel_skew_s",
                f"{self.channel_skew_s} must lie in [0, {sample:g}) s, one sample",
            )
        if not whole(samples := self.frame_s * self.sample_rate_hz):
            raise InputError(
                "sample_rate_hz",
                f"{self.sample_rate_hz:g} Hz gives {samples:.4f} samples in a frame of "
                f"{self.frame_s:g} s; use {round(samples) / self.frame_s:g}",
            )
        failing = [fault.microphone for fault in self.faults]
        if len({*failing}) < len(failing):
            raise InputError(
                "faults", f"microphones {failing}: two faults of one; leave one of each"
            )
        return self

    @cached_property
    def frame_samples(self) -> int:
        """Samples a channel in a frame."""
        return round(self.frame_s * self.sample_rate_hz)

    @cached_property
    def full_scale(self) -> int:
        """Counts of the positive full scale."""
        return 2 ** (self.adc_bits - 1)

    @cached_property
    def counts_per_pa(self) -> float:
        """Counts for one pascal."""
        gain = 10.0 ** ((self.sensitivity_db + self.preamplifier_gain_db) / 20.0)
        return gain * self.full_scale / self.adc_full_scale_v


def channel_skew(parameters: MicArrayParameters, count: int) -> NDArray[np.float64]:
    """(count,) s by which each channel is sampled later.

    Args:
        parameters: Have the skew; empty: none.
        count: Number of microphones.

    Returns:
        (count,) s.

    Raises:
        InputError: The skew is given for another number of channels.
    """
    skew = parameters.channel_skew_s
    if len(skew) not in (0, count):
        raise InputError(
            "microphones.channel_skew_s",
            f"{skew} has {len(skew)} times for {count} "
            "microphones; give one for each, or []",
        )
    return np.array(skew) if skew else np.zeros(count)


def check_faults(parameters: MicArrayParameters, count: int) -> None:
    """Refuses faults of microphones that are not there.

    Args:
        parameters: Have the faults.
        count: Number of microphones.

    Raises:
        InputError: One is beyond the last microphone.
    """
    beyond = [f.microphone for f in parameters.faults if f.microphone > count]
    if beyond:
        raise InputError(
            "microphones.faults",
            f"microphone {beyond[0]} of {count}; give a number from 1 to {count}",
        )


@njit(cache=True)
def _silent_counts(
    noise: NDArray[np.float32],
    gains: NDArray[np.float64],
    sigma: float,
    full_scale: np.float32,
    out: NDArray[np.int16],
) -> int:  # pragma: no cover  (compiled)
    """As ``_counts``, without pressure."""
    spoiled: Any = 0
    for m in range(noise.shape[0]):
        level = np.float32(gains[m] * sigma)
        for k in range(noise.shape[1]):
            x = np.rint(level * noise[m, k])
            spoiled |= np.int32(x - x != np.float32(0.0))
            out[m, k] = np.int16(min(max(x, -full_scale), full_scale - np.float32(1)))
    return spoiled


@njit(cache=True)
def _counts(
    pressure: NDArray[np.float32],
    noise: NDArray[np.float32],
    gains: NDArray[np.float64],
    gain: float,
    sigma: float,
    full_scale: np.float32,
    out: NDArray[np.int16],
) -> int:  # pragma: no cover  (compiled)
    """Fills in the counts; not 0 where a value was not finite."""
    spoiled: Any = 0
    for m in range(noise.shape[0]):
        factor, level = np.float32(gains[m] * gain), np.float32(gains[m] * sigma)
        for k in range(noise.shape[1]):
            x = np.rint(factor * pressure[m, k] + level * noise[m, k])
            spoiled |= np.int32(x - x != np.float32(0.0))
            out[m, k] = np.int16(min(max(x, -full_scale), full_scale - np.float32(1)))
    return spoiled


def convert(
    pressure: NDArray[np.float32] | None,
    noise: NDArray[np.float32],
    noise_pa: float,
    parameters: MicArrayParameters,
    gains: NDArray[np.float64] | None = None,
) -> NDArray[np.int16]:
    """Counts of the converter, rounded to nearest and clipped.

    Args:
        pressure: (m, n) sound pressure, Pa; None for silence.
        noise: (m, n) noise of unit variance.
        noise_pa: RMS of the noise, Pa.
        parameters: Sensitivity, gain and resolution.
        gains: (m,) true over stated gain of each channel; 1 unless given.

    Returns:
        (m, n) counts in [-2^(bits - 1), 2^(bits - 1) - 1].

    Raises:
        ValueError: Pressure, noise or a gain is not finite; a count would not tell.
    """
    if gains is None:
        gains = np.ones(len(noise))
    gain = parameters.counts_per_pa
    sigma = gain * noise_pa
    full_scale = np.float32(parameters.full_scale)
    out = np.empty(noise.shape, dtype=np.int16)
    if pressure is None:
        spoiled = _silent_counts(noise, gains, sigma, full_scale, out)
    else:
        spoiled = _counts(pressure, noise, gains, gain, sigma, full_scale, out)
    if spoiled:
        _check_parts(pressure=pressure, noise=noise, gains=gains)
    return out


def _check_parts(**parts: Any) -> None:
    """Refuses parts of a frame that are not finite."""
    for name, values in parts.items():
        if values is not None:
            check_finite(f"MicArray: {name}", values)
