"""Recordings and geometries that ``locate`` refuses, and what it says of them."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from analysis.arrays.array_geometry import ArrayGeometry, load_geometry
from phonotaxis import locate

#: (samples, 3) noise in three channels.
THREE = 0.1 * np.random.default_rng(0).standard_normal((9_600, 3))


def write(path, samples, rate=48_000):
    soundfile.write(path, samples, rate)
    return path


def test_recordings_that_cannot_be_used(tmp_path):
    tone, three = THREE[:, 0], THREE
    (tmp_path / "empty.wav").write_bytes(b"")
    (tmp_path / "text.wav").write_text("no sound")
    faults = {
        tmp_path / "empty.wav": "is empty",
        tmp_path / "text.wav": "not a readable",
        tmp_path / "missing.wav": "not a file",
        write(tmp_path / "mono.wav", tone): "is mono.*needs 3",
        write(tmp_path / "two.wav", three[:, :2]): "has 2 channels.*needs 3",
        write(tmp_path / "four.wav", np.stack([tone] * 4, axis=1)): (
            "has 4 channels.*robot's own array 3.*--geometry FILE"
        ),
        write(tmp_path / "short.wav", three[:100]): "2.08 ms.*at least 5.52 ms",
        write(tmp_path / "slow.wav", three, 4_000): "4000 Hz.*8000",
    }
    for path, says in faults.items():
        with pytest.raises(ValueError, match=says) as caught:
            locate(path)
        assert str(caught.value).startswith("recording: ")
        assert path.name in str(caught.value)


def test_further_channels_beside_those_of_a_geometry(tmp_path):
    path = write(tmp_path / "a.wav", np.stack([THREE[:, 0]] * 4, axis=1))
    places = ((0.0, 0.1), (0.0, 0.0), (0.0, -0.1))
    with pytest.raises(ValueError, match=r"has 4 channels.*in 'channels'") as caught:
        locate(path, ArrayGeometry(microphones=places))
    assert "[" not in str(caught.value)


def test_a_respeaker_with_six_channels(tmp_path):
    """Its first channel is processed sound, so the first four are a wrong example."""
    path = write(tmp_path / "a.wav", np.stack([THREE[:, 0]] * 6, axis=1))
    square = ((0.02, 0.02), (-0.02, 0.02), (-0.02, -0.02), (0.02, -0.02))
    with pytest.raises(ValueError, match=r"'channels: \[1, 2, 3, 4\]'"):
        locate(path, ArrayGeometry(microphones=square))


def test_rate_below_twice_the_band(tmp_path):
    path = write(tmp_path / "a.wav", THREE, 16_000)
    with pytest.raises(ValueError, match="16000 Hz, below twice the band"):
        locate(path, ArrayGeometry(band=(300.0, 9_000.0)))


GOOD = "microphones: [[0, 0.4], [0, 0], [0, -0.4]]\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "lists no microphones"),
        ("- 1\n- 2\n", "lists no microphones"),
        ("microphones: [[0, 1], [0, 0]\n", "is not usable as YAML"),
        ("microphones: [[0, 1]]\n", "1 given.*at least 2"),
        ("microphones: [[0, 1], [0, 0], [0, 1]]\n", "1 and 3 are 0 mm apart"),
        ("microphones: [[0, .nan], [0, 0], [0, -0.4]]\n", "finite"),
        ("microphones: [[0, 4000], [0, 0], [0, -4000]]\n", "8000 m apart.*in m"),
        (
            f"microphones: {[[0.01 * k, 0.0] for k in range(65)]}\n",
            "65 given; give at most 64",
        ),
        (GOOD + "channels: [0, 1]\n", "2 named for 3"),
        (GOOD + "channels: [0, 1, 1]\n", "twice"),
        (GOOD + "channels: [0, 1, -1]\n", "channels"),
        (GOOD + "sound_speed: -340\n", "sound_speed"),
        (GOOD + "sound_speed: 340\ntemperature_c: 20\n", "keep one"),
        (GOOD + "sound_speed: 0.34\n", "sound_speed.*100"),
        ("microphones: [1, 2, 3]\n", r"microphones.0: is 1; give \[x, y\]"),
        ("microphones: [[0, 0], [0, 1, 2], [1, 1]]\n", r"0, 1, 2\]; give \[x, y\]"),
        (GOOD + "band: [300, 330]\n", "band.*narrow.*500 Hz"),
        (GOOD + "band: 300\n", "band: is 300; give a list"),
        (GOOD + "band: [8000, 300]\n", "band"),
        (GOOD + "bandwidth: 3\n", "bandwidth: unknown key"),
        (GOOD + "position_std_m: -0.01\n", "position_std_m"),
        (GOOD + "position_std_m: 5\n", "position_std_m.*1"),
        (GOOD + "position_std_m: [0.01, 0.01]\n", "has 2 values for 3 microphones"),
        (
            GOOD + "position_std_m: 0.01\n"
            "position_covariance_m2: [[1.0e-4, 0], [0, 1.0e-4]]\n",
            "position_std_m.*keep one",
        ),
        (
            GOOD + "position_covariance_m2: [[1.0e-4]]\n",
            r"has 1 rows of \[1\]; give 2 x 2 .* 6 x 6",
        ),
        (
            GOOD + "position_covariance_m2: [[1.0e-4, 1.0e-4], [0, 1.0e-4]]\n",
            "not symmetric",
        ),
        (
            GOOD + "position_covariance_m2: [[1.0e-4, 2.0e-4], [2.0e-4, 1.0e-4]]\n",
            "negative variance",
        ),
        (
            GOOD + "sound_speed_std: 1\ntemperature_std_c: 1\n",
            "sound_speed_std.*keep one",
        ),
        (GOOD + "largest_range_error: 0\n", "largest_range_error"),
        (GOOD + "side: above\n", "side.*only ahead and behind"),
        (GOOD + "side: left\n", "side"),
        (
            "microphones: [[0, 0], [0, 1], [1, 0]]\nside: ahead\n",
            "side.*distinguishes all sides; remove",
        ),
    ],
)
def test_geometry_that_makes_no_sense(tmp_path, text, says):
    path = tmp_path / "geometry.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=says) as caught:
        load_geometry(path)
    message = str(caught.value)
    assert message.startswith("geometry: ")
    assert "\n" not in message


def test_geometry_file_that_is_missing(tmp_path):
    with pytest.raises(ValueError, match=r"geometry: .* is not a file"):
        load_geometry(tmp_path / "none.yaml")
