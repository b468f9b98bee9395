"""Corrects the channels of recordings, and makes their spectra."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import (
    HIGHEST_HZ,
    LEAST_BAND_HZ,
    LOWEST_FAR_APART_HZ,
    LOWEST_HZ,
    TOP_OF_RATE,
    ArrayGeometry,
    usable_band,
)
from analysis.arrays.channel_changes import recorded_change
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.channel_faults import find_channel_faults
from analysis.arrays.channel_timing import LagSearch
from analysis.arrays.clock_drift import recording_drift
from analysis.arrays.frame_delays import exchanged
from analysis.arrays.processed_channels import processed_channel
from analysis.arrays.recorded_samples import RecordedSamples
from analysis.arrays.recording_search import RecordingSearch
from analysis.arrays.recording_spectra import RecordingSpectra
from analysis.arrays.standing_sounds import sounding_band, standing_sound
from analysis.arrays.tone_search import ToneSearch
from systems.framework.input_error import InputError

#: Numbers of snapshots per stretch to try, in this order. A faint or distant source
#: needs more snapshots.
SNAPSHOTS = (8, 32, 128)
#: Number of stretches with a source that ends the trials.
LEAST_SIGHTINGS = 3

# Kinds of faults that make it impossible to locate a source.
_FATAL = ("nan", "dead", "copied", "units", "speed", "unaligned", "drift")

# Kinds of faults whose channels have the wrong sign.
_NEGATIVE = ("inverted", "directional")

# Largest share of audible sound in a recording of ultrasound, and least share of the
# power of such a recording that belongs to its sounds.
_AUDIBLE, _LEAST_SHARE = 0.05, 0.02

# Kinds of faults that follow from delays within the array. Whole periods of a tone do
# not explain longer delays, on which several channels agree.
_OF_DELAYS = ("drift", "geometry", "size", "speed", "swapped", "units")

# Largest number of channels in one message.
_MOST_NAMED = 8


class PreparedRecording(NamedTuple):
    """A recording without the faults that can be corrected."""

    spectra: RecordingSpectra
    faults: list[ChannelFault]
    """Faults of channels that are corrected, left out, or doubtful."""
    geometry: ArrayGeometry
    """The array without the microphones that are left out."""


def chosen_microphones(geometry: ArrayGeometry, chosen: Sequence[int]) -> ArrayGeometry:
    """Makes the geometry of an array with only the chosen microphones, counted from 0.

    Raises a ValueError if there are too few chosen microphones for an array.
    """
    fields = geometry.model_dump(exclude_unset=True)
    fields["microphones"] = [geometry.microphones[k] for k in chosen]
    fields["channels"] = [geometry.columns[k] for k in chosen]
    if isinstance(std := geometry.position_std_m, tuple):
        fields["position_std_m"] = [std[k] for k in chosen]
    if geometry.position_covariance_m2 is not None:
        matrix = np.array(geometry.position_covariance_m2)
        axes = len(geometry.microphones[0])
        if len(matrix) > axes:
            rows = [axes * k + axis for k in chosen for axis in range(axes)]
            fields["position_covariance_m2"] = matrix[np.ix_(rows, rows)].tolist()
    return ArrayGeometry(**fields)


def prepared_recording(
    recorded: RecordedSamples,
    geometry: ArrayGeometry,
    *,
    top_hz: float = math.inf,
    trusts_positions: bool = True,
) -> PreparedRecording:
    """Returns the spectra of the array's channels, and the faults worth reporting.

    Inverted channels are corrected, and channels that change within the recording are
    left out. Frequencies above ``top_hz`` are not used, but the band is at least 500 Hz
    wide. If the positions of the microphones are uncertain, delays cannot reveal these
    changes, exchanged channels or drifting clocks.
    """
    samples, rate, where = recorded.samples, recorded.rate, recorded.name
    known = geometry.known
    shape = known.shape
    whole = geometry.columns == tuple(range(len(samples)))
    channels = samples if whole else samples[list(geometry.columns)]
    low, high = _band(channels, geometry, float(rate))
    high = min(high, max(top_hz, low + LEAST_BAND_HZ))

    def spectra(channels: NDArray[np.float64]) -> RecordingSpectra:
        equal = np.empty(channels.shape, dtype=np.float32)
        for row, channel in zip(equal, channels, strict=True):
            row[:] = (channel - channel.mean()) / channel.std()
        levels = tuple(channels.std(axis=1).tolist())
        travel_s = shape.max_delay(known.c)
        return RecordingSpectra(equal, float(rate), low, high, travel_s, levels)

    def agreement(channels: NDArray[np.float64]) -> float:
        search = RecordingSearch(spectra(channels), shape, known.c, SNAPSHOTS[0])
        return search.mean_response()

    processed = processed_channel(samples, geometry.columns, shape, known.c, rate)
    if processed is not None:
        raise InputError("recording", f"{where}: {_not_of_a_microphone(*processed)}")
    change = drift = None
    # On a body, the delays of a source that moves fit no wave front in free air.
    in_air = shape.body is None and not known.far_apart
    delays_tell = trusts_positions and in_air
    if delays_tell and np.isfinite(channels).all():
        change = _change(channels, geometry, float(rate), where)
        if change is None:
            drift = recording_drift(channels, float(rate), shape.p_AM, known.c)
    faults = [] if drift is None else [drift]
    omitted = () if change is None else change.channels
    # The delays of drifting channels fit no position, so no other check of delays
    # applies.
    if drift is None or drift.kind != "drift":
        faults += find_channel_faults(
            channels,
            known,
            sample_rate_hz=float(rate),
            band_hz=geometry.band or ((low, high) if low > LOWEST_HZ else None),
            omitted=omitted,
        )
    if any(f.kind in _OF_DELAYS for f in faults):
        # Delays of tones are known except for whole periods.
        tones = ToneSearch(spectra(channels), known)
        if tones.are_most:
            faults = [fault for fault in faults if fault.kind not in _OF_DELAYS]
    if not trusts_positions:
        faults = [f for f in faults if f.kind not in ("swapped", "speed")]
    channels, faults = channels_without_faults(channels, faults, agreement, where)
    if change is not None:
        left = [k for k in range(shape.count) if k not in omitted]
        geometry, channels = chosen_microphones(geometry, left), channels[left]
        faults = [change, *faults]
        shape = geometry.known.shape
    recording = spectra(channels)
    if not recording.starts.size and not known.far_apart:
        raise InputError(
            "recording",
            f"{where} lasts {1e3 * channels.shape[1] / rate:.3g} ms, too short for an "
            f"array of {shape.aperture_m:.3g} m; record at least "
            f"{1e3 * recording.least_samples / rate:.3g} ms",
        )
    return PreparedRecording(recording, faults, geometry)


def _change(
    channels: NDArray[np.float64], geometry: ArrayGeometry, rate: float, where: str
) -> ChannelFault | None:
    """Finds channels that change, and rejects a recording with too few others."""
    numbers = range(len(channels))
    search = LagSearch.of(geometry.known, rate, geometry.band, numbers)
    change = recorded_change(channels, search)
    if change is None:
        return None
    try:
        left = [k for k in numbers if k not in change.channels]
        chosen_microphones(geometry, left)
    except ValueError:
        raise InputError("recording", f"{where}: {change.message}") from None
    return replace(change, message=f"{change.message}; it is left out")


def _not_of_a_microphone(channel: int, observation: str) -> str:
    return (
        f"channel {channel + 1}: processed, because it {observation}; name the columns "
        "of the microphones in 'channels' ([1, 2, 3, 4] for a ReSpeaker with six "
        "channels)"
    )


def _band(
    channels: NDArray[np.float64], geometry: ArrayGeometry, sample_rate_hz: float
) -> tuple[float, float]:
    """Returns the band to use, Hz.

    The default band leaves out ultrasound, unless nearly all sound is ultrasound.
    """
    low, high = usable_band(geometry.band, sample_rate_hz)
    top = TOP_OF_RATE * sample_rate_hz
    if geometry.band is not None:
        return low, high
    if geometry.known.far_apart:
        return LOWEST_FAR_APART_HZ, top
    if top <= HIGHEST_HZ:
        return low, high
    loudest = channels[int(np.argmax(np.nan_to_num(np.var(channels, axis=1))))]
    if not np.isfinite(loudest).all():
        return low, high
    sound = standing_sound(loudest.astype(np.float32), sample_rate_hz, (low, top))
    step = sample_rate_hz / (2.0 * (sound.of_bins.size - 1))
    below = sound.of_bins[: math.ceil(HIGHEST_HZ / step)].sum()
    band = sounding_band(sound, sample_rate_hz)
    kept = float(np.mean(sound.samples**2)) > _LEAST_SHARE * float(np.var(loudest))
    if band is None or not kept or below > _AUDIBLE * sound.of_bins.sum():
        return low, high
    first = max(low, band[0])
    return first, min(max(band[1], first + LEAST_BAND_HZ), top)


def channels_without_faults(
    samples: NDArray[np.float64],
    faults: list[ChannelFault],
    agreement: Callable[[NDArray[np.float64]], float],
    where: str,
) -> tuple[NDArray[np.float64], list[ChannelFault]]:
    """Corrects inverted channels, and rejects recordings with serious faults.

    Exchanged channels are not corrected. Either the cables or the geometry file may be
    wrong, and only the user can know which. The result of ``agreement`` is larger if
    channels fit the geometry better. The returned faults are those that remain worth
    reporting.
    """
    fatal = [fault for fault in faults if fault.kind in _FATAL]
    if fatal:
        first, *rest = fatal
        further = sorted(
            {k + 1 for f in rest for k in f.channels if k not in first.channels}
        )
        names = ", ".join(map(str, further[:_MOST_NAMED]))
        names += " ..." if len(further) > _MOST_NAMED else ""
        more = f"; check channels {names} as well" if further else ""
        raise InputError("recording", f"{where}: {first.message}{more}")
    inverted = [k for f in faults if f.kind in _NEGATIVE for k in f.channels]
    if inverted:
        samples = samples.copy()
        samples[inverted] *= -1.0
    as_given = agreement(samples) if any(f.kind == "swapped" for f in faults) else 0.0
    for fault in faults:
        pairs = combinations(fault.channels, 2) if fault.kind == "swapped" else ()
        if any(agreement(exchanged(samples, *pair)) > as_given for pair in pairs):
            raise InputError("recording", f"{where}: {fault.message}")
    return samples, [fault for fault in faults if fault.kind != "swapped"]
