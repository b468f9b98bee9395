"""Picture of the bounds for a moving source and a moving obstacle."""

from __future__ import annotations

from matplotlib.figure import Figure

from analysis.certificates.disturbance_bounds import DisturbanceBounds
from analysis.reporting.palette import COLOURS

__all__ = ["plot_disturbance_bounds"]


def plot_disturbance_bounds(bounds: DisturbanceBounds) -> Figure:
    """Left: stretch by the source's speed. Right: certified time of an encounter."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    source, obstacle = figure.subplots(1, 2)
    straight = [row for row in bounds.source if row.acceleration_m_s2 == 0.0]
    for name, label, style in (
        ("bound_m", "proved", "-"),
        ("linear_peak_m", "largest, linear", "--"),
        ("simulated_m", "simulated", "o"),
        ("steady_m", "steady", ":"),
    ):
        rows = [row for row in straight if getattr(row, name) is not None]
        source.plot(
            [row.speed_m_s for row in rows],
            [getattr(row, name) for row in rows],
            style,
            color=COLOURS["robot"],
            label=label,
        )
    source.set_xlabel("speed of the source (m/s)")
    source.set_ylabel("largest |stretch| (m)")
    source.set_title("following a source that moves off", fontsize=11)
    speeds = [row.speed_m_s for row in bounds.obstacle]
    obstacle.semilogy(
        speeds,
        [row.certified_s for row in bounds.obstacle],
        "-",
        color=COLOURS["robot"],
        label="certified",
    )
    obstacle.semilogy(
        speeds,
        [row.encounter_s for row in bounds.obstacle],
        "--",
        color=COLOURS["obstacle"],
        label="passing through the reach",
    )
    hits = [row for row in bounds.obstacle if row.simulated_contact_s is not None]
    obstacle.semilogy(
        [row.speed_m_s for row in hits],
        [row.simulated_contact_s for row in hits],
        "x",
        color=COLOURS["source"],
        label="earliest simulated contact",
    )
    obstacle.set_xlabel("speed of the obstacle (m/s)")
    obstacle.set_ylabel("time (s)")
    obstacle.set_title("an obstacle that comes at a waiting robot", fontsize=11)
    for axes in (source, obstacle):
        axes.grid(color="#EEEEEE", which="both")
        axes.legend(fontsize=8)
    source.set_ylim(bottom=0.0)
    return figure
