"""Pictures of certificates show what their objects hold."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.energy.certificate_plots import (
    plot_certificate_trials,
    plot_energy_balance,
    plot_energy_certificate,
)
from analysis.energy.certificate_trials import try_certificate
from analysis.energy.energy_certificate import certify_energy
from analysis.energy.velocity_passivity import energy_balance


def curves(axes):
    """Data of the labeled lines, by label."""
    return {
        line.get_label(): line.get_xydata()
        for line in axes.get_lines()
        if not str(line.get_label()).startswith("_")
    }


@pytest.fixture(scope="module")
def certificate(two_boxes):
    return certify_energy(two_boxes("active"), cell_m=0.05)


def test_map_of_certified_speeds(certificate):
    axes = plot_energy_certificate(certificate).axes[0]
    shown = axes.collections[0].get_array()
    assert shown is not None
    np.testing.assert_allclose(
        np.ma.filled(shown, np.nan).ravel(), certificate.largest_speed().T.ravel()
    )
    assert f"{100 * certificate.rest_share:.1f} %" in axes.get_title()
    assert axes.get_xlabel() == "x of P (m)"


def test_starts_by_outcome(certificate):
    trials = try_certificate(certificate, starts=40, duration_s=10.0)
    axes = plot_certificate_trials(trials).axes[0]
    counts = {label.split(":")[0]: len(data) for label, data in curves(axes).items()}
    assert counts["certified"] == 40
    assert counts["collides"] == trials.outside_collisions
    assert counts["not certified, safe"] == 40 - trials.outside_collisions


def test_energies_of_a_run(two_boxes):
    balance = energy_balance(two_boxes("conventional"), duration_s=5.0)
    found = curves(plot_energy_balance(balance).axes[0])
    np.testing.assert_allclose(found["V"][:, 1], balance.energies_j)
