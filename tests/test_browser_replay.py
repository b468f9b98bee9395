"""The replay draws and moves in a browser that has no network."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from analysis.runs.replay import write_replay
from diagrams import load_scenario, simulate

pytestmark = [pytest.mark.browser, pytest.mark.slow]

Chromium = Callable[..., str]

#: Animation times of the two pictures, s; the source is silent in both.
EARLY_S, LATE_S = 0.8, 5.8


def _picture(chromium: Chromium, page: Path, time: float) -> np.ndarray:
    """(rows, columns, 3) screenshot of the page's animation at a time, in 0..1."""
    seek = f"viewer.animator.pause(); viewer.animator.seek({time})"
    script = f"<script>setTimeout(() => {{ {seek} }}, 2500)</script></body>"
    sought = page.parent / f"at_{time}.html"
    sought.write_text(page.read_text().replace("</body>", script))
    shot = page.parent / f"at_{time}.png"
    # A large picture takes a slow machine longer to draw than virtual time allows a
    # frame, and Chromium then waits for ever; by stages, it waits for the picture.
    chromium(
        sought,
        "--window-size=600,400",
        "--virtual-time-budget=8000",
        "--run-all-compositor-stages-before-draw",
        f"--screenshot={shot}",
    )
    assert shot.is_file()
    return np.asarray(imread(shot))[:, :, :3]


@pytest.fixture(scope="module")
def pictures(
    tmp_path_factory: pytest.TempPathFactory, chromium: Chromium
) -> list[np.ndarray]:
    folder = tmp_path_factory.mktemp("replay")
    result = simulate(load_scenario("default", ["hearing=ideal", "duration_s=6"]))
    write_replay(result, folder / "replay.html")
    return [_picture(chromium, folder / "replay.html", t) for t in (EARLY_S, LATE_S)]


def _place(picture: np.ndarray, channel: int) -> np.ndarray:
    """Mean column and row of the pixels in which one colour rules."""
    others = np.delete(picture, channel, axis=2).max(axis=2)
    rows, columns = np.nonzero(picture[:, :, channel] > others + 0.25)
    assert len(rows) > 50, "the body of this colour is not in the picture"
    return np.array([columns.mean(), rows.mean()])


def test_both_pictures_show_a_scene(pictures):
    for picture in pictures:
        levels = np.unique((picture * 255.0).astype(int).reshape(-1, 3), axis=0)
        assert len(levels) > 50
        assert picture.std() > 0.02


def test_the_picture_moves(pictures):
    early, late = pictures
    changed = np.abs(late - early).max(axis=2) > 0.1
    assert changed.mean() > 0.002


def test_the_source_drives_to_the_right_and_the_robot_after_it(pictures):
    # x of W is to the right; the source is orange, the robot blue.
    early, late = pictures
    assert _place(late, 0)[0] > _place(early, 0)[0] + 20.0
    assert _place(late, 2)[0] > _place(early, 2)[0] + 20.0


def test_the_floor_that_is_known_grows(tmp_path: Path, chromium: Chromium) -> None:
    """It is light green, on a floor of grey; the robot drives into the open."""
    overrides = ["hearing=ideal", "guard={}", "duration_s=4"]
    result = simulate(load_scenario("two_static_obstacles", overrides))
    write_replay(result, tmp_path / "replay.html")
    shares = []
    for time in (0.3, 3.8):
        red, green, blue = np.moveaxis(
            _picture(chromium, tmp_path / "replay.html", time), 2, 0
        )
        greenish = (green > red + 0.06) & (green > blue + 0.005) & (green > 0.6)
        shares.append(greenish.mean())
    assert shares[0] > 0.02
    assert shares[1] > 1.5 * shares[0]
