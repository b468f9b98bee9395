"""Figure of the laws: force over distance and force over speed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

from matplotlib.figure import Figure

from analysis.laws.law_curves import LawCurves
from analysis.reporting.palette import SERIES_COLOURS
from systems.laws.catalogue import LAWS

#: Color and title of each law of the package, by name.
LAW_STYLES = {
    law.name: (law.colour or colour, law.label)
    for law, colour in zip(LAWS.values(), cycle(SERIES_COLOURS), strict=False)
}


def plot_law_curves(curves: Sequence[LawCurves]) -> Figure:
    """Plots forces over the distance (left) and the speed of approach (right).

    The obstacle of the left panel is at rest. Curves with the velocity term ``closing``
    are dashed.
    """
    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    by_distance, by_speed = figure.subplots(1, 2)
    for curve in curves:
        colour, title = LAW_STYLES.get(curve.law, (None, curve.law))
        if curve.velocity_term == "printed":
            by_distance.plot(curve.distance_m, curve.push_n, color=colour, label=title)
            by_speed.plot(curve.speed_m_s, curve.force_n, color=colour, label=title)
        else:
            by_speed.plot(curve.speed_m_s, curve.force_n, "--", color=colour)
    by_distance.set_xlabel("distance c (m)")
    by_distance.set_ylabel("force away from the obstacle (N)")
    by_distance.set_title("the obstacle at rest")
    by_speed.set_xlabel("speed of approach (m/s); negative: receding")
    by_speed.set_title(
        f"at c = {curves[0].at_distance_m:g} m; dashed: s of the approach only"
    )
    for axes in (by_distance, by_speed):
        axes.set_ylim(bottom=0.0)
        axes.grid(visible=True, alpha=0.3)
    by_distance.legend()
    return figure
