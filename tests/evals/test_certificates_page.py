"""The figures of docs/certificates.md are those of the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from analysis.stability.certificate_table import LAWS
from analysis.stability.certificate_trials import try_certificate
from analysis.stability.contact_oscillation import contact_oscillation
from analysis.stability.disturbance_bounds import source_bound
from analysis.stability.energy_certificate import certify_energy
from analysis.stability.point_mass import point_mass
from analysis.stability.radial_law import radial_law
from analysis.stability.trap_stiffness import trap_stiffness
from analysis.stability.velocity_terms import velocity_term_analysis
from diagrams import load_scenario

#: Laws by the names that the page gives them.
NAMES = dict(zip(("conventional", "active 2019", "active 2017"), LAWS, strict=True))
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
    for law, term, approaching, receding, ratios, amplitude in rows(
        "| law | term | approaching"
    ):
        scenario = load_scenario("two_static_obstacles", [f"law={NAMES[law]}"])
        variant = velocity_term_analysis(scenario).variants[term]
        quoted = [float(re.findall(r"[\d.]+", c)[0]) for c in (approaching, receding)]
        sides = (variant.approaching, variant.receding)
        assert [s.damping_n_s_m for s in sides] == pytest.approx(quoted, abs=6e-3)
        quoted = [float(x) for x in ratios.split(",")]
        assert [s.damping_ratio for s in sides] == pytest.approx(quoted, abs=6e-4)
        assert variant.amplitude_ratio == pytest.approx(float(amplitude), abs=6e-4)


def test_stiffness_across_the_line():
    for law, *quoted in rows("| law | a point, exact"):
        scenario = load_scenario("two_static_obstacles", [f"law={NAMES[law]}"])
        cases = (("exact", "point"), ("exact", "face"), ("cones", "point"))
        found = [trap_stiffness(scenario, *case).across_n_m for case in cases]
        assert found == pytest.approx([float(c.split()[0]) for c in quoted], abs=0.06)


@pytest.mark.slow
def test_oscillations_before_an_obstacle():
    table = rows("| law | term | amplitude | centre")
    assert len(table) == 6
    analyses = {
        law: contact_oscillation(load_scenario("two_static_obstacles", [f"law={name}"]))
        for law, name in NAMES.items()
    }
    for law, term, amplitude, centre, growth, frequency in table:
        found = analyses[law]
        run = found.runs[term]
        A = float(amplitude.split()[0]) / 1e3
        near = int(abs(run.amplitudes_m - A).argmin())
        assert run.amplitudes_m[near] == pytest.approx(A, abs=6e-4)
        predicted = found.predictions[term].at(A)
        simulated = (
            run.centres_m[near],
            run.growth_per_s[near],
            run.frequencies_rad_s.mean(),
        )
        for cell, ours, theirs, digit in zip(
            (centre, growth, frequency), predicted, simulated, (4, 4, 3), strict=True
        ):
            quoted = [float(x.split()[0]) for x in cell.split(",")]
            assert [ours, theirs] == pytest.approx(quoted, abs=2.0 * 10.0**-digit)


def test_how_far_behind_an_obstacle_the_goal_may_lie():
    """The greatest L with K_r (L + c) = f(c, 0) for some c."""
    quoted = re.findall(
        r"([\d.]+) m\s+to go, the active law of 2019 with up to ([\d.]+) m,"
        r" that of 2017 with up to ([\d.]+) m",
        " ".join(PAGE.split()),
    )
    for law, value in zip(LAWS, quoted[0], strict=True):
        scenario = load_scenario("two_static_obstacles", [f"law={law}"])
        tabulated = radial_law(scenario)
        stiffness = scenario.attraction.stiffness_n_m
        most = (tabulated.forces_n / stiffness - tabulated.distances_m).max()
        assert most == pytest.approx(float(value), abs=0.06)
