"""Pictures of proofs show what their objects hold."""

from __future__ import annotations

import numpy as np

from studies.proofs.disturbance_bounds import disturbance_bounds
from studies.proofs.plots import plot_disturbance_bounds


def curves(axes):
    """Data of the labeled lines, by label."""
    return {
        line.get_label(): line.get_xydata()
        for line in axes.get_lines()
        if not str(line.get_label()).startswith("_")
    }


def test_disturbance_bounds(two_boxes):
    bounds = disturbance_bounds(two_boxes("conventional"), runs=4)
    source, obstacle = plot_disturbance_bounds(bounds).axes
    assert len(curves(source)["simulated"]) == 6
    certified = [row.certified_s for row in bounds.obstacle]
    np.testing.assert_allclose(curves(obstacle)["certified"][:, 1], certified)
