"""A shoebox room: its walls, and what they make of a click.

Image sources (Allen and Berkley 1979) come from pyroomacoustics. All walls,
floor and ceiling absorb the same share of the energy at every frequency, and
none of them scatters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import Length, Parameters, Point
from systems.framework.signals import SAMPLE_RATE_HZ, whole
from systems.sound.propagation import (
    INTERPOLATION_KERNEL,
    KERNEL_REACH,
    MINIMUM_RANGE_M,
)

__all__ = ["RoomImages", "RoomParameters", "room_images", "room_impulse_responses"]

#: Higher orders of reflection are refused: four million images and more.
GREATEST_ORDER = 150


class RoomParameters(Parameters):
    """A shoebox room round the floor of W, for sound: obstacles are what can be hit."""

    size_m: Annotated[tuple[Length, Length, Length], Strict(False)] = (
        7.0,
        7.0,
        3.0,
    )
    """Extents along x and y of W, and height, m."""
    corner_m: Point | None = None
    """The corner of smallest x and y, in W, m.

    Unset, the origin of W lies in the middle of the floor.
    """
    reverberation_time_s: float = Field(default=0.4, ge=1e-3, le=20.0)
    """Time in which sound decays by 60 dB according to Sabine's formula, s.

    Image sources follow it in compact rooms that absorb little. In 7 x 7 x 3 m
    their decay from -5 to -35 dB stands for 0.25, 0.45 and 0.72 s where 0.25, 0.4
    and 0.6 s are asked for.
    """
    absorption: float | None = Field(default=None, gt=0.0, le=1.0)
    """Share of the energy that a wall absorbs.

    When set, the reverberation time follows from it.
    """
    maximum_order: int | None = Field(default=None, ge=1, le=GREATEST_ORDER)
    """Most walls that a reflection meets.

    Unset, all count that arrive within the reverberation time.
    """
    source_height_m: Length = 0.3
    """Height of every loudspeaker above the floor, m."""
    microphone_height_m: Length = 0.3
    """Height of the microphones above the floor, m."""
    update_period_s: float = Field(default=0.1, ge=1e-3, le=60.0)
    """Reflections are of the poses at multiples of this, s; a multiple of a frame."""

    @model_validator(mode="after")
    def _check(self) -> RoomParameters:
        for name in ("source_height_m", "microphone_height_m"):
            if getattr(self, name) >= self.size_m[2]:
                raise InputError(
                    f"{name}",
                    f"{getattr(self, name)} is not below the ceiling at "
                    f"{self.size_m[2]} m; lower it",
                )
        return self

    def update_frames(self, frame_s: float) -> int:
        """Frames from one update of the reflections to the next.

        Raises:
            InputError: The update's period is no multiple of a frame.
        """
        frames = self.update_period_s / frame_s
        if not whole(frames):
            raise InputError(
                "room.update_period_s",
                f"{self.update_period_s:g} s is not a multiple of a frame of the "
                f"microphones, {frame_s:g} s; use "
                f"{max(1, round(frames)) * frame_s:g}",
            )
        return round(frames)

    @property
    def corner(self) -> NDArray[np.float64]:
        """(2,) the corner of smallest x and y in W, m."""
        if self.corner_m is None:
            return np.array(self.size_m[:2]) / -2.0
        return np.array(self.corner_m)

    @property
    def rise_m(self) -> float:
        """Height of the microphones above the loudspeakers, m."""
        return self.microphone_height_m - self.source_height_m

    def contains(self, p_W: ArrayLike) -> bool:
        """Whether all of the points (..., 2) in W lie between the walls."""
        inside = np.asarray(p_W) - self.corner
        return bool(np.all((inside > 0.0) & (inside < self.size_m[:2])))

    def walls(self, c: float) -> tuple[float, float, int]:
        """Absorption, reverberation time in s, and order of reflections.

        Args:
            c: Speed of sound, m/s.

        Raises:
            InputError: No walls are so dull, or so many images are needed
                that they cannot be handled.
        """
        size = np.array(self.size_m)
        sabine = float(12.0 * math.log(10.0) / (c * np.sum(1.0 / size)))
        absorption, time = self.absorption, self.reverberation_time_s
        if absorption is not None:
            time = sabine / absorption
        elif time <= sabine:
            raise InputError(
                "room.reverberation_time_s",
                f"{time} s is too short for a room of "
                f"{self.size_m} m; {sabine:.2g} s would take walls that absorb all",
            )
        # The farthest plane of images of one order, less a room on either side.
        order = math.ceil(c * time * math.sqrt(np.sum(size**-2.0))) + 2
        order = self.maximum_order or order
        if order > GREATEST_ORDER:
            raise InputError(
                "room.maximum_order",
                f"a reverberation time of {time:.2g} s takes "
                f"reflections of order {order} in a room of {self.size_m} m; set it to "
                f"{GREATEST_ORDER} or less",
            )
        return absorption or sabine / time, time, order


@dataclass(frozen=True)
class RoomImages:
    """The images of any source: those of p stand at signs * p + offsets."""

    signs: NDArray[np.float64]
    """(n, 3) of the source's coordinates from the room's corner."""
    offsets: NDArray[np.float64]
    """(n, 3) m."""
    gains: NDArray[np.float64]
    """(n,) amplitude that the walls have left."""
    length: int
    """Samples of a response: it ends at the reverberation time, or with the last
    image."""


@lru_cache(maxsize=4)
def room_images(room: RoomParameters, c: float) -> RoomImages:
    """Images of a room that are heard within its reverberation time.

    Args:
        room: The room.
        c: Speed of sound that absorption and length are worked out for, m/s.

    Returns:
        Signs and offsets of k images, m, their gains, and the length of the response,
        samples.

    Raises:
        InputError: See ``RoomParameters.walls``.
    """
    import pyroomacoustics

    absorption, time, order = room.walls(c)
    box = pyroomacoustics.ShoeBox(
        room.size_m, materials=pyroomacoustics.Material(absorption), max_order=order
    )
    size = np.array(room.size_m)
    anywhere = 0.3 * size
    box.add_source(anywhere)
    box.add_microphone(0.6 * size)
    box.image_source_model()
    source = box.sources[0]
    orders = np.abs(source.orders_xyz.T).astype(float)
    # Least distance between an image's cell and the room.
    nearest = np.linalg.norm(np.maximum(orders - 1.0, 0.0) * size, axis=1)
    farthest = np.linalg.norm((orders + 1.0) * size, axis=1)
    kept = (nearest < c * time) & (orders.sum(axis=1) > 0) & (source.damping[0] > 0)
    signs = 1.0 - 2.0 * (orders[kept] % 2.0)
    # Single precision comes back: whole rooms, there and back, are exact.
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
    """Adds a click for each image and microphone to out (m, length).

    images: signs, offsets and gains. p_S (3,) and p_M (m, 3) from the corner,
    m; early (m,) samples; per_m samples that sound takes for a metre.
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
            # Too late; or within 2 cm, where nobody stands.
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
    """What microphones at rest hear of a click of a source at rest.

    Delays are exact below 18 kHz, as in ``systems.sound.propagation``; amplitudes
    are 1/R times what the walls leave of them.

    Args:
        room: The room.
        p_WS: (2,) source in W, m.
        p_WM: (m, 2) microphones in W, m.
        c: Speed of sound, m/s.
        late: Time by which all channels, or (m,) each, are sampled later, s.
        direct: Whether to include the sound that meets no wall.
        images: From ``room_images``, where they were worked out before.

    Returns:
        (m, length) pressure at 100 kHz for one at 1 m; the click leaves at the
        first sample.

    Raises:
        InputError: See ``RoomParameters.walls``.
    """
    images = images or room_images(room, c)
    microphones = np.atleast_2d(np.asarray(p_WM, dtype=float)) - room.corner
    count = len(microphones)
    p_M = np.column_stack([microphones, np.full(count, room.microphone_height_m)])
    p_S = np.array([*(np.asarray(p_WS) - room.corner), room.source_height_m])
    early = np.full(count, SAMPLE_RATE_HZ) * np.asarray(late, dtype=float)
    out = np.zeros((count, images.length), dtype=np.float32)
    fixed = (p_S, p_M, early, SAMPLE_RATE_HZ / c, MINIMUM_RANGE_M, INTERPOLATION_KERNEL)
    _add_arrivals((images.signs, images.offsets, images.gains), *fixed, out)
    if direct:
        itself = np.ones((1, 3)), np.zeros((1, 3)), np.ones(1)
        _add_arrivals(itself, *fixed, out)
    return out
