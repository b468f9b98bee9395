"""A sound card, by a stand-in for the ``sounddevice`` package."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from analysis.arrays import sound_card
from analysis.arrays.sound_card import open_card
from analysis.arrays.sound_stream import STOPPED, StreamBrokenError
from systems.framework.input_error import InputError

BLOCK = np.arange(960 * 4, dtype=np.float32).reshape(960, 4) / 4_000.0


class PortAudioError(Exception):
    """As the package has it."""


class Card:
    """Calls back what it is to record when it is opened, and then is silent."""

    def __init__(self, recorded, *, rate=48_000.0, active=True):
        self.recorded, self.samplerate, self.active = recorded, rate, active

    def open(self, *, callback, **words):
        self.words = words
        for samples, overflow in self.recorded:
            callback(
                samples, len(samples), None, SimpleNamespace(input_overflow=overflow)
            )
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.active = False


@pytest.fixture
def plug_in(monkeypatch):
    """Makes a card the one that there is, and no stop last long."""
    monkeypatch.setattr(sound_card, "SILENT_AFTER_S", 0.02)

    def plug_in(card: Card, check=lambda **_: None) -> Card:
        module = ModuleType("sounddevice")
        vars(module).update(
            PortAudioError=PortAudioError,
            check_input_settings=check,
            InputStream=card.open,
        )
        monkeypatch.setitem(sys.modules, "sounddevice", module)
        return card

    return plug_in


def test_blocks_are_what_was_recorded(plug_in):
    card = plug_in(Card([(BLOCK, False)] * 3))
    stream = open_card("usb", channels=4, sample_rate_hz=48_000)
    blocks = [next(stream.blocks) for _ in range(3)]
    for block in blocks:
        np.testing.assert_array_equal(block.samples, BLOCK.T)
        assert (block.faults, block.gap) == ((), False)
    assert card.words == {
        "samplerate": 48_000,
        "blocksize": 960,
        "device": "usb",
        "channels": 4,
        "dtype": "float32",
    }


def test_lost_samples_are_named_and_leave_a_gap(plug_in):
    plug_in(Card([(BLOCK, False), (BLOCK, True)]))
    blocks = open_card(None, channels=4, sample_rate_hz=48_000).blocks
    assert not next(blocks).faults
    lost = next(blocks)
    assert lost.gap
    assert lost.faults[0].startswith("samples were lost; close other programs")


def test_a_listener_that_is_too_slow_loses_samples_and_says_so(plug_in):
    plug_in(Card([(BLOCK, False)] * 260))
    blocks = open_card(None, channels=4, sample_rate_hz=48_000).blocks
    assert not any(next(blocks).gap for _ in range(250))
    # What came meanwhile was lost; the next one to come says so.
    assert next(blocks).faults == (STOPPED,)


def test_a_card_that_stops_is_named_once_and_one_that_is_gone_ends_it(plug_in):
    card = plug_in(Card([(BLOCK, False)]))
    blocks = open_card(None, channels=4, sample_rate_hz=48_000).blocks
    next(blocks)
    stopped = next(blocks)
    assert (stopped.samples.shape, stopped.faults) == ((4, 0), (STOPPED,))
    card.active = False
    with pytest.raises(StreamBrokenError, match="the sound card was disconnected"):
        next(blocks)


def test_what_the_package_raises_is_a_status(plug_in):
    card = plug_in(Card([]))
    card.open = lambda **_: (_ for _ in ()).throw(PortAudioError("Device unavailable"))
    plug_in(card)
    blocks = open_card(None, channels=4, sample_rate_hz=48_000).blocks
    with pytest.raises(StreamBrokenError, match="the sound card stopped recording"):
        next(blocks)


def test_a_card_with_a_rate_of_its_own_is_refused(plug_in):
    plug_in(Card([(BLOCK, False)], rate=44_100.0))
    blocks = open_card(None, channels=4, sample_rate_hz=48_000).blocks
    with pytest.raises(InputError, match="at 44100 Hz, not at 48000 Hz; give --rate"):
        next(blocks)


def test_a_card_that_cannot_record_so_is_refused(plug_in):
    def check(**_):
        raise ValueError("No input device matching 'none'")

    plug_in(Card([]), check)
    with pytest.raises(InputError, match="cannot record 4 channels at 48000 Hz"):
        open_card("none", channels=4, sample_rate_hz=48_000)


def test_without_the_package_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(InputError, match="and libportaudio2, or pipe sound in"):
        open_card(None, channels=4, sample_rate_hz=48_000)
