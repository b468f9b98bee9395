"""The figures of docs/certificates.md are those of the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from analysis.certificate_table import LAWS
from analysis.certificate_trials import try_certificate
from analysis.disturbance_bounds import source_bound
from analysis.energy_certificate import certify_energy
from analysis.point_mass import point_mass
from analysis.velocity_terms import velocity_term_analysis
from diagrams import load_scenario

PAGE = (Path(__file__).parents[2] / "docs/certificates.md").read_text("utf-8")


def rows(heading: str) -> list[list[str]]:
    """Cells of the table whose first row begins so."""
    table = PAGE.partition(f"{heading}")[2].partition("\n\n")[0]
    lines = table.splitlines()[2:]
    return [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in lines]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_shares_and_counts_of_the_energy_certificate(law):
    """Shares over tens of thousands of starts; a fresh, smaller sample of runs."""
    found = {row[0]: row for row in rows("| law | velocity term | certified starts")}
    _, term, inside, collisions, *_, share, by_energy, safe, ratio = found[law]
    assert int(inside) >= 10_000
    assert int(collisions) == 0
    scenario = load_scenario("two_static_obstacles", [f"law={law}", "seed=7"])
    trials = try_certificate(certify_energy(scenario), starts=100)
    assert trials.certificate.term == term
    assert trials.inside_collisions == 0
    assert trials.certified_share == pytest.approx(float(share), abs=0.015)
    assert trials.energy_share == pytest.approx(float(by_energy), abs=0.015)
    assert float(share) / float(safe) == pytest.approx(float(ratio), abs=2e-4)


def test_a_start_outside_of_each_set_collides():
    for row in rows("| law | velocity term | certified starts"):
        assert int(row[5]) > 0


def test_regions_are_proved_and_hold():
    found = rows("| law | proved |")
    assert [row[0] for row in found] == list(LAWS)
    for row in found:
        assert row[1] == "yes"
        assert int(row[3]) >= 10_000
        assert int(row[4]) == 0


def test_bounds_of_a_moving_source():
    model = point_mass(load_scenario("two_static_obstacles", ["law=conventional"]))
    for speed, bound, peak, simulated, steady in rows("| speed | proved: stretch"):
        found = source_bound(model, float(speed.split()[0]))
        quoted = [float(cell.split()[0]) for cell in (bound, peak, simulated, steady)]
        values = [found.bound_m, found.linear_peak_m, found.simulated_m, found.steady_m]
        assert values == pytest.approx(quoted, abs=6e-4)


def test_one_sided_dampings():
    names = {"conventional": "conventional", "active 2019": "active"}
    names["active 2017"] = "active2017"
    for law, term, approaching, receding, ratios, amplitude in rows(
        "| law | term | approaching"
    ):
        scenario = load_scenario("two_static_obstacles", [f"law={names[law]}"])
        variant = velocity_term_analysis(scenario).variants[term]
        quoted = [float(re.findall(r"[\d.]+", c)[0]) for c in (approaching, receding)]
        sides = (variant.approaching, variant.receding)
        assert [s.damping_n_s_m for s in sides] == pytest.approx(quoted, abs=6e-3)
        quoted = [float(x) for x in ratios.split(",")]
        assert [s.damping_ratio for s in sides] == pytest.approx(quoted, abs=6e-4)
        assert variant.amplitude_ratio == pytest.approx(float(amplitude), abs=6e-4)
