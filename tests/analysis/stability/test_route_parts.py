"""The report of a robot on a route: parts, verdicts, document and page."""

from __future__ import annotations

import pytest

from analysis.loops.ideal_scenarios import ideal_scenario, require_ideal
from analysis.stability.choice import chosen_laws, chosen_robot
from analysis.stability.law_analysis import analyze_law
from analysis.stability.report_files import (
    stability_document,
    stability_page,
    stability_text,
)
from analysis.stability.report_parts import parts_for
from diagrams import load_scenario
from systems.framework.input_error import InputError


@pytest.fixture(scope="module")
def analyses():
    scenario = load_scenario("unknown_block")
    laws = ["trajectory_adaptive", "trajectory_filtered"]
    scenarios = chosen_laws(scenario, laws)
    work = parts_for(scenarios)
    return [analyze_law(each, work) for each in scenarios]


def test_every_part_is_there_or_says_why_not(analyses):
    for analysis in analyses:
        assert analysis.failures == {}
    adaptive, filtered = analyses
    assert list(adaptive.found) == [section.key for section in adaptive.sections]
    (missing,) = (each for each in filtered.sections if each.key not in filtered.found)
    assert missing.key == "adaptation"
    assert missing.data["problem"].startswith(
        "law: 'trajectory_filtered' has no adaptation"
    )
    assert "Burst cycle" in adaptive.found["left_out"]


def test_the_document_has_the_numbers(analyses):
    document = stability_document(analyses[:1])
    assert [row["at"]["name"] for row in document["frozen_gains"]] == [
        "on the route",
        "at rest",
        "in a zone",
    ]
    bounds = document["gain_bounds"]
    assert bounds["stable_today_n_m"][1] == pytest.approx(60.9, abs=0.05)
    assert bounds["mass"]["motor_lag_s"] == 0.05
    assert document["adaptation"]["lyapunov"]["falls"]
    assert document["adaptation"]["bounded"] is False
    chains = document["robot_chain"]["chains"]
    assert [chain["grows"] for chain in chains] == [True, False, True, False]
    assert chains[0]["tail"]["8"] == pytest.approx(chains[0]["peak"] ** 7)
    assert document["model"]["motion"][0]["title"] == "Virtual mass at P"
    fields = [row["field"] for row in document["model"]["parameters"]]
    assert "route.speed_m_s" in fields
    assert "attraction.stiffness_n_m" not in fields


def test_verdicts_are_of_the_numbers(analyses):
    adaptive, filtered = (
        {verdict.name: verdict for verdict in analysis.verdicts}
        for analysis in analyses
    )
    assert adaptive["growth with frozen gains"].verdict == "pass"
    assert adaptive["contacts that may act at once"].value == 18.0
    for found in (adaptive, filtered):
        worst = found["growth with frozen gains, worst parameters"]
        assert worst.verdict == "pass"
        assert found["growth with frozen gains"].value < worst.value < worst.proven < 0
    assert (
        adaptive["stiffness learned in a jam, share of the stable limit"].verdict
        == "fail"
    )
    assert (
        filtered["stiffness learned in a jam, share of the stable limit"].verdict
        == "not applicable"
    )
    # K + K_e = 11 N/m, D = 4 at the zone's edge.
    assert filtered[
        "sum of all springs, share of the stable limit"
    ].value == pytest.approx(11.0 / 60.89, rel=1e-3)
    assert filtered["least damping ratio"].value == pytest.approx(0.528, abs=0.002)
    for name in (
        "chain amplification with feed-forward",
        "chain amplification in contact",
    ):
        assert filtered[name].verdict == "fail"
    assert adaptive["chain amplification without feed-forward"].verdict == "pass"


def test_page_shows_a_law_and_the_table_both(analyses):
    page = stability_page(analyses[1:])
    # Poles, uncertain poles, their sensitivities, bounds, responses and gaps; none of
    # adaptation.
    assert page.count("<figure>") == 6
    for text in (
        "Robots that follow one another",
        "Parts that do not apply",
        "From target to wheels: 62.5 ms",
        "Not computed: law: 'trajectory_filtered' has no adaptation",
    ):
        assert text in page
    blocks = stability_text(analyses).split("\n\n")
    rows = next(block for block in blocks if "threshold" in block).splitlines()
    assert rows[0].split() == [
        "threshold",
        "trajectory_adaptive",
        "trajectory_filtered",
    ]
    assert len({len(row) for row in rows}) == 1
    failures = blocks[blocks.index("Why criteria fail:") + 1]
    assert "- chain amplification in contact: " in failures


def test_laws_of_a_route_are_chosen_on_a_route():
    scenario = load_scenario("unknown_block")
    assert [each.only.law for each in chosen_laws(scenario, ["all"])] == [
        "trajectory_conventional",
        "trajectory_adaptive",
        "trajectory_filtered",
    ]
    with pytest.raises(InputError, match="law: is 'active', but the robot has a route"):
        chosen_laws(scenario, ["active"])


@pytest.mark.parametrize(
    ("scenario", "name", "start", "others"),
    [
        ("robots_2", None, (-3.0, 0.0), "without second; the option robot selects"),
        ("robots_2", "second", (0.0, -3.0), "without first"),
        ("unknown_block", None, (0.0, 0.0), ""),
    ],
)
def test_one_robot_of_several_is_taken_alone(scenario, name, start, others):
    alone, note = chosen_robot(load_scenario(scenario), name)
    assert alone.only.start.position_m == start
    assert list(alone.robots) == [name or next(iter(load_scenario(scenario).robots))]
    assert others in note
    assert bool(note) == bool(others)


@pytest.mark.parametrize("name", ["leader", "second"])
def test_one_of_a_convoy_has_a_linear_model_of_its_own(name):
    """A leader alone has nobody who hears its loudspeaker."""
    alone, _ = chosen_robot(load_scenario("convoy"), name)
    (chosen,) = chosen_laws(alone, [])
    ideal = ideal_scenario(chosen)
    require_ideal(ideal)
    assert len(ideal.robots) == 1
    assert ideal.only.loudspeaker is None


def test_a_robot_that_is_none_is_refused():
    with pytest.raises(InputError, match="robot: 'third' is not a robot of"):
        chosen_robot(load_scenario("robots_2"), "third")
