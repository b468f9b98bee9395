"""Recordings of arrays whose places, air, clocks and gains are not those stated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import pyroomacoustics as pra
from numpy.typing import NDArray
from scipy import fft, signal

from analysis.arrays.array_geometry import ArrayGeometry

RATE = 48_000
C, SPEED_STD, DELAY_STD, GAIN_STD_DB = 343.0, 3.43, 2e-6, 2.0
#: Short sounds of a recording; of long ones there is one.
SHORT_COUNT = 3
ROOM_M = np.array([11.0, 9.0, 4.5])
_FROM_WALLS_M = 0.5
_RANGES_M, _APERTURES_M = (0.5, 6.0), (0.05, 2.0)
# Of images: in these rooms all that comes within some 0.2 s.
_MOST_ORDER = 16
_LEAST_SPACING = 0.12
_SOUND_BAND_HZ = (500.0, 10_000.0)


class Cell(NamedTuple):
    """What is drawn alike."""

    place_std: float
    """Of each coordinate of each microphone, m."""
    t60: float
    """0 is the free field, s."""
    seconds: float
    """Length of each sound."""


@dataclass(frozen=True)
class DrawnArray:
    """An array as it is stated and as it is, and a source."""

    kind: Literal["row", "plane", "space"]
    geometry: ArrayGeometry
    """As stated."""
    stated: NDArray[np.float64]
    """(n, 3) in the room, m."""
    places: NDArray[np.float64]
    """(n, 3) as they are, m."""
    source: NDArray[np.float64]
    """(3,) in the room, m."""
    c: float
    """As it is, m/s."""
    late_s: NDArray[np.float64]
    """(n,) of the channels."""
    gains: NDArray[np.float64]
    """(n,) of the channels."""

    @property
    def p_AS(self) -> NDArray[np.float64]:
        """(3,) the source from the centroid of the stated places, m."""
        return np.asarray(self.source - self.stated.mean(axis=0))

    @property
    def range_m(self) -> float:
        """Of the source."""
        return float(np.linalg.norm(self.p_AS))

    @property
    def bearing(self) -> float:
        """Of the source, rad."""
        return math.atan2(self.p_AS[1], self.p_AS[0])

    @property
    def tau(self) -> NDArray[np.float64]:
        """(n - 1,) true delays, with those of the channels, s."""
        at = np.linalg.norm(self.source - self.places, axis=1) / self.c + self.late_s
        return np.asarray(at[1:] - at[0])


def draw_array(
    cell: Cell, rng: np.random.Generator, *, largest_error: float = math.inf
) -> DrawnArray:
    """An array of 3 to 8 microphones and 5 cm to 2 m, and a source 0.5 to 6 m away.

    Args:
        cell: Its errors.
        rng: Draws.
        largest_error: Drawn again until ``range_bound`` is below this share.

    Returns:
        Rows given by (x, y), planes upright or level, or arrays in space.
    """
    while True:
        kind = _KINDS[rng.integers(3)]
        aperture = math.exp(rng.uniform(*np.log(_APERTURES_M)))
        shape = _shape(kind, aperture, rng)
        center = np.array([3.5, 4.5, 1.5]) + rng.uniform(-0.5, 0.5, 3)
        source = center + _offset(shape, kind, rng)
        inside = np.all(source > _FROM_WALLS_M) and np.all(
            source < ROOM_M - _FROM_WALLS_M
        )
        if not inside:
            continue
        drawn = _drawn(kind, shape + center, source, cell, rng)
        error = range_bound(drawn, np.zeros((len(shape) - 1,) * 2)) / drawn.range_m
        if error < largest_error:
            return drawn


_KINDS: tuple[Literal["row", "plane", "space"], ...] = ("row", "plane", "space")


def _shape(kind: str, aperture: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 3) about the origin; rows along y, planes upright or level."""
    free = {"row": [1], "plane": [[1, 2], [0, 1]][rng.integers(2)], "space": [0, 1, 2]}
    while True:
        count = int(rng.integers(4 if kind == "space" else 3, 9))
        p = np.zeros((count, 3))
        p[:, free[kind]] = rng.uniform(-1.0, 1.0, (count, len(free[kind])))
        apart = np.linalg.norm(p[:, np.newaxis] - p, axis=2)
        largest = float(apart.max())
        thin = np.linalg.svd(p - p.mean(axis=0), compute_uv=False)
        round_enough = thin[len(free[kind]) - 1] > 0.2 * thin[0]
        apart[np.diag_indices(count)] = np.inf
        if apart.min() > _LEAST_SPACING * largest and round_enough:
            return np.asarray((p - p.mean(axis=0)) * aperture / largest)


def _offset(
    shape: NDArray[np.float64], kind: str, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(3,) to the source: ahead of rows and upright planes, above level ones."""
    azimuth = rng.uniform(-math.pi, math.pi)
    rise = rng.uniform(-0.3, 0.5)
    if kind == "row" or (kind == "plane" and np.ptp(shape[:, 0]) == 0.0):
        azimuth = rng.uniform(-1.2, 1.2)
        rise = 0.0 if kind == "row" else rise
    elif kind == "plane":
        rise = rng.uniform(0.15, 0.8)
    u = np.array([math.cos(azimuth), math.sin(azimuth), math.tan(rise)])
    return np.asarray(rng.uniform(*_RANGES_M) * u / np.linalg.norm(u))


def _drawn(
    kind: Literal["row", "plane", "space"],
    stated: NDArray[np.float64],
    source: NDArray[np.float64],
    cell: Cell,
    rng: np.random.Generator,
) -> DrawnArray:
    microphones = stated[:, :2] if kind == "row" else stated
    side = None
    if kind == "row":
        side = "ahead"
    elif kind == "plane":
        side = "ahead" if np.ptp(stated[:, 0]) == 0.0 else "above"
    geometry = ArrayGeometry.model_validate(
        {
            "microphones": microphones.tolist(),
            "sound_speed": C,
            "sound_speed_std": SPEED_STD,
            "position_std_m": cell.place_std,
            "delay_std_s": DELAY_STD,
            "gain_std_db": GAIN_STD_DB,
            "side": side,
        }
    )
    count = len(stated)
    return DrawnArray(
        kind=kind,
        geometry=geometry,
        stated=stated,
        places=stated + cell.place_std * rng.standard_normal(stated.shape),
        source=source,
        c=C + SPEED_STD * float(rng.standard_normal()),
        late_s=DELAY_STD * rng.standard_normal(count),
        gains=10.0 ** (GAIN_STD_DB / 20.0 * rng.standard_normal(count)),
    )


def place_bound(drawn: DrawnArray, own: NDArray[np.float64]) -> NDArray[np.float64]:
    """(d, d) Cramer-Rao bound of the place, to first order at the true one, m^2.

    The unknowns are the place, the microphones' places, the speed of sound and the
    channels' lateness, all but the first with normal priors: the information of all
    of them is inverted whole.

    Args:
        drawn: The array and the source.
        own: (n - 1, n - 1) covariance of the delays by noise and reflections, s^2.
    """
    d = len(drawn.geometry.microphones[0])
    p = drawn.stated[:, :d]
    count = len(p)
    rays = drawn.source[:d] - p
    distances = np.linalg.norm(rays, axis=1)
    rays = rays / distances[:, np.newaxis] / C
    budget = drawn.geometry.position_std_m
    assert isinstance(budget, float)
    # Slopes of the arrivals by place, microphones, speed of sound and lateness.
    by_microphones = np.zeros((count, count * d))
    for k in range(count):
        by_microphones[k, k * d : (k + 1) * d] = -rays[k]
    by_speed = -distances[:, np.newaxis] / C**2
    slopes = np.hstack((rays, by_microphones, by_speed, np.eye(count)))
    slopes = slopes[1:] - slopes[0]
    prior = np.concatenate(
        (
            np.zeros(d),
            np.full(count * d, budget**-2),
            [SPEED_STD**-2],
            np.full(count, DELAY_STD**-2),
        )
    )
    floor = 1e-16 * (np.eye(count - 1) + 1.0)
    information = slopes.T @ np.linalg.solve(own + floor, slopes) + np.diag(prior)
    scale = 1.0 / np.sqrt(np.diag(information))
    scaled = information * np.outer(scale, scale)
    return (np.linalg.pinv(scaled, rcond=1e-14) * np.outer(scale, scale))[:d, :d]


def range_bound(drawn: DrawnArray, own: NDArray[np.float64]) -> float:
    """Least standard deviation of the range, m."""
    d = len(drawn.geometry.microphones[0])
    if len(drawn.stated) - 1 < (2 if drawn.kind == "row" else 3):
        return math.inf
    u = drawn.p_AS[:d] / drawn.range_m
    return math.sqrt(float(u @ place_bound(drawn, own) @ u))


def bearing_bound(drawn: DrawnArray, own: NDArray[np.float64]) -> float:
    """Least standard deviation of the bearing, rad, where the range is to be found.

    Of three microphones, which tell none, as if the range were known.
    """
    x, y = drawn.p_AS[:2]
    level = float(np.hypot(x, y))
    across = np.zeros(len(drawn.geometry.microphones[0]))
    across[:2] = -y / level, x / level
    return math.sqrt(float(across @ place_bound(drawn, own) @ across)) / level


def exact_array(rng: np.random.Generator) -> DrawnArray:
    """A star of four within 1.4 m that looks along +x, and a source 5 m away."""
    thirds = 2.0 * math.pi * np.arange(3) / 3.0
    star = np.vstack(
        (np.zeros(3), np.column_stack((0.0 * thirds, np.sin(thirds), np.cos(thirds))))
    )
    stated = 0.8 * star + np.array([3.5, 4.5, 2.0]) + rng.uniform(-0.5, 0.5, 3)
    azimuth, rise = rng.uniform(-0.6, 0.6), rng.uniform(-0.15, 0.25)
    u = np.array(
        [
            math.cos(rise) * math.cos(azimuth),
            math.cos(rise) * math.sin(azimuth),
            math.sin(rise),
        ]
    )
    exact = {
        "microphones": stated.tolist(),
        "sound_speed": C,
        "sound_speed_std": 0.0,
        "position_std_m": 1e-4,
        "delay_std_s": 0.0,
        "side": "ahead",
    }
    return DrawnArray(
        kind="plane",
        geometry=ArrayGeometry.model_validate(exact),
        stated=stated,
        places=stated,
        source=stated.mean(axis=0) + 5.0 * u,
        c=C,
        late_s=np.zeros(4),
        gains=np.ones(4),
    )


def record(
    drawn: DrawnArray, cell: Cell, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(n, samples) at 48 kHz: sounds with their echoes, 20 to 40 dB over the noise."""
    one = _sound(cell.seconds, rng)
    count = 1 if cell.seconds > 0.5 else SHORT_COUNT
    pause = np.zeros(round((0.25 + cell.t60) * RATE))
    played = np.concatenate([pause, *[one, pause] * count])
    heard = convolved(drawn, cell.t60, played)
    turn = 2j * math.pi * fft.rfftfreq(heard.shape[1], 1.0 / RATE)
    late = np.exp(-drawn.late_s[:, np.newaxis] * turn)
    heard = fft.irfft(fft.rfft(heard) * late, heard.shape[1])
    level = np.sqrt(np.mean(heard**2) * heard.shape[1] / (count * one.size))
    level *= 10.0 ** (-rng.uniform(20.0, 40.0) / 20.0)
    heard = heard + level * rng.standard_normal(heard.shape)
    return np.asarray(drawn.gains[:, np.newaxis] * heard)


def convolved(
    drawn: DrawnArray, t60: float, played: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, samples) in the room."""
    if t60:
        absorption, order = pra.inverse_sabine(t60, ROOM_M, c=drawn.c)
    else:
        absorption, order = 1.0, 0
    room = pra.ShoeBox(
        ROOM_M,
        fs=RATE,
        materials=pra.Material(absorption),
        max_order=min(order, _MOST_ORDER),
    )
    room.set_sound_speed(drawn.c)
    room.add_source(drawn.source)
    room.add_microphone_array(drawn.places.T)
    room.compute_rir()
    rows = [signal.fftconvolve(played, rir[0]) for rir in room.rir]
    longest = max(row.size for row in rows)
    return np.array([np.pad(row, (0, longest - row.size)) for row in rows])


def _sound(seconds: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """A chirp or a burst of noise, as often."""
    t = np.arange(round(seconds * RATE)) / RATE
    shape = np.hanning(t.size) ** 0.25
    low, high = _SOUND_BAND_HZ
    if rng.random() < 0.5:
        phase = low * t + 0.5 * (high - low) / seconds * t**2
        return np.asarray(np.sin(2.0 * math.pi * phase) * shape)
    band = signal.butter(4, (low, high), "band", fs=RATE, output="sos")
    return np.asarray(signal.sosfilt(band, rng.standard_normal(t.size)) * shape)
