"""Computes the reflections from the walls of a room, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.framework.input_error import InputError
from systems.framework.signals import SAMPLE_RATE_HZ, Emission
from systems.sound.parameters import MicArrayParameters, RoomParameters
from systems.sound.propagation import KERNEL_REACH, sampled_at
from systems.sound.real_array import RealArray
from systems.sound.room import room_images, room_impulse_responses
from systems.world.geometry import rotate

# Number of room responses in the cache. Each response is a spectrum of at most half a
# megabyte per channel. A source needs two responses at a time.
_KEPT = 8


def _place(places: NDArray[np.float64], source: int) -> tuple[float, ...]:
    """Returns x, y and theta of the robot, then x and y of one source."""
    return (*places[:3], *places[3 + 2 * source : 5 + 2 * source])


class Reverberation:
    """Computes the sound of the reflections in a room.

    The class convolves the sound of each source with an impulse response of the room. A
    response is valid for a robot and a source at rest in given positions. If the
    positions change, an audio frame fades from the response for the old positions to
    the response for the new positions. A cache keeps the most recent responses, so that
    robots and sources at rest need only one computation.

    Args:
        room: Size and walls of the room.
        c: Speed of sound, m/s. It determines the absorption and the length of the
            responses.
        parameters: Sample rate and length of the frames.

    Raises:
        InputError: See ``RoomParameters.walls``.
    """

    def __init__(
        self,
        room: RoomParameters,
        c: float,
        parameters: MicArrayParameters | None = None,
    ) -> None:
        self._parameters = parameters or MicArrayParameters()
        self.room = room
        self._c = c
        self._images = room_images(room, c)
        # Number of samples of a frame, and margin on either side for the interpolation.
        self._frame = round(self._parameters.frame_s * SAMPLE_RATE_HZ)
        self._step = SAMPLE_RATE_HZ / self._parameters.sample_rate_hz
        self._margin = 0 if self._step == 1.0 else KERNEL_REACH
        self._heard = self._frame + 2 * self._margin
        self._needed = self._images.length - 1 + self._heard
        self._size = int(fft.next_fast_len(self._needed, real=True))
        self._spectrum = lru_cache(maxsize=_KEPT)(self._compute_spectrum)

    def frames(
        self,
        emissions: Sequence[Emission],
        time: float,
        old: NDArray[np.float64],
        new: NDArray[np.float64],
        array: RealArray,
    ) -> list[NDArray[np.float32] | None]:
        """Computes the sound pressure of the reflections over one audio frame.

        Args:
            emissions: Sounds of the k sources. Each must begin earlier than the frame
                by at least the length of the response.
            time: End of the frame, s.
            old: (3 + 2 k,) x, y, theta of the robot and x, y of each source at the
                beginning of the frame, in the world frame W, m and rad.
            new: (3 + 2 k,) values at the end of the frame, in the form of ``old``.
            array: Array with its errors.

        Returns:
            One entry per source: (m, samples) sound pressure, Pa, or None if the source
            is silent.

        Raises:
            InputError: A microphone or a source is outside the room, or an emission
                does not reach back far enough.
        """
        return [
            self._reflected(emission, time, _place(old, k), _place(new, k), array)
            for k, emission in enumerate(emissions)
        ]

    def _reflected(
        self,
        emission: Emission,
        time: float,
        old: tuple[float, ...],
        new: tuple[float, ...],
        array: RealArray,
    ) -> NDArray[np.float32] | None:
        """Computes the reflections of one source in a frame; None if it is silent."""
        end = round((time - emission.start_time) * SAMPLE_RATE_HZ) + self._margin
        if end < self._needed:
            longest_m = self._images.length / SAMPLE_RATE_HZ * self._c
            raise InputError(
                "MicArray",
                f"reflections travel {longest_m:.0f} m, farther than the stored "
                "emission reaches; raise maximum_range_m of SoundEmitter",
            )
        if not emission.sounding:
            return None
        # Convolve the sound in the frequency domain.
        sent = fft.rfft(emission.samples[end - self._needed : end], self._size)
        heard = self._convolved(sent, new, array)
        if old != new:
            # Fade linearly from the old to the new response.
            before = self._convolved(sent, old, array)
            share = np.arange(self._heard, dtype=np.float32) - self._margin + 0.5
            heard = before + share / self._frame * (heard - before)
        if not self._margin:
            return heard
        count = self._parameters.frame_samples
        return sampled_at(heard, self._margin, self._step, count)

    def _convolved(
        self,
        sent: NDArray[np.complex64],
        places: tuple[float, ...],
        array: RealArray,
    ) -> NDArray[np.float32]:
        """Convolves sound with the room response, for the frame and its margins."""
        late = array.instants[:, 0]
        key = (array.p_BM.tobytes(), late.tobytes(), array.c)
        heard = fft.irfft(sent * self._spectrum(places, *key), self._size)
        return heard[:, self._needed - self._heard : self._needed]

    def _compute_spectrum(
        self, places: tuple[float, ...], p_BM: bytes, late: bytes, c: float
    ) -> NDArray[np.complex64]:
        """Computes the spectrum of the room response for given positions.

        The arrays are bytes, so that the cache can use them as keys.
        """
        x, y, theta, *p_WS = places
        dx, dy = rotate(theta, *np.frombuffer(p_BM).reshape(-1, 2).T)
        p_WM = np.column_stack([x + dx, y + dy])
        for who, where in (("a microphone", p_WM), ("a source", np.array([p_WS]))):
            if not self.room.contains(where):
                at = ", ".join(f"({a:.2f}, {b:.2f})" for a, b in where)
                raise InputError(
                    "MicArray",
                    f"{who} is outside the room, at {at} m; enlarge "
                    "room.size_m or move room.corner_m",
                )
        response = room_impulse_responses(
            self.room,
            p_WS,
            p_WM,
            c,
            late=np.frombuffer(late),
            direct=False,
            images=self._images,
        )
        return fft.rfft(response, self._size)
