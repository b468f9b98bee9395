"""A sample of the documented tables, computed anew.

A table that differs says that the code has changed what the pages quote: run the study
again with ``--out``, then ``make results``.
"""

from __future__ import annotations

import pytest

from analysis.energy.certificate_trials import try_certificate
from analysis.energy.energy_certificate import certify_energy
from analysis.report.intervals import estimate_rate
from diagrams import load_scenario
from studies import certificates, laws_before_obstacles, library_runs, linear_stability
from tests.results import assert_same_rows, documented, numbers

pytestmark = pytest.mark.slow


def test_what_the_robot_hears_in_obstacle_free():
    rows = library_runs.following().rows
    assert_same_rows(rows, documented("library_runs", "following"))


@pytest.mark.parametrize("scenario", library_runs.SCENARIOS[:2])
def test_how_scenarios_end(scenario):
    (row,) = (r for r in documented("library_runs", "endings") if r[0] == scenario)
    assert_same_rows(library_runs.endings((scenario,)).rows, [row])


def test_summary_of_the_default_run():
    rows = library_runs.summary_of_the_default_run().rows
    assert_same_rows(rows, documented("library_runs", "summary of the default run"))


@pytest.mark.parametrize(
    "table",
    [
        laws_before_obstacles.velocity_terms,
        laws_before_obstacles.energies,
        laws_before_obstacles.one_sided_damping,
        laws_before_obstacles.stiffness_across,
        laws_before_obstacles.moving_source,
        laws_before_obstacles.obstacle_that_comes,
        laws_before_obstacles.reach_and_ratio,
        laws_before_obstacles.oscillations,
        pytest.param(laws_before_obstacles.gaps, marks=pytest.mark.long),
    ],
)
def test_laws_before_obstacles(table):
    found = table()
    assert_same_rows(found.rows, documented("laws_before_obstacles", found.name))


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("modes", linear_stability.mode_rows),
        ("margins", linear_stability.margin_rows),
        ("contact", linear_stability.contact_rows),
        pytest.param(
            "two ways to the model",
            linear_stability.route_rows,
            marks=pytest.mark.long,
        ),
        pytest.param(
            "equilibria", linear_stability.equilibrium_rows, marks=pytest.mark.long
        ),
    ],
)
def test_linear_stability(name, rows):
    assert_same_rows(rows(), documented("linear_stability", name))


TOP = "robot.top_speed_m_s=0.72"


def test_share_of_certified_starts():
    """To the last digit: the same starts as documented."""
    scenario = load_scenario("two_static_obstacles", [TOP, "law=active"])
    found = try_certificate(certify_energy(scenario), starts=10_000, duration_s=0.02)
    (row,) = (
        row
        for row in documented("certificates", "energy certificate")
        if row[0] == "`active`"
    )
    shares = [found.certified_share, found.energy_share]
    assert shares == pytest.approx(list(map(float, row[6:8])), abs=6e-5)


@pytest.mark.long
def test_certificates():
    """Some ten minutes."""
    rows = certificates.certificate_rows("two_static_obstacles", settings=[TOP])
    for table in certificates.certificate_tables(rows):
        assert_same_rows(table.rows, documented("certificates", table.name))


def test_documented_rates_follow_from_their_counts():
    for _, runs, hits, rate, *places in documented("certificates", "full diagram"):
        low, high = estimate_rate(int(hits), int(runs)).ends
        share = int(hits) / int(runs)
        assert [share, low, high] == pytest.approx(
            list(map(abs, numbers(rate))), abs=6e-4
        )
        assert sum(map(int, places)) == int(hits)
