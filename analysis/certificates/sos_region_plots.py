"""Picture of the sum-of-squares region."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from analysis.certificates.sos_region import SosRegion
from analysis.nonlinear.phase_portrait import certified_speeds, head_on_model
from analysis.reporting.palette import COLOURS

__all__ = ["plot_sos_region"]


def plot_sos_region(region: SosRegion) -> Figure:
    """The slice w = v of the region, beside what the energy certifies without lag."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    axes = figure.subplots()
    model = region.model
    rest, scales = model.contact.equilibrium_m, model.scales
    x = np.linspace(*model.domain_m, 301)
    limit = certified_speeds(head_on_model(model.contact), rest + x, region.contact_m)
    axes.fill_between(
        rest + x,
        -np.minimum(limit, scales[1]),
        np.minimum(limit, scales[1]),
        color="#DCEBF7",
        label="energy, without motor lag",
    )
    v = np.linspace(-scales[1], scales[1], 301)
    grid_x, grid_v = np.meshgrid(x, v, indexing="ij")
    y = np.stack([grid_x, grid_v, grid_v], axis=-1) / scales
    V = np.einsum("...i,ij,...j->...", y, region.P, y)
    axes.contour(rest + x, v, V.T, levels=[1.0], colors=[COLOURS["robot"]])
    axes.plot([], [], color=COLOURS["robot"], label="sum of squares, with motor lag")
    axes.plot(rest, 0.0, "o", color=COLOURS["obstacle"], markersize=4)
    axes.axvline(region.contact_m, color=COLOURS["source"], linewidth=1.0)
    axes.set_xlabel("clearance c (m)")
    axes.set_ylabel("v = w (m/s)")
    axes.set_title(
        f"{model.contact.law.name}: with the lag {region.energy_collisions} of "
        f"{region.energy_starts} starts that the energy certifies touch, and "
        f"{region.collisions} of {region.starts} in the region",
        fontsize=10,
    )
    axes.grid(color="#EEEEEE")
    axes.legend(fontsize=8, loc="upper right")
    return figure
