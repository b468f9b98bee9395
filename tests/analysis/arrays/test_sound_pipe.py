"""Samples that come through a pipe are those that were sent."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest
import soundfile

from analysis.arrays.flac_stream import open_flac
from analysis.arrays.sound_pipe import open_pipe
from analysis.arrays.sound_stream import (
    STOPPED,
    Pace,
    StreamBrokenError,
    truncated_fault,
)
from systems.framework.input_error import InputError
from tests.analysis.arrays.plane_waves import RATE, wav_bytes

SAMPLES = (
    np.random.default_rng(2).integers(-(2**15), 2**15, (4, 1_000)) / 2**15
).astype(np.float32)


def stream_of(tmp_path, data: bytes, **stated):
    path = tmp_path / "sound"
    path.write_bytes(data)
    return open_pipe(path.open("rb"), raw_channels=4, **stated)


def heard(stream) -> tuple[np.ndarray, list[str]]:
    blocks = list(stream.blocks)
    stream.close()
    faults = [fault for block in blocks for fault in block.faults]
    return np.concatenate([block.samples for block in blocks], axis=1), faults


def raw(sample_format: str) -> bytes:
    whole = np.rint(SAMPLES.T.astype(float) * 2**15).astype(np.int64)
    if sample_format == "s16le":
        return whole.astype("<i2").tobytes()
    if sample_format == "s32le":
        return (whole << 16).astype("<i4").tobytes()
    if sample_format == "f32le":
        return SAMPLES.T.astype("<f4").tobytes()
    three = (whole << 8).astype("<i4").reshape(-1, 1).view(np.uint8)[:, :3]
    return three.tobytes()


@pytest.mark.parametrize("sample_format", ["s16le", "s24le", "s32le", "f32le"])
def test_raw_samples_of_each_format(tmp_path, sample_format):
    stream = stream_of(
        tmp_path, raw(sample_format), sample_rate_hz=RATE, sample_format=sample_format
    )
    samples, faults = heard(stream)
    assert not faults
    np.testing.assert_array_equal(samples, SAMPLES)


@pytest.mark.parametrize("subtype", ["PCM_16", "PCM_24", "PCM_32", "FLOAT"])
@pytest.mark.parametrize("kind", ["WAV", "WAVEX"])
def test_files_of_another_program(tmp_path, subtype, kind):
    path = tmp_path / "sound.wav"
    soundfile.write(path, SAMPLES.T, RATE, subtype=subtype, format=kind)
    stream = open_pipe(path.open("rb"), raw_channels=2)
    assert (stream.channels, stream.sample_rate_hz) == (4, RATE)
    samples, faults = heard(stream)
    assert not faults
    np.testing.assert_allclose(samples, SAMPLES, atol=2.0**-16)


@pytest.mark.parametrize("length", [0, 0x7FFF_FFFF, 0xFFFF_FFFF, 0x7FFF_F024])
@pytest.mark.parametrize("extra", [0, 24])
def test_wav_of_unknown_length_is_read_to_its_end(tmp_path, length, extra):
    data = wav_bytes(SAMPLES, length=length, extra=extra)
    samples, faults = heard(stream_of(tmp_path, data))
    assert not faults
    np.testing.assert_array_equal(samples, SAMPLES)


def test_flac_is_read_by_its_name_and_refused_in_a_pipe(tmp_path):
    path = tmp_path / "sound.flac"
    soundfile.write(path, SAMPLES.T, RATE)
    samples, _ = heard(open_flac(path))
    np.testing.assert_array_equal(samples, SAMPLES)
    with pytest.raises(InputError, match="FLAC; name the file, or decode it: flac"):
        open_pipe(path.open("rb"), raw_channels=4)


def test_a_truncated_file_is_named(tmp_path):
    data = wav_bytes(SAMPLES)
    samples, faults = heard(stream_of(tmp_path, data[: len(data) // 2]))
    np.testing.assert_array_equal(samples, SAMPLES[:, : samples.shape[1]])
    left_s = (SAMPLES.shape[1] - samples.shape[1]) / RATE
    assert f"truncated: it ends {left_s:.3g} s before" in faults[-1]


def test_a_truncated_flac_file_is_named(tmp_path):
    path = tmp_path / "sound.flac"
    soundfile.write(path, np.tile(SAMPLES, 30).T, RATE)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3])
    samples, faults = heard(open_flac(path))
    assert 12_000 < samples.shape[1] <= 20_000
    left_s = (30_000 - samples.shape[1]) / RATE
    assert faults == [truncated_fault(30_000 - samples.shape[1], RATE)]
    assert f"{left_s:.3g} s before" in faults[0]


def test_what_follows_the_samples_is_no_sound(tmp_path):
    data = wav_bytes(SAMPLES) + b"LIST\x03\x00\x00\x00abc\x00"
    np.testing.assert_array_equal(heard(stream_of(tmp_path, data))[0], SAMPLES)


@pytest.mark.parametrize("length", [None, 0])
@pytest.mark.parametrize("first", [318, 319, 320, 777])
def test_wav_after_wav_goes_on(tmp_path, length, first):
    """Its header of 44 bytes would exchange all channels if it were sound."""
    parts = SAMPLES[:, :first], SAMPLES[:, first:]
    data = b"".join(wav_bytes(part, length=length) for part in parts)
    samples, faults = heard(stream_of(tmp_path, data))
    assert not faults
    np.testing.assert_array_equal(samples, SAMPLES)


@pytest.mark.parametrize("length", [None, 0])
def test_a_change_of_rate_ends_the_stream(tmp_path, length):
    data = wav_bytes(SAMPLES, length=length) + wav_bytes(SAMPLES, rate=48_000)
    stream = stream_of(tmp_path, data)
    got: list[int] = []
    with pytest.raises(StreamBrokenError, match="16000 Hz, s16le to 4 channels, 48000"):
        got.extend(block.samples.shape[1] for block in stream.blocks)
    stream.close()
    assert sum(got) == SAMPLES.shape[1]


def test_an_end_within_a_sample_is_named(tmp_path):
    samples, faults = heard(stream_of(tmp_path, wav_bytes(SAMPLES, length=0)[:-3]))
    np.testing.assert_array_equal(samples, SAMPLES[:, :-1])
    assert faults == ["the stream ended within a sample of all channels"]


def test_a_stop_is_named_while_it_lasts():
    reader, writer = os.pipe()
    data = wav_bytes(SAMPLES, length=0)
    sent = threading.Event()

    def send():
        os.write(writer, data[:4_044])
        sent.wait(20.0)
        os.write(writer, data[4_044:])
        os.close(writer)

    thread = threading.Thread(target=send)
    thread.start()
    with os.fdopen(reader, "rb") as pipe:
        got, stops = [], 0
        for block in open_pipe(pipe, raw_channels=4).blocks:
            if block.faults == (STOPPED,):
                stops += 1
                sent.set()
            got.append(block)
    thread.join()
    assert stops == 1
    assert [k for k, block in enumerate(got) if block.gap] == [2]
    samples = np.concatenate([block.samples for block in got], axis=1)
    np.testing.assert_array_equal(samples, SAMPLES)


@pytest.mark.parametrize(
    ("data", "stated", "complaint"),
    [
        (b"", {}, "it is empty"),
        (b"\0" * 64, {}, "it is not a WAV file; state its format, for example"),
        (b"OggS" + b"\0" * 64, {}, "it is Ogg; decode it: ffmpeg"),
        (b"RIFF\0\0\0\0AVI \0\0\0\0", {}, "begins like a WAV file but is not one"),
        (wav_bytes(SAMPLES)[:30], {}, "ends within the WAV header"),
        (wav_bytes(SAMPLES), {"sample_rate_hz": 8_000}, "8000 Hz, but the file states"),
        (wav_bytes(SAMPLES), {"channels": 3}, "is 3, but the file has 4"),
    ],
)
def test_what_is_no_stream_is_refused(tmp_path, data, stated, complaint):
    with pytest.raises(InputError, match=complaint):
        stream_of(tmp_path, data, **stated)


def test_samples_at_another_pace_than_stated_are_named():
    """A recorder that gives 44.1 kHz, taken for one of 48 kHz."""
    now = 0.0
    pace = Pace(48_000, lambda: now)
    told: list[str] = []
    for _ in range(1_200):
        now += 0.02
        told += pace.came(882, 0.015)
    assert len(told) == 1
    assert told[0].startswith("samples come at 44.1 kHz, and 48 kHz are stated")


@pytest.mark.parametrize(
    ("samples", "waited_s"), [(960, 0.015), (882, 0.0), (9_000, 0)]
)
def test_a_good_pace_a_slow_computer_and_a_file_are_no_fault(samples, waited_s):
    now = 0.0
    pace = Pace(48_000, lambda: now)
    for _ in range(3_000):
        now += 0.02
        assert not pace.came(samples, waited_s)
