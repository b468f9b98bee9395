"""Picture of the detection curve, and of false alarms beside what is set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from analysis.report.intervals import estimate_rate
from analysis.report.palette import COLORS, draw_grid
from studies.support.detection import DetectionPoint, FalseAlarms

#: Colors of the sounds, in turn.
_COLORS = (COLORS["robot"], COLORS["source"])


def plot_detection(
    curves: Mapping[str, Sequence[DetectionPoint]],
    alarms: Sequence[FalseAlarms],
    default_rate: float,
) -> Figure:
    """Frames heard against the level of the sound, and noise that is heard.

    Left, for every sound: the share of the frames in which it is heard, with the
    95 % interval of what was counted, and of those heard in a wrong place.
    Right: the share of the frames of noise in which something is heard, against
    the rate that is set; on the line they are equal.

    Args:
        curves: Points by the name of the sound.
        alarms: In frames of noise, by the rate that is set.
        default_rate: The rate that is set unless another one is, to mark it.

    Returns:
        The picture, 11 by 4.6 inches.
    """
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for color, (name, points) in zip(_COLORS, curves.items(), strict=True):
        _curve(left, name.replace("_", " "), points, color)
    left.set(
        xlabel="level of the sound at the array over the noise (dB)",
        ylabel="frames of 25 ms",
        ylim=(-0.03, 1.03),
    )
    left.yaxis.set_major_formatter(PercentFormatter(1.0))
    left.legend(fontsize=9, loc="center right")
    left.set_title("Sounds that are heard", fontsize=11)
    _false_alarms(right, alarms, default_rate)
    for axes in (left, right):
        draw_grid(axes)
    return figure


def _curve(axes: Axes, name: str, points: Sequence[DetectionPoint], color: str) -> None:
    levels = [point.snr_db for point in points]
    ends = np.array([estimate_rate(each.heard, each.trials).ends for each in points])
    axes.fill_between(levels, *ends.T, color=color, alpha=0.2, linewidth=0)
    heard = [point.heard / point.trials for point in points]
    wrong = [point.wrong / point.trials for point in points]
    for shares, line, what in (
        (heard, "o-", "heard"),
        (wrong, "x:", "in a wrong place"),
    ):
        label = f"{name}, {what}"
        axes.plot(levels, shares, line, color=color, markersize=4.0, label=label)


def _false_alarms(
    axes: Axes, alarms: Sequence[FalseAlarms], default_rate: float
) -> None:
    found = [alarm for alarm in alarms if alarm.count]
    shares = np.array([alarm.count / alarm.frames for alarm in found])
    ends = np.array([estimate_rate(each.count, each.frames).ends for each in found])
    axes.errorbar(
        [alarm.rate for alarm in found],
        shares,
        yerr=np.stack((shares - ends[:, 0], ends[:, 1] - shares)),
        fmt="o",
        markersize=4.0,
        color=COLORS["robot"],
        label=f"{alarms[0].frames} frames of noise",
    )
    silent = [alarm for alarm in alarms if not alarm.count]
    axes.plot(
        [alarm.rate for alarm in silent],
        [estimate_rate(0, alarm.frames).high for alarm in silent],
        "v",
        color=COLORS["robot"],
        label="none heard: below",
    )
    line = np.array([default_rate / 3.0, 1.0])
    axes.plot(line, line, color=COLORS["empty"], linewidth=1.0, label="as set")
    axes.axvline(default_rate, color=COLORS["source"], linestyle="--", label="default")
    axes.set(xscale="log", yscale="log", xlim=line, ylim=(0.3 / alarms[0].frames, 1.3))
    axes.set_xlabel("false-alarm rate that is set")
    axes.set_ylabel("share of the frames in which a sound is heard")
    axes.legend(fontsize=9, loc="upper left", bbox_to_anchor=(0.06, 1.0))
    axes.set_title("Noise that is heard", fontsize=11)
