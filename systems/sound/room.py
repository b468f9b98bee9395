"""Computes impulse responses of a shoebox room.

The image sources (Allen and Berkley 1979) come from the library pyroomacoustics. The
walls, the floor and the ceiling absorb the same share of the energy at every frequency.
They do not scatter sound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.compiling import njit
from systems.framework.signals import SAMPLE_RATE_HZ
from systems.sound.parameters import HEIGHT_M, RoomParameters
from systems.sound.propagation import (
    INTERPOLATION_KERNEL,
    KERNEL_REACH,
    MINIMUM_RANGE_M,
)


@dataclass(frozen=True)
class RoomImages:
    """Image sources of a room. An image of a source at p is at signs * p + offsets."""

    signs: NDArray[np.float64]
    """(n, 3) factors 1 or -1 for the coordinates p of the source, which are relative to
    the corner of the room."""
    offsets: NDArray[np.float64]
    """(n, 3) offsets, m."""
    gains: NDArray[np.float64]
    """(n,) factors of the amplitude after all reflections."""
    length: int
    """Number of samples of a response. The response ends at the reverberation time, or
    with the last image."""


@lru_cache(maxsize=4)
def room_images(room: RoomParameters, c: float) -> RoomImages:
    """Computes the image sources that are heard within the reverberation time.

    Args:
        room: Size and walls of the room.
        c: Speed of sound, m/s. It determines the absorption and the length of the
            response.

    Returns:
        The images and the length of the response.

    Raises:
        InputError: See ``RoomParameters.walls``.
    """
    import pyroomacoustics

    absorption, time, order = room.walls(c)
    box = pyroomacoustics.ShoeBox(
        room.size_m, materials=pyroomacoustics.Material(absorption), max_order=order
    )
    size = np.array(room.size_m)
    # The signs and offsets do not depend on the source and the microphone.
    anywhere = 0.3 * size
    box.add_source(anywhere)
    box.add_microphone(0.6 * size)
    box.image_source_model()
    source = box.sources[0]
    orders = np.abs(source.orders_xyz.T).astype(float)
    # Smallest and largest distance between the cell of an image and the room.
    nearest = np.linalg.norm(np.maximum(orders - 1.0, 0.0) * size, axis=1)
    farthest = np.linalg.norm((orders + 1.0) * size, axis=1)
    kept = (nearest < c * time) & (orders.sum(axis=1) > 0) & (source.damping[0] > 0)
    signs = 1.0 - 2.0 * (orders[kept] % 2.0)
    # pyroomacoustics returns single precision. Rounding restores the offsets, which are
    # multiples of twice the size of the room.
    offsets = (
        2.0 * size * np.rint((source.images.T[kept] - signs * anywhere) / 2 / size)
    )
    last = min(c * time, float(farthest[kept].max(initial=math.hypot(*size))))
    return RoomImages(
        signs,
        offsets,
        np.sqrt(1.0 - absorption) ** orders[kept].sum(axis=1),
        math.ceil(last / c * SAMPLE_RATE_HZ) + 2 * KERNEL_REACH,
    )


@njit(cache=True)
def _add_arrivals(
    images: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    p_S: NDArray[np.float64],
    p_M: NDArray[np.float64],
    early: NDArray[np.float64],
    per_m: float,
    nearest: float,
    kernel: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    """Adds the impulse of each image source at each microphone to ``out``.

    For each pair of image and microphone, the function computes the distance and the
    time of arrival. At this time, it adds the interpolation kernel, multiplied by the
    gain of the image and divided by the distance.

    Args:
        images: Signs, offsets and gains of ``RoomImages``.
        p_S: (3,) position of the source from the corner of the room, m.
        p_M: (m, 3) positions of the microphones from the corner of the room, m.
        early: (m,) number of samples by which each channel is sampled late. Its
            impulses appear earlier by this number of samples.
        per_m: Number of samples in which sound travels one meter.
        nearest: Distance below which the amplitude no longer grows, m.
        kernel: ``INTERPOLATION_KERNEL``.
        out: (m, length) responses, changed in place.
    """
    signs, offsets, gains = images
    pairs = kernel.shape[0]
    length = out.shape[1]
    for m in range(out.shape[0]):
        row = out[m]
        for i in range(gains.size):
            dx = signs[i, 0] * p_S[0] + offsets[i, 0] - p_M[m, 0]
            dy = signs[i, 1] * p_S[1] + offsets[i, 1] - p_M[m, 1]
            dz = signs[i, 2] * p_S[2] + offsets[i, 2] - p_M[m, 2]
            r = math.sqrt(dx * dx + dy * dy + dz * dz)
            position = r * per_m - early[m]
            whole = math.floor(position)
            start = int(whole) - pairs + 1
            # Skip arrivals after the end, and images within about 2 cm.
            if start < 0 or start + 2 * pairs > length:
                continue
            u = np.float32(position - whole - 0.5)
            y = u * u
            gain = np.float32(gains[i] / max(r, nearest))
            for n in range(pairs):
                e, o = kernel[n, 0], kernel[n, 1]
                even = gain * (((e[3] * y + e[2]) * y + e[1]) * y + e[0])
                odd = gain * u * (((o[3] * y + o[2]) * y + o[1]) * y + o[0])
                row[start + n] += even + odd
                row[start + 2 * pairs - 1 - n] += even - odd


def room_impulse_responses(
    room: RoomParameters,
    p_WS: ArrayLike,
    p_WM: ArrayLike,
    c: float,
    *,
    late: ArrayLike = 0.0,
    direct: bool = True,
    images: RoomImages | None = None,
) -> NDArray[np.float32]:
    """Computes impulse responses from a source at rest to microphones at rest.

    Delays are interpolated as in ``systems.sound.propagation``, which is accurate up to
    18 kHz. The amplitude of each arrival is the gain of its reflections divided by the
    distance.

    Args:
        room: Size and walls of the room.
        p_WS: (2,) position of the source in the world frame W, m.
        p_WM: (m, 2) positions of the microphones in W, m.
        c: Speed of sound, m/s.
        late: Delay with which the channels are sampled, s: one number for all channels,
            or (m,) one number per channel.
        direct: Whether to include the direct sound.
        images: Result of ``room_images``, if it is already known.

    Returns:
        (m, length) pressure at a sample rate of 100 kHz, relative to the pressure at 1
        m. The source emits the impulse at the first sample.

    Raises:
        InputError: See ``RoomParameters.walls``.
    """
    images = images or room_images(room, c)
    microphones = np.atleast_2d(np.asarray(p_WM, dtype=float)) - room.corner
    count = len(microphones)
    p_M = np.column_stack([microphones, np.full(count, HEIGHT_M)])
    p_S = np.array([*(np.asarray(p_WS) - room.corner), HEIGHT_M])
    early = np.full(count, SAMPLE_RATE_HZ) * np.asarray(late, dtype=float)
    out = np.zeros((count, images.length), dtype=np.float32)
    fixed = (p_S, p_M, early, SAMPLE_RATE_HZ / c, MINIMUM_RANGE_M, INTERPOLATION_KERNEL)
    _add_arrivals((images.signs, images.offsets, images.gains), *fixed, out)
    if direct:
        itself = np.ones((1, 3)), np.zeros((1, 3)), np.ones(1)
        _add_arrivals(itself, *fixed, out)
    return out
