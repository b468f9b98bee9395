"""Reading sound: what is in the file, and what is wrong with it."""

from __future__ import annotations

import re

import numpy as np
import pytest
import soundfile

from systems.framework.input_error import LONGEST_MESSAGE, InputError
from systems.sound.sound_file import read_recording, read_sound

TWO = np.stack([np.linspace(-0.5, 0.5, 400), np.linspace(0.25, 0.0, 400)])


@pytest.mark.parametrize(
    ("name", "subtype"),
    [
        ("a.wav", "PCM_U8"),
        ("a.wav", "PCM_16"),
        ("a.wav", "PCM_24"),
        ("a.wav", "FLOAT"),
        ("a.flac", "PCM_16"),
    ],
)
def test_channels_first_at_full_scale_one(tmp_path, name, subtype):
    soundfile.write(tmp_path / name, TWO.T, 44_100, subtype=subtype)
    samples, rate = read_sound(tmp_path / name, "sound.file")
    assert rate == 44_100
    np.testing.assert_allclose(samples, TWO, atol=1 / 127)


def wav(path, samples=TWO, subtype="FLOAT"):
    soundfile.write(path, samples.T, 44_100, subtype=subtype)
    return path


def broken_files(folder):
    """Name of the fault, file, and what the message must say."""
    whole = wav(folder / "whole.wav").read_bytes()
    flac = folder / "whole.flac"
    soundfile.write(flac, TWO.T, 44_100)
    nan = TWO.copy()
    nan[1, 7] = np.nan
    contents = {
        "empty file": b"",
        "truncated": whole[: len(whole) // 2],
        "cut in the header": whole[:30],
        "cut in the first bytes": whole[:6],
        "text": b"this is no sound at all" * 10,
        "flac truncated": flac.read_bytes()[: flac.stat().st_size // 2],
    }
    says = {
        "empty file": "is empty",
        "truncated": "is truncated",
        "cut in the header": "is truncated",
        "cut in the first bytes": "is truncated",
        "text": "not a readable WAV or FLAC",
        "flac truncated": "truncated|not a readable",
    }
    for fault, content in contents.items():
        path = folder / f"{fault}.wav"
        path.write_bytes(content)
        yield path, says[fault]
    yield wav(folder / "nan.wav", nan), "NaN.*first in channel 2 as sample 7"
    yield wav(folder / "silent.wav", 0 * TWO), "silent"
    yield wav(folder / "none.wav", TWO[:, :0]), "no samples"
    yield folder / "missing.wav", "not a file"
    yield folder, "not a file"


def test_every_fault_is_named(tmp_path):
    for path, says in broken_files(tmp_path):
        with pytest.raises(ValueError, match=says) as caught:
            read_sound(path, "sound.file")
        message = str(caught.value)
        assert message.startswith("sound.file: ")
        assert path.name in message
        assert "\n" not in message


@pytest.mark.parametrize(
    ("name", "subtype"),
    [
        ("a.wav", "PCM_16"),
        ("a.wav", "PCM_24"),
        ("a.wav", "FLOAT"),
        ("a.aiff", "PCM_16"),
        ("a.au", "PCM_16"),
        ("a.w64", "PCM_16"),
        ("a.rf64", "PCM_16"),
    ],
)
@pytest.mark.parametrize("share", [0.3, 0.66, 0.98])
def test_samples_before_the_end_of_a_truncated_file(tmp_path, name, subtype, share):
    rng = np.random.default_rng(1)
    whole = rng.uniform(-0.9, 0.9, (3, 9_000))
    path = tmp_path / name
    kind = "RF64" if name == "a.rf64" else None
    soundfile.write(path, whole.T, 44_100, subtype=subtype, format=kind)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    samples, rate, truncated = read_recording(path, "recording")
    count = samples.shape[1]
    assert rate == 44_100
    assert count == pytest.approx(share * 9_000, abs=60)
    np.testing.assert_allclose(samples, whole[:, :count], atol=1e-4)
    told = re.search(r"truncated: (\d+) of (\d+) samples", truncated)
    assert told is not None
    assert int(told[1]) == count
    assert int(told[2]) == pytest.approx(9_000, abs=60)


@pytest.mark.parametrize("share", [0.3, 0.66, 0.98])
@pytest.mark.parametrize("stated", [60_000, 0])
def test_samples_before_the_end_of_a_truncated_flac(tmp_path, share, stated):
    """Blocks of FLAC are whole or not at all."""
    rng = np.random.default_rng(1)
    whole = np.rint(2.0**15 * rng.uniform(-0.9, 0.9, (2, 60_000))) / 2.0**15
    path = tmp_path / "a.flac"
    soundfile.write(path, whole.T, 44_100, subtype="PCM_16")
    content = bytearray(path.read_bytes())
    content[18:26] = (44_100 << 44 | 1 << 41 | 15 << 36 | stated).to_bytes(8, "big")
    path.write_bytes(content[: int(share * len(content))])
    samples, _, truncated = read_recording(path, "recording")
    count = samples.shape[1]
    assert share * 60_000 - 8_192 < count <= share * 60_000
    np.testing.assert_array_equal(samples, whole[:, :count])
    says = f"{count} of 60000" if stated else f"only {count} samples"
    assert f"truncated: {says}" in truncated


@pytest.mark.parametrize("name", ["a.raw", "a.RAW", "a.pcm", "a.bin", "a"])
def test_samples_without_a_header(tmp_path, name):
    path = tmp_path / name
    content = np.random.default_rng(1).integers(0, 256, 4_000, np.uint8).tobytes()
    for begin in (b"", b"\xff\xff" * 5, b"\xff\xfb\x90\x64", bytes(40)):
        path.write_bytes(begin + content)
        with pytest.raises(ValueError, match=r"raw samples.*ffmpeg -f s16le") as caught:
            read_sound(path, "sound.file")
        assert len(str(caught.value)) < LONGEST_MESSAGE


def test_a_name_of_raw_samples_for_a_file_with_a_header(tmp_path):
    wav(tmp_path / "a.wav").rename(tmp_path / "a.raw")
    np.testing.assert_allclose(read_sound(tmp_path / "a.raw", "f")[0], TWO, atol=1e-6)


def test_length_that_a_pipe_left_unknown(tmp_path):
    """Recorders that write to a pipe leave 0xFFFFFFFF as the length."""
    content = bytearray(wav(tmp_path / "a.wav", subtype="PCM_16").read_bytes())
    place = content.index(b"data") + 4
    content[place : place + 4] = b"\xff\xff\xff\xff"
    (tmp_path / "piped.wav").write_bytes(content)
    samples, _ = read_sound(tmp_path / "piped.wav", "sound.file")
    np.testing.assert_allclose(samples, TWO, atol=1e-4)


def flac(path, *, rate=44_100, frames):
    """A FLAC file whose header states another rate and length, in its 64 bits."""
    soundfile.write(path, TWO.T, 44_100, subtype="PCM_16")
    content = bytearray(path.read_bytes())
    # 20 bits of rate, 3 of channels less 1, 5 of bits less 1, 36 of length.
    stated = rate << 44 | 1 << 41 | 15 << 36 | frames
    content[18:26] = stated.to_bytes(8, "big")
    path.write_bytes(content)
    return path


def test_flac_that_does_not_say_how_long_it_is(tmp_path):
    """0 samples in its header: legal, as of an encoder that wrote to a pipe."""
    samples, rate = read_sound(flac(tmp_path / "a.flac", frames=0), "sound.file")
    assert rate == 44_100
    np.testing.assert_allclose(samples, TWO, atol=1e-4)


@pytest.mark.parametrize(
    ("rate", "frames", "says"),
    [
        (44_100, 2**36 - 1, "68719476735 samples of 2 channels, above 134217728"),
        (44_100, 401, "truncated: 400 of 401"),
        (0, 400, "not a readable"),
        (655_350, 400, "rate of 655350 Hz; record at 1000 to 400000 Hz"),
        (655_350, 0, "rate of 655350 Hz; record at 1000 to 400000 Hz"),
    ],
)
def test_absurd_header(tmp_path, rate, frames, says):
    path = flac(tmp_path / "a.flac", rate=rate, frames=frames)
    with pytest.raises(ValueError, match=says) as caught:
        read_sound(path, "sound.file")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("frames", [0, 400])
def test_a_file_beyond_the_limit(tmp_path, monkeypatch, frames):
    path = flac(tmp_path / "a.flac", frames=frames)
    monkeypatch.setattr("systems.sound.sound_file.MOST_SAMPLES", 799)
    with pytest.raises(ValueError, match=r"799.*cut it into shorter"):
        read_sound(path, "sound.file")
    monkeypatch.setattr("systems.sound.sound_file.MOST_SAMPLES", 800)
    assert read_sound(path, "sound.file")[0].shape == (2, 400)


@pytest.mark.parametrize(
    "unknown", [0, 0x7FFF_0000, 0x7FFFF000, 0x7FFFF024, 0x7FFFFFFF, 2**31, 2**32 - 1]
)
@pytest.mark.parametrize("before", [b"", b"LIST\x06\0\0\0INFO\0\0"])
def test_sizes_that_a_stream_left_unknown(tmp_path, unknown, before):
    content = wav(tmp_path / "a.wav", subtype="PCM_16").read_bytes()
    place = content.index(b"data")
    size = unknown.to_bytes(4, "little")
    (tmp_path / "b.wav").write_bytes(
        b"RIFF" + size + content[8:place] + before + b"data" + size
        + content[place + 8 :]
    )  # fmt: skip
    samples, _ = read_sound(tmp_path / "b.wav", "sound.file")
    np.testing.assert_allclose(samples, TWO, atol=1e-4)


def test_header_of_a_recorder_that_was_cut_off(tmp_path):
    """It wrote 0 samples first, and 36 bytes to follow, and meant to come back."""
    content = bytearray(wav(tmp_path / "a.wav", subtype="PCM_16").read_bytes())
    content[4:8] = (36).to_bytes(4, "little")
    content[40:44] = bytes(4)
    (tmp_path / "b.wav").write_bytes(content)
    samples, _ = read_sound(tmp_path / "b.wav", "sound.file")
    np.testing.assert_allclose(samples, TWO, atol=1e-4)


def test_what_follows_no_samples_is_no_sound(tmp_path):
    content = bytearray(wav(tmp_path / "a.wav", TWO[:, :0], "PCM_16").read_bytes())
    content += b"LIST\x06\0\0\0INFO\0\0"
    content[4:8] = (len(content) - 8).to_bytes(4, "little")
    (tmp_path / "b.wav").write_bytes(content)
    with pytest.raises(ValueError, match="no samples"):
        read_sound(tmp_path / "b.wav", "sound.file")


@pytest.mark.parametrize("rate", [1_000, 400_000])
def test_first_and_last_rate(tmp_path, rate):
    soundfile.write(tmp_path / "a.wav", TWO.T, rate, subtype="PCM_16")
    assert read_sound(tmp_path / "a.wav", "sound.file")[1] == rate
    over = rate - 1 if rate == 1_000 else rate + 1
    soundfile.write(tmp_path / "b.wav", TWO.T, over, subtype="PCM_16")
    with pytest.raises(ValueError, match=f"rate of {over} Hz"):
        read_sound(tmp_path / "b.wav", "sound.file")


def test_a_file_of_many_samples(tmp_path):
    """More than are read at once, and not by a whole number of times."""
    rng = np.random.default_rng(1)
    long = np.rint(2.0**15 * rng.uniform(-1.0, 0.9, (2, 150_001))) / 2.0**15
    soundfile.write(tmp_path / "a.flac", long.T, 44_100, subtype="PCM_16")
    np.testing.assert_array_equal(read_sound(tmp_path / "a.flac", "f")[0], long)


@pytest.mark.parametrize("size", [b"\xff\xff\xff\xff", None])
def test_chunks_of_odd_length_are_followed_by_a_byte(tmp_path, size):
    content = wav(tmp_path / "a.wav", subtype="PCM_16").read_bytes()
    place = content.index(b"data")
    odd = b"LIST\x07\0\0\0INFOabc\0"
    data = content[place + 8 :]
    (tmp_path / "b.wav").write_bytes(
        b"RIFF" + (len(content) + len(odd) - 8).to_bytes(4, "little")
        + content[8:place] + odd + b"data"
        + (size or len(data).to_bytes(4, "little")) + data
    )  # fmt: skip
    samples, _ = read_sound(tmp_path / "b.wav", "sound.file")
    np.testing.assert_allclose(samples, TWO, atol=1e-4)


def test_samples_beyond_single_precision_are_refused(tmp_path):
    """Their powers would be infinite; unscaled 32-bit numbers are not so large."""
    path = tmp_path / "large.wav"
    samples = np.sin(np.arange(4_000.0))
    soundfile.write(path, 2.0**31 * samples, 48_000, subtype="DOUBLE")
    assert np.abs(read_sound(path, "file")[0]).max() > 2e9
    for most in (1e13, 1e300):
        soundfile.write(path, most * samples, 48_000, subtype="DOUBLE")
        with pytest.raises(InputError, match=r"samples up to 1\.0e\+.* 16 or 24 bits"):
            read_sound(path, "file")
