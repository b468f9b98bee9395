"""What the picture of the detection curve shows is what was counted."""

from __future__ import annotations

import numpy as np

from studies.support.detection import DetectionPoint, FalseAlarms
from studies.support.detection_plots import plot_detection


def points(line):
    return np.array([line.get_xdata(), line.get_ydata()], dtype=float).T


def test_lines_are_the_shares():
    curve = [DetectionPoint(-8.0, 50, 10, 9, 1), DetectionPoint(0.0, 50, 50, 50, 0)]
    alarms = [FalseAlarms(0.1, 400, 20), FalseAlarms(1e-7, 400, 0)]
    figure = plot_detection({"chirp": curve, "band_noise": curve}, alarms, 1e-7)
    left, right = figure.axes
    heard, wrong, *_ = left.lines
    np.testing.assert_allclose(points(heard), [[-8.0, 0.2], [0.0, 1.0]])
    np.testing.assert_allclose(points(wrong), [[-8.0, 0.02], [0.0, 0.0]])
    measured, none, line, default = right.lines
    np.testing.assert_allclose(points(measured), [[0.1, 0.05]])
    # Wilson: of no successes z^2 / (n + z^2) at most.
    limit = 1.96**2 / (400.0 + 1.96**2)
    np.testing.assert_allclose(points(none), [[1e-7, limit]], rtol=1e-3)
    np.testing.assert_array_equal(*points(line).T)
    assert points(default)[0, 0] == 1e-7
    legend = left.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "chirp, heard",
        "chirp, in a wrong place",
        "band noise, heard",
        "band noise, in a wrong place",
    ]
