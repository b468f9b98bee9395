"""Draws a calibrated array."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from analysis.arrays.calibrate import CalibrationRun
from analysis.report.palette import SERIES_COLORS, draw_grid


def plot_calibration(run: CalibrationRun) -> Figure:
    """Draws the stated and the calibrated microphones from above.

    Args:
        run: The calibration.

    Returns:
        Figure with one panel. Bars are one standard deviation in x and in y, in m.
    """
    calibration = run.calibration
    stated = np.array(run.geometry.microphones)
    places = calibration.places
    stds = np.sqrt(np.diag(calibration.of_places)).reshape(places.shape)
    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.plot(*stated[:, :2].T, "x", color=SERIES_COLORS[1], label="stated")
    axes.errorbar(
        places[:, 0],
        places[:, 1],
        xerr=stds[:, 0],
        yerr=stds[:, 1],
        fmt="o",
        markersize=4,
        color=SERIES_COLORS[0],
        label="calibrated",
    )
    for k, place in enumerate(places):
        axes.annotate(str(k + 1), place[:2], xytext=(5, 5), textcoords="offset points")
    draw_grid(axes)
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.set_title("Microphones from above, bars: one standard deviation", fontsize=10)
    axes.legend()
    return figure
