"""Makes the sound that the loudspeaker plays: synthetic, or from a file."""

from __future__ import annotations

import numpy as np
import soxr
from numpy.typing import NDArray

from systems.framework.input_error import InputError
from systems.framework.signals import SAMPLE_RATE_HZ
from systems.sound.parameters import EDGE_S, MICROPHONE_BAND_HZ, SoundParameters
from systems.sound.sound_file import read_played

#: Level relative to the peak that ends the silence at the beginning of a file, dB. A
#: file is played from its first sample above this level on.
SILENCE_DB = -50.0
#: Largest ratio of the peak to the requested RMS level.
LARGEST_CREST = 4.0
#: Shortest length of the noise before it repeats, s.
_NOISE_SECONDS = 2.0


def make_waveform(sound: SoundParameters, seed: int = 0) -> NDArray[np.float32]:
    """Makes the waveform of the loudspeaker: sound pressure at a distance of 1 m.

    The source sounds in bursts. The waveform has m bursts, end to end, without the
    pauses between them. Burst k of a run (k = 0, 1 ...) plays burst k mod m of the
    waveform. The sound of a file continues from burst to burst, and starts again after
    the end of the file.

    Args:
        sound: Waveform, level and length of the bursts.
        seed: Seed of the noise.

    Returns:
        (m n,) sound pressure at a sample rate of 100 kHz, Pa: m bursts of n samples
        with soft edges.

    Raises:
        InputError: The file cannot be played, or the sound is outside the band of the
            microphones. The message states the remedy.
    """
    burst = round(sound.on_s * SAMPLE_RATE_HZ)
    raw = _SYNTHESES[sound.kind](sound, seed)
    endless = band_limited(raw, *MICROPHONE_BAND_HZ)
    if np.std(endless) <= 1e-6 * max(np.abs(raw).max(), 1e-3):
        field = "sound.file" if sound.kind == "wav" else "sound.tone_hz"
        what = sound.file if sound.kind == "wav" else f"{sound.tone_hz:g} Hz"
        low, high = MICROPHONE_BAND_HZ
        raise InputError(
            field,
            f"{what} has nothing between {low:g} and {high:g} Hz, which the "
            "microphones pass; choose another sound",
        )
    # Fill whole bursts, and scale them to the level.
    bursts = max(1, -(-len(endless) // burst))
    samples = np.resize(endless, bursts * burst)
    peak, rms = np.max(np.abs(samples)), np.sqrt(np.mean(samples**2))
    samples *= sound.level_pa * min(1.0 / rms, LARGEST_CREST / peak)
    # Apply the edges to each burst.
    each = samples.reshape(bursts, burst)
    edge = round(EDGE_S * SAMPLE_RATE_HZ)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    each[:, :edge] *= ramp
    each[:, -edge:] *= ramp[::-1]
    return samples.astype(np.float32)


def _time(seconds: float) -> NDArray[np.float64]:
    return np.arange(round(seconds * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ


_SWEEP_S = 0.025


def _chirp(sound: SoundParameters, seed: int) -> NDArray[np.float64]:
    """Makes sweeps of 25 ms, so that every frame of 25 ms has the whole band."""
    import scipy.signal

    time = _time(_SWEEP_S)
    sweep = scipy.signal.chirp(time, sound.low_hz, _SWEEP_S, sound.high_hz, phi=-90.0)
    return np.tile(sweep, round(sound.on_s / _SWEEP_S) or 1)


def _band_noise(sound: SoundParameters, seed: int) -> NDArray[np.float64]:
    length = round(max(sound.on_s, _NOISE_SECONDS) * SAMPLE_RATE_HZ)
    white = np.random.default_rng(seed).standard_normal(length)
    return band_limited(white, sound.low_hz, sound.high_hz)


def _tone(sound: SoundParameters, seed: int) -> NDArray[np.float64]:
    return np.sin(2.0 * np.pi * sound.tone_hz * _time(sound.on_s))


def _horn(sound: SoundParameters, seed: int) -> NDArray[np.float64]:
    """Makes the sound of two reeds a major third apart, with a slight tremolo."""
    time = _time(sound.on_s)
    tremble = 0.004 / 11.0 * np.sin(2.0 * np.pi * 11.0 * time)
    total = np.zeros_like(time)
    for fundamental in (380.0, 475.0):
        for harmonic in range(1, int(12_000.0 // fundamental) + 1):
            phase = 2.0 * np.pi * fundamental * harmonic * (time + tremble)
            total += np.sin(phase + harmonic**2) / harmonic**0.7
    return total


def _siren(sound: SoundParameters, seed: int) -> NDArray[np.float64]:
    """Makes a square wave that sweeps from 600 to 1500 Hz and back twice per second."""
    import scipy.signal

    time = _time(max(sound.on_s, 1.0))
    low, high = 600.0, 1_500.0
    sweep = 0.5 * (scipy.signal.sawtooth(4.0 * np.pi * time, 0.5) + 1.0)
    phase = 2.0 * np.pi * np.cumsum(low + (high - low) * sweep) / SAMPLE_RATE_HZ
    odd = range(1, 12, 2)
    return np.sum([np.sin(number * phase) / number for number in odd], axis=0)


def _file(sound: SoundParameters, seed: int) -> NDArray[np.float64]:
    samples, rate = read_played(sound.file or "", sound.low_hz, "sound.file")
    centered = samples - samples.mean()
    mono = soxr.resample(centered, rate, SAMPLE_RATE_HZ, quality="VHQ")
    threshold = np.max(np.abs(mono)) * 10.0 ** (SILENCE_DB / 20.0)
    return mono[np.argmax(np.abs(mono) > threshold) :]


def band_limited(
    samples: NDArray[np.float64], low_hz: float, high_hz: float
) -> NDArray[np.float64]:
    """Filters samples with a zero-phase Butterworth band-pass filter.

    Args:
        samples: (n,) samples at 100 kHz, any unit.
        low_hz: Lower edge of the band, Hz.
        high_hz: Upper edge of the band, Hz.

    Returns:
        (n,) filtered samples, in the unit of the samples.
    """
    import scipy.signal

    sections = scipy.signal.butter(
        4, (low_hz, high_hz), "bandpass", fs=SAMPLE_RATE_HZ, output="sos"
    )
    return scipy.signal.sosfiltfilt(
        sections, samples, padlen=min(len(samples) - 1, 3 * SAMPLE_RATE_HZ // 100)
    )


_SYNTHESES = {
    "chirp": _chirp,
    "band_noise": _band_noise,
    "tone": _tone,
    "horn": _horn,
    "siren": _siren,
    "wav": _file,
}
