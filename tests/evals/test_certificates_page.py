"""The figures of docs/certificates.md are those of the code."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from analysis.certificates.certificate_trials import try_certificate
from analysis.certificates.diagram_trials import try_diagram
from analysis.certificates.disturbance_bounds import disturbance_bounds, source_bound
from analysis.certificates.energy_certificate import certify_energy
from analysis.certificates.sos_region import sos_region
from analysis.laws.radial_law import radial_law
from analysis.models.point_mass import point_mass
from analysis.nonlinear.contact_oscillation import contact_oscillation
from analysis.nonlinear.equilibrium_maps import gap_map
from analysis.nonlinear.phase_portrait import phase_portrait
from analysis.nonlinear.trap_stiffness import trap_stiffness
from analysis.nonlinear.velocity_passivity import (
    energy_balance,
    velocity_term_passivity,
)
from analysis.nonlinear.velocity_terms import velocity_term_analysis
from analysis.reporting.intervals import wilson_interval
from diagrams import load_scenario
from docs.tables.certificates import LAWS

#: Laws by the names that the page gives them.
NAMES = dict(zip(("conventional", "active 2019", "active 2017"), LAWS, strict=True))
#: Of the robot, not of experiment 2: the page says so.
TOP = "robot.top_speed_m_s=0.72"
PAGE = (Path(__file__).parents[2] / "docs/certificates.md").read_text("utf-8")


def rows(heading: str) -> list[list[str]]:
    """Cells of the table whose first row begins so."""
    table = PAGE.partition(f"{heading}")[2].partition("\n\n")[0]
    lines = table.splitlines()[2:]
    return [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in lines]


@pytest.fixture(scope="module")
def trials():
    """The page's own starts of each law, all but not simulated."""
    found = {}
    for law in LAWS:
        scenario = load_scenario("two_static_obstacles", [TOP, f"law={law}"])
        certificate = certify_energy(scenario)
        found[law] = try_certificate(certificate, starts=10_000, duration_s=0.02)
    return found


def beyond_chance(count: int, runs: int, rate: float) -> bool:
    """Whether so many of so many runs lie four deviations off their rate."""
    return abs(count - runs * rate) > 4.0 * math.sqrt(runs * rate * (1.0 - rate))


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_shares_and_counts_of_the_energy_certificate(trials, law):
    """Shares to the last digit; of the runs a smaller sample."""
    found = {row[0]: row for row in rows("| law | velocity term | certified starts")}
    _, term, tried, collisions, others, hits, share, by_energy, safe, ratio = found[law]
    ours = trials[law]
    assert (len(ours.inside.starts), len(ours.outside.starts)) == (
        int(tried),
        int(others),
    )
    assert ours.certificate.term == term
    assert f"{ours.certified_share:.4f}" == share
    assert f"{ours.energy_share:.4f}" == by_energy
    rate = int(hits) / int(others)
    assert 1.0 - (1.0 - float(share)) * rate == pytest.approx(float(safe), abs=6e-5)
    assert float(share) / float(safe) == pytest.approx(float(ratio), abs=2e-4)

    def touched(starts):
        run = ours.certificate.model.run(
            starts, contact_m=ours.certificate.contact_m, duration_s=20.0, term=term
        )
        return int(run.collided.sum())

    assert touched(ours.inside.starts[:300]) == int(collisions) == 0
    outside = touched(ours.outside.starts[:1000])
    assert outside > 0
    assert not beyond_chance(outside, 1000, rate)


@pytest.mark.slow
def test_certified_starts_in_the_full_diagram(trials):
    """Rates by their counts; the first runs of the page's, with full audio."""
    table = rows("| law | runs from certified starts")
    assert [row[0] for row in table] == list(LAWS)
    for law, runs, hits, rate, *places in table:
        quoted = [float(x) for x in re.findall(r"[\d.]+", rate)]
        low, high = wilson_interval(int(hits), int(runs))
        assert [int(hits) / int(runs), low, high] == pytest.approx(quoted, abs=6e-4)
        assert sum(map(int, places)) == int(hits)
        found = try_diagram(trials[law].certificate, starts=10, hearing="audio")
        assert not beyond_chance(found.collisions, 10, int(hits) / int(runs))
        assert found.mechanisms.count("ahead") == int(places[0]) == 0
    kinds = np.sum([[int(n) for n in row[4:]] for row in table], axis=0)
    text = " ".join(PAGE.split())
    (beside,) = re.findall(r"All (\d+) collisions are \*beside\*", text)
    assert kinds.tolist() == [0, int(beside), 0]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_regions_are_proved_and_hold(law):
    """The region anew; of its starts a tenth."""
    found = {row[0]: row for row in rows("| law | proved |")}
    _, proved, extents, starts, touch, by_energy, with_lag = found[law]
    scenario = load_scenario("two_static_obstacles", [TOP, f"law={law}"])
    region = sos_region(scenario, starts=int(starts) // 10)
    assert proved == ("yes" if region.certified else "no")
    quoted = [float(x) for x in re.findall(r"[\d.]+", extents)]
    assert region.extent()[:2] == pytest.approx(quoted, abs=2e-3)
    assert region.collisions == int(touch) == 0
    share = int(by_energy) / int(starts)
    assert not beyond_chance(region.energy_starts, region.starts, min(share, 0.9999))
    rate = int(with_lag) / int(by_energy)
    assert not beyond_chance(region.energy_collisions, region.energy_starts, rate)


def test_what_velocity_terms_give_at_most():
    """The table, and the energies of a run that begins with 10 J."""
    for law, printed, closing, damping in rows("| law | gives at most, printed"):
        scenario = load_scenario(
            "two_static_obstacles", [TOP, f"law={NAMES.get(law, law)}"]
        )
        for term, cell in (("printed", printed), ("closing", closing)):
            found = velocity_term_passivity(scenario, term)
            quoted = float(re.findall(r"[\d.]+", cell)[-1])
            assert found.largest_injection_n_s_m == pytest.approx(quoted, abs=6e-3)
            assert found.attraction_damping_n_s_m == float(damping)
    text = " ".join(PAGE.split())
    (energies,) = re.findall(
        r"put back ([\d.]+), ([\d.]+) and ([\d.]+) J of energy into runs that begin "
        r"with ([\d.]+), ([\d.]+) and ([\d.]+) J, and took ([\d.]+), ([\d.]+) and "
        r"([\d.]+) J",
        text,
    )
    for k, law in enumerate(LAWS):
        given, first, taken = map(float, energies[k::3])
        balance = energy_balance(
            load_scenario("two_static_obstacles", [TOP, f"law={law}"])
        )
        work = balance.to_dict()
        assert work["injected_j"] == pytest.approx(given, abs=6e-3)
        assert work["absorbed_j"] == pytest.approx(taken, abs=6e-3)
        assert balance.energies_j[0] == pytest.approx(first, abs=0.06)


def test_bounds_of_a_moving_obstacle_and_of_corners():
    text = " ".join(PAGE.split())
    quoted = re.findall(
        r"0.3 m/s: ([\d.]+) s \(conventional\), ([\d.]+) s \(active 2019\), "
        r"([\d.]+) s \(active 2017\), against ([\d.]+) s",
        text,
    )
    *times, crossing = map(float, quoted[0])
    for law, time in zip(LAWS, times, strict=True):
        scenario = load_scenario("two_static_obstacles", [TOP, f"law={law}"])
        bounds = disturbance_bounds(scenario, runs=2).obstacle
        found = {bound.speed_m_s: bound for bound in bounds}
        assert found[0.3].certified_s == pytest.approx(time, abs=0.06)
        whole = [bound.speed_m_s for bound in bounds if bound.certified]
        assert whole == ([0.1] if law == "conventional" else [])
        if law == "conventional":
            assert found[0.3].encounter_s == pytest.approx(crossing, abs=0.06)
    (corner,) = re.findall(r"corners of 0.3 m at 0.3 m/s it proves ([\d.]+) m", text)
    model = point_mass(load_scenario("two_static_obstacles", [TOP, "law=conventional"]))
    bound = source_bound(model, 0.3, 0.3**2 / 0.3, simulate=False).bound_m
    assert bound == pytest.approx(float(corner), abs=0.06)


def test_gaps_that_hold():
    """At the ends of each stretch of gaps, and next to them."""
    for law, exact, together, _ in rows("| | exact nearest point | sum of all"):
        name = NAMES[law.removeprefix("two boxes, ").partition(":")[0]]
        scenario = load_scenario("two_static_obstacles", [TOP, f"law={name}"])
        for sensing, cell in (("exact nearest", exact), ("exact sum", together)):
            ends = [float(x) for x in re.findall(r"[\d.]+", cell)]
            if ends:
                gaps = sorted({ends[0], ends[-1], round(ends[-1] + 0.1, 1)})
                found = gap_map(scenario, gaps, sensing=sensing).jams
                assert found == tuple(sorted(set(ends))), (law, sensing)


def test_starts_within_1_5_m_of_the_phase_planes():
    (quoted,) = re.findall(
        r"certified / safe is ([\d.]+) \(conventional\), ([\d.]+) \(active 2019\) and "
        r"([\d.]+) \(active 2017\)",
        " ".join(PAGE.split()),
    )
    for law, value in zip(LAWS, quoted, strict=True):
        scenario = load_scenario("two_static_obstacles", [TOP, f"law={law}"])
        assert phase_portrait(scenario).ratio == pytest.approx(float(value), abs=6e-4)


def test_bounds_of_a_moving_source():
    model = point_mass(load_scenario("two_static_obstacles", [TOP, "law=conventional"]))
    for speed, bound, peak, simulated, steady in rows("| speed | proved: stretch"):
        found = source_bound(model, float(speed.split()[0]))
        quoted = [float(cell.split()[0]) for cell in (bound, peak, simulated, steady)]
        values = [found.bound_m, found.linear_peak_m, found.simulated_m, found.steady_m]
        assert values == pytest.approx(quoted, abs=6e-4)


def test_one_sided_dampings():
    for law, term, approaching, receding, ratios, amplitude in rows(
        "| law | term | approaching"
    ):
        scenario = load_scenario("two_static_obstacles", [TOP, f"law={NAMES[law]}"])
        variant = velocity_term_analysis(scenario).variants[term]
        quoted = [float(re.findall(r"[\d.]+", c)[0]) for c in (approaching, receding)]
        sides = (variant.approaching, variant.receding)
        assert [s.damping_n_s_m for s in sides] == pytest.approx(quoted, abs=6e-3)
        quoted = [float(x) for x in ratios.split(",")]
        assert [s.damping_ratio for s in sides] == pytest.approx(quoted, abs=6e-4)
        assert variant.amplitude_ratio == pytest.approx(float(amplitude), abs=6e-4)


def test_stiffness_across_the_line():
    for law, *quoted in rows("| law | a point, exact"):
        scenario = load_scenario("two_static_obstacles", [TOP, f"law={NAMES[law]}"])
        cases = (("exact", "point"), ("exact", "face"), ("cones", "point"))
        found = [trap_stiffness(scenario, *case).across_n_m for case in cases]
        assert found == pytest.approx([float(c.split()[0]) for c in quoted], abs=0.06)


@pytest.mark.slow
def test_oscillations_before_an_obstacle():
    table = rows("| law | term | amplitude | centre")
    assert len(table) == 6
    analyses = {
        law: contact_oscillation(
            load_scenario("two_static_obstacles", [TOP, f"law={name}"])
        )
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
        scenario = load_scenario("two_static_obstacles", [TOP, f"law={law}"])
        tabulated = radial_law(scenario)
        stiffness = scenario.attraction.stiffness_n_m
        most = (tabulated.forces_n / stiffness - tabulated.distances_m).max()
        assert most == pytest.approx(float(value), abs=0.06)
        if law == "active":
            (fold,) = re.findall(r"gives way meet at \$c\$ = ([\d.]+) m", PAGE)
            place = tabulated.distances_m[
                (tabulated.forces_n / stiffness - tabulated.distances_m).argmax()
            ]
            assert place == pytest.approx(float(fold), abs=6e-4)
