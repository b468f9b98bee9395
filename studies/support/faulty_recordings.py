"""Makes recordings of one source for cases of faulty channels."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.support.synthetic_speech import speech_like

#: Square of 4.57 cm sides, row of four, circle of six, tetrahedron and square of 1.5 m.
SQUARE = 0.02285 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])
ROW = np.array([[x, 0.0, 0.0] for x in (-0.075, -0.025, 0.025, 0.075)])
_SIXTHS = np.pi / 3.0 * np.arange(6)
CIRCLE = 0.0463 * np.stack((np.cos(_SIXTHS), np.sin(_SIXTHS), 0.0 * _SIXTHS), axis=1)
TETRAHEDRON = 0.3535 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
LARGE = 0.75 * np.array([[1, 1, 0], [-1, 1, 0.2], [-1, -1, 0], [1, -1, 0.3]])


@dataclass(frozen=True)
class Setting:
    """A source, an array, and the room around them."""

    places: NDArray[np.float64]
    """(n, 3) positions of the microphones around the middle of the array, m."""
    bearing_deg: float
    elevation_deg: float = 10.0
    range_m: float = 1.5
    """Distance of the source from the middle of the array, m."""
    t60_s: float = 0.3
    """Reverberation time, s; 0 for no reflections."""
    rate: int = 16_000
    """Sample rate, Hz."""
    snr_db: float = 25.0
    c: float = 343.2
    """Speed of sound, m/s; used without reflections only."""
    pattern: float = 1.0
    """Share of the omnidirectional part in microphones that point outward: 1 for none
    else, 0.5 for cardioids, 0.37 for supercardioids."""
    room_m: tuple[float, float, float] = (6.0, 5.0, 2.8)
    middle_m: tuple[float, float, float] = (3.0, 2.2, 1.2)
    """Middle of the array in the room, m."""

    @property
    def source(self) -> NDArray[np.float64]:
        """Position of the source relative to the middle of the array, m."""
        azimuth, height = np.radians([self.bearing_deg, self.elevation_deg])
        return self.range_m * np.array(
            [
                np.cos(azimuth) * np.cos(height),
                np.sin(azimuth) * np.cos(height),
                np.sin(height),
            ]
        )

    def responses(self) -> NDArray[np.float64]:
        """Returns the (n, taps) impulse responses from the source."""
        if self.t60_s == 0.0:
            return _direct(self)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import pyroomacoustics as pra
        absorption, order = pra.inverse_sabine(self.t60_s, self.room_m)
        room = pra.ShoeBox(
            self.room_m,
            fs=self.rate,
            materials=pra.Material(absorption),
            max_order=min(order, 17),
        )
        directivity = None
        if self.pattern < 1.0:
            directivity = [self._outward(pra, place) for place in self.places]
        places = (self.places + np.array(self.middle_m)).T
        room.add_microphone_array(places, directivity=directivity)
        room.add_source(self.source + np.array(self.middle_m))
        room.compute_rir()
        rows = [rir[0] for rir in room.rir]
        longest = max(map(len, rows))
        return np.array([np.pad(row, (0, longest - len(row))) for row in rows])

    def _outward(self, pra: Any, place: NDArray[np.float64]) -> Any:
        azimuth = float(np.arctan2(place[1], place[0]))
        axis = pra.directivities.DirectionVector(azimuth, 0.5 * np.pi, degrees=False)
        return pra.directivities.CardioidFamily(axis, self.pattern)

    def heard(
        self, sound: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Returns the (n, samples) channels for a sound, with noise."""
        responses = self.responses()
        size = sound.size + responses.shape[1]
        rows = np.fft.irfft(np.fft.rfft(sound, size) * np.fft.rfft(responses, size))
        rows = rows[:, : sound.size]
        rows /= np.sqrt(np.mean(rows**2))
        noise = rng.standard_normal(rows.shape)
        return 0.05 * (rows + 10.0 ** (-self.snr_db / 20.0) * noise)

    def speech(self, seconds: float, seed: int) -> NDArray[np.float64]:
        """Returns the (n, samples) channels for sound that is like speech."""
        rng = np.random.default_rng(seed)
        return self.heard(speech_like(rng, seconds, self.rate), rng)


def _direct(setting: Setting) -> NDArray[np.float64]:
    ranges = np.linalg.norm(setting.places - setting.source, axis=1)
    size = 2 * int(setting.rate * ranges.max() / setting.c) + 256
    f = np.fft.rfftfreq(size, 1.0 / setting.rate)
    # All arrive after at least 64 samples, so that no response wraps around.
    late = 64.0 / setting.rate + (ranges - ranges.min()) / setting.c
    spectra = np.exp(-2j * np.pi * np.outer(late, f)) / ranges[:, np.newaxis]
    return np.fft.irfft(spectra, size)


def moved(setting: Setting, bearing_deg: float) -> Setting:
    """Returns the same setting with the source at another bearing."""
    return replace(setting, bearing_deg=bearing_deg)


def late(
    samples: NDArray[np.float64], channels: Sequence[int], count: int
) -> NDArray[np.float64]:
    """Delays some channels by a number of samples, or others if it is negative."""
    rows = samples.copy()
    for k in range(len(rows)):
        if (k in channels) == (count > 0):
            rows[k] = np.roll(rows[k], abs(count))
    return rows[:, abs(count) :]


def lost(
    samples: NDArray[np.float64], channels: Sequence[int], at: int, count: int
) -> NDArray[np.float64]:
    """Removes samples of some channels from the sample number ``at`` on."""
    rows = samples[:, : samples.shape[1] - count].copy()
    for k in channels:
        rows[k, at:] = samples[k, at + count :]
    return rows


def off_by_deg(bearing_deg: float, truth_deg: ArrayLike) -> NDArray[np.float64]:
    """Returns the size of the difference of two bearings, deg."""
    return np.abs((bearing_deg - np.asarray(truth_deg) + 180.0) % 360.0 - 180.0)
