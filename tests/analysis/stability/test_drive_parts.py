"""The report of a robot with the guarded law."""

from __future__ import annotations

import pytest

from analysis.stability.choice import chosen_laws
from analysis.stability.law_analysis import analyze_law
from analysis.stability.report_files import (
    stability_document,
    stability_page,
    stability_text,
)
from analysis.stability.report_parts import DRIVE_PARTS, parts_for
from diagrams import load_scenario
from systems.framework.input_error import InputError


def test_the_guarded_law_has_a_report_of_its_own():
    (scenario,) = chosen_laws(load_scenario("barn"), [])
    parts = parts_for([scenario])
    assert [part.key for part in parts] == [
        "drive", "drive_robustness", "left_out", "safety"
    ]  # fmt: skip
    # The robustness takes long, and has tests of its own.
    analysis = analyze_law(scenario, [part for part in parts if part != DRIVE_PARTS[1]])
    assert analysis.failures == {}
    document = stability_document([analysis])
    # An integrator with the gain 1.2 1/s: the crossover is 1.2 rad/s, and the delay
    # margin 1.309 s, without the lag of 50 ms and half a tick.
    loop = document["drive"]["distance"]
    assert loop["crossover_rad_s"] == pytest.approx(1.2, rel=0.01)
    lost = 0.05 + 0.5 * scenario.tick_s
    assert loop["delay_margin_s"] == pytest.approx(1.309 - lost, abs=0.005)
    assert "5 of 5" not in stability_text([analysis])
    assert "4 of 4 criteria pass" in stability_text([analysis])
    page = stability_page([analysis])
    assert "Loops on free floor" in page
    assert "The guard promises here" in page


def test_laws_of_other_kinds_are_not_mixed():
    scenario = load_scenario("default")
    with pytest.raises(InputError, match="analyze it alone: --law guarded"):
        chosen_laws(scenario, ["active", "guarded"])
    with pytest.raises(InputError, match=r"use conventional.* or use guarded"):
        chosen_laws(scenario, ["dwa"])
