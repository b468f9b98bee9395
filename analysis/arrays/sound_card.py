"""Records a stream of sound with a sound card, using the ``sounddevice`` package."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.sound_stream import (
    BLOCK_S,
    SILENT_AFTER_S,
    STOPPED,
    Pace,
    SoundBlock,
    SoundStream,
    StreamBrokenError,
)
from systems.framework.input_error import InputError

# Largest number of blocks that wait to be processed. They last 5 s.
_MOST_WAITING = 250

# Largest relative difference between the card's sample rate and the requested rate.
_RATE_OFF = 1e-3

_LOST = "samples were lost; close other programs, or lower the rate"


def open_card(
    device: str | int | None, *, channels: int, sample_rate_hz: int
) -> SoundStream:
    """Opens an endless stream from a sound card.

    The card is given by its name, a part of its name, or its number. None selects the
    default card. Raises ``InputError`` if the package or the card is missing, or if the
    card cannot record these channels at this rate.
    """
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        raise InputError(
            "--device",
            f"sound cards need the sounddevice package and PortAudio ({error}); "
            "install phonotaxis[live] and libportaudio2, or pipe sound in",
        ) from None
    try:
        sounddevice.check_input_settings(
            device=device, channels=channels, samplerate=sample_rate_hz
        )
    except (sounddevice.PortAudioError, ValueError) as error:
        raise InputError(
            "--device",
            f"cannot record {channels} channels at {sample_rate_hz} Hz ({error}); "
            "python -m sounddevice lists the devices",
        ) from None
    recorder = _Recorder(channels, sample_rate_hz)

    def blocks() -> Iterator[SoundBlock]:
        try:
            with sounddevice.InputStream(
                samplerate=sample_rate_hz,
                blocksize=round(BLOCK_S * sample_rate_hz),
                device=device,
                channels=channels,
                dtype="float32",
                callback=recorder.came,
            ) as card:
                yield from recorder.blocks(card)
        except sounddevice.PortAudioError as error:
            raise StreamBrokenError(
                f"the sound card stopped recording ({error})"
            ) from None

    return SoundStream(channels, sample_rate_hz, blocks())


class _Recorder:
    """Queue of recorded blocks that are not processed yet."""

    def __init__(self, channels: int, sample_rate_hz: int) -> None:
        self._channels = channels
        self._rate = sample_rate_hz
        self._waiting: queue.Queue[tuple[NDArray[np.float32], bool]]
        self._waiting = queue.Queue(_MOST_WAITING)
        self._lost = False

    def came(self, samples: Any, _frames: int, _time: Any, status: Any) -> None:
        """Stores (k, channels) samples, which are valid only during this call.

        The thread of PortAudio calls this function.
        """
        lost = self._lost or bool(status.input_overflow)
        try:
            self._waiting.put_nowait((samples.T.copy(), lost))
            self._lost = False
        except queue.Full:
            self._lost = True

    def blocks(self, card: Any) -> Iterator[SoundBlock]:
        """Yields each block when it arrives, until the card is disconnected."""
        if abs(card.samplerate - self._rate) > _RATE_OFF * self._rate:
            raise InputError(
                "--rate",
                f"the sound card records at {card.samplerate:g} Hz, not at "
                f"{self._rate} Hz; give --rate {card.samplerate:.0f}",
            )
        pace, gap = Pace(self._rate), False
        while True:
            begun = time.monotonic()
            try:
                samples, lost = self._waiting.get(timeout=SILENT_AFTER_S)
            except queue.Empty:
                if not card.active:
                    raise StreamBrokenError("the sound card was disconnected") from None
                if not gap:
                    none = np.zeros((self._channels, 0), np.float32)
                    yield SoundBlock(none, (STOPPED,))
                gap = True
                pace.begin()
                continue
            faults = pace.came(samples.shape[1], time.monotonic() - begun)
            yield SoundBlock(samples, faults + (_LOST,) * lost, gap or lost)
            gap = False
