"""The live view moves in a browser while the run is computed."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import phonotaxis
from analysis.views.live_view import start_meshcat

pytestmark = [pytest.mark.browser, pytest.mark.slow]

DRAWN = "viewer.scene.getObjectByName('robot') !== undefined"


def _blue(page: Any) -> np.ndarray:
    """Mean column and row of the pixels of the robot, which is blue."""
    page.evaluate("new Promise((f) => requestAnimationFrame(() => setTimeout(f, 50)))")
    picture = np.asarray(imread(io.BytesIO(page.screenshot())))[:, :, :3]
    rows, columns = np.nonzero(picture[:, :, 2] > picture[:, :, :2].max(axis=2) + 0.25)
    assert len(rows) > 50, "the robot is not in the picture"
    return np.array([columns.mean(), rows.mean()])


def test_the_robot_moves_while_the_run_is_computed(browser):
    meshcat = start_meshcat()
    page = browser.new_page(viewport={"width": 900, "height": 700})
    page.goto(meshcat.web_url())
    seen: list[np.ndarray] = []

    def look(time: float) -> None:
        if len(seen) < 2 and time >= 3.0 * len(seen):
            page.wait_for_function(DRAWN)
            seen.append(_blue(page))

    phonotaxis.simulate(
        "default",
        hearing="ideal",
        duration_s=4.0,
        meshcat=meshcat,
        rate=10.0,
        progress=look,
    )
    assert meshcat.GetNumActiveConnections() == 1
    page.close()
    # x of W is to the right.
    assert seen[1][0] > seen[0][0] + 20.0
