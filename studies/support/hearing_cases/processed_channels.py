"""Recordings whose first channel a device has computed from its microphones."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from phonotaxis import ArrayGeometry, InputError, locate
from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.synthetic_speech import speech_like

TITLE = "processed channels"

_RATE, _C = 16_000, 343.5
_SIXTHS = np.arange(6) * np.pi / 3
_ARRAYS = {
    "square of 4.6 cm": 0.0229 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]),
    "row of 4": 0.05 * np.array([[-1.5, 0], [-0.5, 0], [0.5, 0], [1.5, 0]]),
    "circle of 6": 0.0425 * np.stack([np.cos(_SIXTHS), np.sin(_SIXTHS)], axis=1),
}


def _microphones(places: NDArray[np.float64], snr_db: float) -> NDArray[np.float64]:
    """Speech from 50 deg in 2 m, with weak echoes."""
    rng = np.random.default_rng(round(snr_db) + len(places))
    sound = speech_like(rng, 4.0, _RATE)
    frequency = np.fft.rfftfreq(sound.size, 1 / _RATE)
    heard = np.zeros((len(places), sound.size))
    for echo in range(6):
        angle = np.radians(50.0) if echo == 0 else rng.uniform(-np.pi, np.pi)
        source = 2.0 * np.array([np.cos(angle), np.sin(angle)])
        delays = np.linalg.norm(source - places, axis=1) / _C
        delays += 0.0 if echo == 0 else rng.uniform(0.003, 0.05)
        turns = np.exp(-2j * np.pi * np.outer(delays, frequency))
        gain = 1.0 if echo == 0 else 0.2
        heard += gain * np.fft.irfft(turns * np.fft.rfft(sound), sound.size)
    heard += 10.0 ** (-snr_db / 20.0) * rng.standard_normal(heard.shape)
    return np.asarray(0.03 * heard)


def _processed(heard: NDArray[np.float64], how: str) -> NDArray[np.float64]:
    mix = heard.mean(axis=0)
    if how == "limited mix":
        return np.asarray(np.tanh(8.0 * mix))
    if how == "late limited mix":
        return np.roll(np.tanh(8.0 * mix), 640)
    # An automatic gain, 62 ms late.
    power = np.convolve(mix**2, np.ones(1_600) / 1_600, "same")
    return np.roll(0.1 * mix / (np.sqrt(power) + 0.003), 992)


def _judged(name: str, how: str, snr_db: float, *, first: bool) -> Outcome:
    """Locates with the processed channel (``first``) or with the microphones only."""
    places = _ARRAYS[name]
    heard, n = _microphones(places, snr_db), len(places)
    silent = 1e-5 * np.random.default_rng(1).standard_normal(heard.shape[1])
    columns = np.vstack([_processed(heard, how), heard, silent])
    columns = np.round(np.clip(columns, -1.0, 1.0) * 32_767.0) / 32_768.0
    channels = tuple(range(n)) if first else tuple(range(1, n + 1))
    geometry = ArrayGeometry(
        microphones=places.tolist(), channels=channels, sound_speed=_C
    )
    try:
        found = locate(columns, geometry, sample_rate_hz=_RATE)
    except InputError as error:
        return Outcome(first and "channel 1: processed" in str(error), str(error))
    bearing = found.main_source()["bearing_deg"]
    near = bearing is not None and abs(bearing - 50.0) < 5.0
    claims = any(source.confidence > CLAIM for source in found.agreed.sources)
    said = f"{bearing}, {' '.join(found.notes)}"
    return Outcome(near and not first, said, claims and not near)


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    return [
        HearingCase(
            f"{name}, {how}, {snr_db} dB, {'with' if first else 'without'} it",
            partial(_judged, name, how, snr_db, first=first),
        )
        for name in _ARRAYS
        for how in ("limited mix", "late limited mix", "automatic gain")
        for snr_db in (20.0, 35.0)
        for first in (True, False)
    ]
