"""Sound from far away at an array, by its exact delays."""

from __future__ import annotations

import io
import struct

import numpy as np
from scipy.interpolate import CubicSpline

RATE = 16_000
SQUARE = ((0.05, 0.05), (-0.05, 0.05), (-0.05, -0.05), (0.05, -0.05))
SOUND_SPEED = 340.0


def plane_waves(
    bearing_deg: float,
    seconds: float,
    *,
    drift: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
    seed: int = 1,
) -> np.ndarray:
    """(4, k) float32 of syllables of noise; ``drift`` is what clocks run too fast."""
    rng = np.random.default_rng(seed)
    count = round(seconds * RATE) + RATE
    spectrum = np.fft.rfft(rng.standard_normal(count))
    f = np.fft.rfftfreq(count, 1.0 / RATE)
    spectrum[(f < 200.0) | (f > 3_500.0)] = 0.0
    wave = CubicSpline(np.arange(count), np.fft.irfft(spectrum, count))
    turn = np.radians(bearing_deg)
    late = -(np.array(SQUARE) @ [np.cos(turn), np.sin(turn)]) / SOUND_SPEED * RATE
    k = np.arange(count - RATE)
    heard = np.array(
        [
            wave(0.5 * RATE + (1.0 + fast) * k - delay)
            for delay, fast in zip(late, drift, strict=True)
        ]
    )
    heard *= 0.1 + np.sin(2.0 * np.pi * 1.5 * k / RATE) ** 2
    heard += 1e-3 * rng.standard_normal(heard.shape)
    return (0.3 * heard / np.abs(heard).max()).astype(np.float32)


def wav_bytes(
    samples: np.ndarray, *, rate: int = RATE, length: int | None = None, extra: int = 0
) -> bytes:
    """A WAV of 16 bits; ``extra`` further bytes make its ``fmt`` extensible."""
    data = np.rint(samples.T * 2**15).astype("<i2").tobytes()
    channels = len(samples)
    kind = 0xFFFE if extra else 1
    form = struct.pack(
        "<HHIIHH", kind, channels, rate, 2 * channels * rate, 2 * channels, 16
    )
    if extra:
        form += struct.pack("<HHIH", 22, 16, 0, 1) + b"\0" * 14
    out = io.BytesIO()
    out.write(b"RIFF" + struct.pack("<I", 36 + len(data)) + b"WAVE")
    out.write(b"fmt " + struct.pack("<I", len(form)) + form)
    out.write(b"data" + struct.pack("<I", len(data) if length is None else length))
    out.write(data)
    return out.getvalue()
