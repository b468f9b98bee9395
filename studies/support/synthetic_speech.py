"""Makes random sound that is as sparse in time and frequency as speech."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Range of the pitch of adults, Hz.
_PITCH_HZ = (90.0, 240.0)
# First three formants of a neutral vowel, Hz.
_FORMANTS_HZ = np.array([500.0, 1500.0, 2600.0])
# Bandwidths of these formants, Hz.
_WIDTHS_HZ = np.array([80.0, 110.0, 170.0])
# Largest relative change of formants: between vowels, and between talkers.
_VOWEL, _THROAT = 0.35, 0.12

_SYLLABLE_S = (0.12, 0.30)
_GAP_S = (0.02, 0.10)
_PAUSE_S = (0.15, 0.40)
_PAUSE_CHANCE = 0.2
# Consonants of noise: duration in s, level, and probability before a syllable.
_HISS_S, _HISS_LEVEL, _HISS_CHANCE = 0.07, 0.08, 0.5


def speech_like(
    rng: np.random.Generator, seconds: float, sample_rate_hz: float
) -> NDArray[np.float64]:
    """Makes syllables of gliding harmonics with formants, noise consonants and pauses.

    The sound is not real speech. As in real speech, one of several talkers is far
    louder than the others at most times and frequencies. Talkers can therefore be
    separated.

    Args:
        rng: Generator that draws the talker's pitch and formants, and the syllables.
        seconds: Length of the sound, s.
        sample_rate_hz: Sample rate, Hz.

    Returns:
        (samples,) sound with an RMS of 1.
    """
    total = round(seconds * sample_rate_hz)
    sound = np.zeros(total)
    pitch = float(np.exp(rng.uniform(*np.log(_PITCH_HZ))))
    throat = rng.uniform(1.0 - _THROAT, 1.0 + _THROAT)
    start = rng.uniform(0.0, 0.1)
    while start < seconds:
        if rng.random() < _HISS_CHANCE:
            start = _add(sound, _hiss(rng, sample_rate_hz), start, sample_rate_hz)
        syllable = _syllable(rng, pitch, throat, sample_rate_hz)
        start = _add(sound, syllable, start, sample_rate_hz)
        start += rng.uniform(*_GAP_S)
        if rng.random() < _PAUSE_CHANCE:
            start += rng.uniform(*_PAUSE_S)
    return sound / np.sqrt(np.mean(sound**2))


def _add(
    sound: NDArray[np.float64],
    part: NDArray[np.float64],
    start: float,
    sample_rate_hz: float,
) -> float:
    """Adds a part to a sound as far as there is room, and returns the part's end, s."""
    first = round(start * sample_rate_hz)
    end = min(first + len(part), len(sound))
    sound[first:end] += part[: max(0, end - first)]
    return start + len(part) / sample_rate_hz


def _syllable(
    rng: np.random.Generator, pitch: float, throat: float, sample_rate_hz: float
) -> NDArray[np.float64]:
    seconds = rng.uniform(*_SYLLABLE_S)
    share = np.linspace(0.0, 1.0, round(seconds * sample_rate_hz))
    f = pitch * rng.uniform(0.85, 1.2) * (1.0 + rng.uniform(-0.25, 0.2) * share)
    phase = 2.0 * np.pi * np.cumsum(f) / sample_rate_hz
    vowel = throat * _FORMANTS_HZ
    begin, end = vowel * rng.uniform(1.0 - _VOWEL, 1.0 + _VOWEL, (2, 3))
    formants = begin[:, np.newaxis] + np.outer(end - begin, share)
    wave = np.zeros(len(share))
    for h in range(1, int(0.5 * sample_rate_hz / f.max()) + 1):
        off = (h * f - formants) / (0.5 * _WIDTHS_HZ[:, np.newaxis])
        # Resonances above a floor, with the -6 dB per octave of a voice.
        strength = (0.03 + np.sum(1.0 / (1.0 + off**2), axis=0)) / h
        wave += strength * np.sin(h * phase + rng.uniform(0.0, 2.0 * np.pi))
    loudness = rng.uniform(0.4, 1.0) * np.sin(np.pi * share) ** 0.7
    return np.asarray(loudness * wave)


def _hiss(rng: np.random.Generator, sample_rate_hz: float) -> NDArray[np.float64]:
    noise = rng.standard_normal(round(_HISS_S * sample_rate_hz))
    high = np.diff(noise, prepend=0.0)
    return _HISS_LEVEL * high * np.hanning(len(high))
