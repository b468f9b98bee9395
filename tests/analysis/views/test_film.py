"""Films are read back: length, pictures, sound; what cannot be encoded is refused."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
import soundfile
from matplotlib.colors import to_rgb
from PIL import Image, ImageSequence

from analysis.report.palette import COLORS, ROBOT_COLORS
from analysis.run_error import RunError
from analysis.views.film import RunFrames, circles
from analysis.views.movie_file import MovieFile
from analysis.views.scene import Rings, make_scene
from diagrams import load_scenario, simulate
from systems.framework.input_error import InputError


def _pictures(count: int = 8) -> list[np.ndarray]:
    """Gray that grows lighter, with an odd number of rows."""
    return [np.full((31, 40, 3), 10 * k, dtype=np.uint8) for k in range(count)]


def test_a_gif_has_every_picture_at_ten_a_second(tmp_path):
    MovieFile(tmp_path / "film.gif").write(_pictures())
    with Image.open(tmp_path / "film.gif") as film:
        assert sum(1 for _ in ImageSequence.Iterator(film)) == 8
        assert film.size == (40, 31)
        assert film.info["duration"] == 100
        film.seek(7)
        assert np.asarray(film.convert("RGB")).mean() == pytest.approx(70.0, abs=10.0)


def test_an_mp4_has_every_picture_at_25_a_second(tmp_path):
    MovieFile(tmp_path / "film.mp4").write(_pictures())
    words = ["-v", "error", "-i", str(tmp_path / "film.mp4"), "-f", "rawvideo"]
    done = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), *words, "-pix_fmt", "rgb24", "-"],
        check=True,
        capture_output=True,
    )
    # An even number of rows.
    pictures = np.frombuffer(done.stdout, np.uint8).reshape(-1, 32, 40, 3)
    means = pictures.mean(axis=(1, 2, 3))
    assert len(means) == 8
    assert imageio_ffmpeg.count_frames_and_secs(tmp_path / "film.mp4") == (8, 0.32)
    # The row that was added is white.
    assert means == pytest.approx([(31 * 10 * k + 255) / 32 for k in range(8)], abs=6.0)


def test_left_and_right_are_the_outer_microphones(tmp_path):
    """Left a tone, right silence, and a loud middle that is left out."""
    rate, time = 20_000, np.arange(20_000) / 20_000
    tone = 0.01 * np.sin(2.0 * np.pi * 440.0 * time)
    middle = 0.02 * np.sin(2.0 * np.pi * 3000.0 * time)
    sound = tmp_path / "heard.wav"
    soundfile.write(sound, np.column_stack([tone, middle, 0.0 * tone]), rate)
    MovieFile(tmp_path / "film.mp4").write(_pictures(25), sound)
    samples, at = _sound_of(tmp_path / "film.mp4")
    left, right = samples[:, at // 4 : at // 2]
    assert np.abs(right).max() < 0.01
    # The loudest microphone is raised to 0.9, the left one is half as loud.
    assert np.abs(left).max() == pytest.approx(0.45, rel=0.15)
    spectrum = np.abs(np.fft.rfft(left * np.hanning(len(left))))
    peak = np.fft.rfftfreq(len(left), 1.0 / at)[spectrum.argmax()]
    assert peak == pytest.approx(440.0, abs=10.0)


def _sound_of(film: Path) -> tuple[np.ndarray, int]:
    """(2, n) samples and their rate."""
    wav = film.with_suffix(".wav")
    words = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(film), str(wav)]
    subprocess.run(words, check=True)
    samples, rate = soundfile.read(wav)
    return samples.T, rate


@pytest.mark.parametrize("name", ["film.avi", "film", "nowhere/film.gif", "there.gif"])
def test_files_that_cannot_be_made_are_refused(tmp_path, name):
    (tmp_path / "there.gif").touch()
    with pytest.raises(InputError, match="movie"):
        MovieFile(tmp_path / name)


def test_a_missing_encoder_says_what_to_install(tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, *rest: None if name == "imageio_ffmpeg" else find(name, *rest),
    )
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'phonotaxis\[movie\]'"):
        MovieFile(tmp_path / "film.mp4")
    MovieFile(tmp_path / "film.gif")


def test_an_encoder_that_fails_leaves_nothing(tmp_path):
    movie = MovieFile(tmp_path / "film.mp4")

    def pictures():
        yield from _pictures(2)
        raise RuntimeError("a picture fails")

    with pytest.raises(RuntimeError, match="a picture fails"):
        movie.write(pictures())
    assert list(tmp_path.iterdir()) == []


def test_the_words_of_ffmpeg_are_passed_on(tmp_path):
    movie, sound = MovieFile(tmp_path / "film.mp4"), tmp_path / "heard.wav"
    soundfile.write(sound, np.zeros((100, 3)), 20_000)
    pictures = [np.zeros((0, 40, 3), dtype=np.uint8)]
    with pytest.raises(RunError, match="ffmpeg failed: "):
        movie.write(pictures, sound)
    assert list(tmp_path.iterdir()) == [sound]


def test_a_full_disk_is_told(tmp_path, monkeypatch):
    movie = MovieFile(tmp_path / "film.gif")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(MovieFile, "_write_gif", full)
    with pytest.raises(RunError, match="No space left"):
        movie.write(_pictures())
    assert list(tmp_path.iterdir()) == []


def _colored(picture: np.ndarray, role: str) -> np.ndarray:
    """Mean column and row of the pixels in one color."""
    wanted = 255.0 * np.array(to_rgb(COLORS[role]))
    rows, columns = np.nonzero(np.abs(picture - wanted).max(axis=2) < 12.0)
    assert len(rows) > 10, role
    return np.array([columns.mean(), rows.mean()])


def test_the_pictures_show_the_run(collision_run):
    """The robot drives along x; what it touches is red once it does."""
    frames = RunFrames(collision_run)
    early, late = frames.frame(0.2), frames.frame(collision_run.simulated_s)
    assert early.shape == late.shape
    assert _colored(late, "robot")[0] > _colored(early, "robot")[0] + 20.0
    _colored(late, "hit")
    red = np.abs(early - 255.0 * np.array(to_rgb(COLORS["hit"]))).max(axis=2) < 12.0
    assert not red.any()


def test_a_film_lasts_as_long_as_its_run(collision_run):
    count = sum(1 for _ in RunFrames(collision_run).frames(5.0))
    assert count == round(5.0 * collision_run.simulated_s)


def test_a_film_shows_the_target_and_the_goal_of_a_route():
    """The robot has no microphones; both robots have their own color."""
    result = simulate(load_scenario("robots_2", ["duration_s=1"]))
    late = RunFrames(result).frame(1.0)
    assert late.shape[2] == 3
    for color in ROBOT_COLORS[:2]:
        wanted = 255.0 * np.array(to_rgb(color))
        assert (np.abs(late - wanted).max(axis=2) < 12.0).sum() > 10


def test_rings_grow_from_a_source_while_it_sounds(crossing_run):
    """3 m/s: 0.2 s after its start, a burst has rings of 0.6 m and of 0.15 m."""
    source = crossing_run.vector("p_WS")[:, 168]
    things = make_scene(crossing_run).things
    (thing,) = [each for each in things if isinstance(each.shape, Rings)]
    assert thing.pose(168)[:2] == pytest.approx(source)
    found = list(circles((0.0, 0.0), thing.shape.bursts, 4.2, "black"))
    assert [ring.radius for ring in found] == pytest.approx([0.6, 0.15])
