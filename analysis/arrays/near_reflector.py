"""Finds a reflector close to an array, from levels that differ between channels.

Sound from a distant source has the same spectrum at all microphones of a small array. A
reflection that arrives within a millisecond makes some frequencies louder and others
quieter, and not the same ones at each microphone. Later reflections, such as those of a
room, change many narrow bands, but hardly the level of wide bands.
"""

from __future__ import annotations

import numpy as np

from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.recording_spectra import RecordingSpectra

# Width of the frequency bands, Hz. It separates reflections before about 2 ms from
# later ones.
_BAND_HZ = 500.0
_LEAST_BANDS = 4

# Least weight of a band, as a share of the largest weight. Other bands are noise.
_LEAST_WEIGHT = 0.05

# Least root mean square of the differences, dB. Simulated rooms cause up to 0.5 dB, and
# walls 10 cm behind small arrays cause 1.1 to 3 dB.
_LEAST_DB = 1.0

# Least number of snapshots. Fewer snapshots have too few frequencies with sound.
_LEAST_SNAPSHOTS = 10

# Longest travel time of sound along an array with equal spectra at all microphones, s.
_LONGEST_S = 1e-3

_BLOCK = 64


def near_reflector(recording: RecordingSpectra) -> ChannelFault | None:
    """Returns a warning if a surface close to the array reflects sound."""
    if recording.travel_s > _LONGEST_S or len(recording.starts) < _LEAST_SNAPSHOTS:
        return None
    off_db = spectral_difference_db(recording)
    if off_db is None or off_db < _LEAST_DB:
        return None
    return ChannelFault(
        "reflector",
        (),
        f"the spectra of the channels differ by {off_db:.1f} dB: a surface within "
        "about 0.3 m reflects sound, the case shadows microphones, or microphones are "
        "unequal; directions can be wrong by tens of degrees; move the array away from "
        "surfaces",
    )


def spectral_difference_db(recording: RecordingSpectra) -> float | None:
    """Computes how much the spectra of channels differ in wide bands, dB.

    The result is the root mean square over channels and bands. Gains of the channels
    have no effect. It is None if the sound has too few bands.
    """
    weights, size = recording.weights, len(recording.channels)
    of_bins = np.zeros((size, weights.shape[1]))
    for k in range(0, len(weights), _BLOCK):
        block = slice(k, min(k + _BLOCK, len(weights)))
        power = np.abs(recording.spectra(block)) ** 2
        mean = np.maximum(power.mean(axis=0), np.finfo(np.float32).tiny)
        of_bins += np.einsum("nkf,kf->nf", power, weights[block] / mean)
    f_hz = recording.angular_frequency / (2.0 * np.pi)
    starts = np.flatnonzero(np.diff((f_hz - f_hz[0]) // _BAND_HZ, prepend=-1.0))
    whole = np.add.reduceat(weights.sum(axis=0), starts)
    loud = whole > _LEAST_WEIGHT * whole.max()
    if np.count_nonzero(loud) < _LEAST_BANDS:
        return None
    share = np.add.reduceat(of_bins, starts, axis=1)[:, loud] / whole[loud]
    levels = 10.0 * np.log10(np.maximum(share, 1e-9))
    levels -= np.median(levels, axis=1, keepdims=True)
    levels -= levels.mean(axis=0)
    return float(np.sqrt(np.mean(levels**2)))
