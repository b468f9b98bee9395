"""The first page of a stability report."""

from __future__ import annotations

import pytest

from analysis.report.render import formula_svg
from analysis.stability.model_sheet import model_sheet
from diagrams import load_scenario
from systems.laws.catalog import LAWS


def test_parameters_are_the_scenarios() -> None:
    sheet = model_sheet(load_scenario("default", ["attraction.damping_n_s_m=4"]))
    rows = {row.field: row for row in sheet.parameters}
    assert rows["attraction.damping_n_s_m"].value == 4.0
    assert rows["attraction.damping_n_s_m"].changed
    assert not rows["attraction.stiffness_n_m"].changed
    assert "K_r" in rows["attraction.stiffness_n_m"].text
    assert "Han 2019" in rows["robot.mass_kg"].part
    assert "sound.kind" not in rows
    assert all(row.text for row in sheet.parameters)


def test_latency_of_source_and_obstacle() -> None:
    # Half a frame, a tick of computing, half a tick held, 50 ms of motor lag; and
    # 1.5 s of silence in every 2 s make an estimate 1.5^2 / (2 * 2) s old on average.
    sheet = model_sheet(load_scenario())
    assert sheet.latency_s("obstacle") == pytest.approx(0.0125 + 0.05)
    assert sheet.latency_s("source") == pytest.approx(
        0.0125 + 0.025 + 0.0125 + 0.05 + 0.5625
    )
    always = model_sheet(load_scenario("default", ["sound.period_s=0.5"]))
    assert always.latency_s("source") == pytest.approx(0.1)
    ideal = model_sheet(load_scenario("default", ["hearing=ideal"]))
    assert ideal.latency_s("source") == pytest.approx(0.025 + 0.0125 + 0.05 + 0.5625)


def test_a_goal_point_makes_no_sound() -> None:
    sheet = model_sheet(load_scenario({"goal_m": [3.0, 1.0], "law": "active"}))
    assert sheet.paths == ("goal", "obstacle")
    assert sheet.latency_s("goal") == pytest.approx(0.025 + 0.0125 + 0.05)
    assert not any(row.field.startswith("sound.") for row in sheet.parameters)
    limits = {limit.quantity: limit.value for limit in sheet.envelope}
    assert limits["speed of the goal"] == 0.0


def test_fingerprint_is_of_everything_in_the_scenario() -> None:
    first, same, other = (
        model_sheet(load_scenario("default", [f"seed={seed}"])).scenario_sha256
        for seed in (1, 1, 2)
    )
    assert first == same != other


@pytest.mark.parametrize("law", LAWS)
def test_every_law_has_its_equations(law: str) -> None:
    scenarios = {
        "follower": "default",
        "router": "unknown_block",
        "odor_searcher": "odor_search",
        "sound_searcher": "sound_search",
    }
    sheet = model_sheet(load_scenario(scenarios[LAWS[law].robot], [f"law={law}"]))
    assert sheet.law_equations
    for k, formula in enumerate((*sheet.motion, *sheet.law_equations)):
        assert "<svg" in formula_svg(formula.tex, f"e{k}", formula.text)
