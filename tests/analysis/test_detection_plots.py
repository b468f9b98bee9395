"""What the picture of the detection curve shows is what was counted."""

from __future__ import annotations

import numpy as np

from analysis.detection import DetectionPoint, FalseAlarms
from analysis.detection_plots import plot_detection


def test_lines_are_the_shares():
    points = [DetectionPoint(-8.0, 50, 10, 9, 1), DetectionPoint(0.0, 50, 50, 50, 0)]
    alarms = [FalseAlarms(0.1, 400, 20), FalseAlarms(1e-7, 400, 0)]
    figure = plot_detection({"chirp": points, "band_noise": points}, alarms, 1e-7)
    left, right = figure.axes
    heard, wrong, *_ = left.lines
    np.testing.assert_allclose(heard.get_xydata(), [(-8.0, 0.2), (0.0, 1.0)])
    np.testing.assert_allclose(wrong.get_xydata(), [(-8.0, 0.02), (0.0, 0.0)])
    measured, none, line, default = right.lines
    np.testing.assert_allclose(measured.get_xydata(), [(0.1, 0.05)])
    # Wilson: of no successes z^2 / (n + z^2) at most.
    limit = 1.96**2 / (400.0 + 1.96**2)
    np.testing.assert_allclose(none.get_xydata(), [(1e-7, limit)], rtol=1e-3)
    np.testing.assert_array_equal(*np.transpose(line.get_xydata()))
    assert default.get_xdata()[0] == 1e-7
    assert [text.get_text() for text in left.get_legend().get_texts()] == [
        "chirp, heard",
        "chirp, in a wrong place",
        "band noise, heard",
        "band noise, in a wrong place",
    ]
