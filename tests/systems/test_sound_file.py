"""Reading sound: what is in the file, and what is wrong with it."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from systems.sound_file import read_sound

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


def test_length_that_a_pipe_left_unknown(tmp_path):
    """Recorders that write to a pipe leave 0xFFFFFFFF as the length."""
    content = bytearray(wav(tmp_path / "a.wav", subtype="PCM_16").read_bytes())
    place = content.index(b"data") + 4
    content[place : place + 4] = b"\xff\xff\xff\xff"
    (tmp_path / "piped.wav").write_bytes(content)
    samples, _ = read_sound(tmp_path / "piped.wav", "sound.file")
    np.testing.assert_allclose(samples, TWO, atol=1e-4)
