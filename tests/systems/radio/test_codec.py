"""Frames: all values go there and back."""

from __future__ import annotations

import itertools

import pytest

from tests.systems.radio.frames import Frame, decode, encode

ANGLES, FLAGS = (2, 5, 13), (12, 16)
VALUES = [6, 7, 8, 9, 10, 14, 15]


def all_frames():
    for address in (1, 2, 3):
        for function in ANGLES:
            for tenth in range(3600):
                yield Frame(address, function, tenth / 10.0)
        for function in VALUES:
            for hundredth in range(0, 10_000, 7):
                yield Frame(address, function, hundredth / 100.0)
        for function, value in itertools.product(FLAGS, (0.0, 1.0)):
            yield Frame(address, function, value)


def test_every_value_goes_there_and_back():
    for frame in all_frames():
        (got,) = decode(encode(frame))
        turned = frame.function == 13 and frame.value > 180.0
        expected = frame.value - 360.0 if turned else frame.value
        assert got[:2] == frame[:2]
        assert got.value == pytest.approx(expected, abs=1e-9)


def test_a_heading_is_written_as_the_paper_says():
    """Fn 5, 123.4 deg: one decimal digit a byte, the last one the decimal."""
    data = encode(Frame(1, 5, 123.4))
    assert data[:8] == [0xFA, 0xFB, 1, 5, 1, 2, 3, 4]
    assert data[8] == sum(data[:8]) % 256


def test_minus_136_degrees_comes_back_as_such():
    """Fig. 13: the direction of the sound, which 99.99 could not hold."""
    assert decode(encode(Frame(2, 13, -136.0))) == [Frame(2, 13, -136.0)]


@pytest.mark.parametrize(("value", "sent"), [(-1.0, 0.0), (123.0, 99.99)])
def test_a_value_beyond_four_digits_is_limited(value, sent):
    assert decode(encode(Frame(1, 14, value))) == [Frame(1, 14, sent)]
