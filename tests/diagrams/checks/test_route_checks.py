"""Gains beyond what sampling permits are told before a run, with the bound."""

from __future__ import annotations

import numpy as np
import pytest

import phonotaxis
from analysis.linear.contact_mode import largest_contact_stiffness
from analysis.trajectory.adaptation_stability import swinging_target
from analysis.trajectory.point_run import PointLoop, run_point
from diagrams import load_scenario

ADAPTIVE = "repulsion.trajectory_adaptive"
FILTERED = "repulsion.trajectory_filtered"


def notes(law, *fields):
    return load_scenario("unknown_block", [f"law=trajectory_{law}", *fields]).notes()


@pytest.mark.parametrize("law", ["conventional", "adaptive", "filtered"])
def test_the_laws_as_they_are_need_no_warning(law):
    assert notes(law) == []


@pytest.mark.parametrize(
    ("law", "fields", "parts"),
    [
        # D T/M = 2, and K at D = 4 with motors of 50 ms.
        ("filtered", [f"{FILTERED}.damping_n_s_m=80"], ["damping_n_s_m is 80", "80,"]),
        ("filtered", [f"{FILTERED}.stiffness_n_m=97"], ["97 N/m", "beyond 96.4"]),
        (
            "filtered",
            [f"{FILTERED}.contact_stiffness_n_m=94"],
            ["contact_stiffness_n_m together, 97 N/m", "beyond 96.4"],
        ),
        # 4 + 7 * 10 < 80 < 4 + 8 * 10.
        (
            "filtered",
            [f"{FILTERED}.contact_damping_n_s_m=10"],
            ["more than 7 contacts"],
        ),
        (
            "adaptive",
            [f"{ADAPTIVE}.adaptation.rate=1e5"],
            ["rate is 100000", "1.6e+03"],
        ),
        # The lag at which K = 3 pulls through K_e S = 1.5 is half a metre.
        (
            "adaptive",
            [
                f"{ADAPTIVE}.adaptation.rate=1e4",
                f"{ADAPTIVE}.contact_stiffness_n_m=1.5",
            ],
            ["6.4e+03", "0.5 m"],
        ),
        (
            "adaptive",
            [
                f"{ADAPTIVE}.adaptation.projected=true",
                f"{ADAPTIVE}.adaptation.stiffness_box_n_m=[0.5, 100]",
            ],
            ["stiffness_box_n_m ends at 100", "damping_box_n_s_m, 3,"],
        ),
    ],
)
def test_a_bound_that_is_passed_is_named(law, fields, parts):
    (note,) = notes(law, *fields)
    assert note.startswith(f"repulsion.trajectory_{law}")
    for part in parts:
        assert part in note


@pytest.mark.parametrize(
    "cure", ["projected=true", "normalisation=0.01", "rule=none", "rate=1500"]
)
def test_what_is_bounded_or_slow_needs_none(cure):
    fields = f"{ADAPTIVE}.adaptation.rate=1e5", f"{ADAPTIVE}.adaptation.{cure}"
    assert notes("adaptive", *fields) == []


def test_the_box_is_held_against_what_its_least_damping_stands():
    """By the plant as Drake linearises it, D = 3."""
    field = f"{ADAPTIVE}.adaptation"
    bound = largest_contact_stiffness(load_scenario("unknown_block"), damping_n_s_m=3.0)
    ends = [
        notes("adaptive", f"{field}.projected=true", f"{field}.stiffness_box_n_m={box}")
        for box in ([0.5, 0.999 * bound], [0.5, 1.001 * bound])
    ]
    assert ends[0] == []
    assert f"from {bound:.3g} on" in ends[1][0]


def test_what_is_warned_of_leaves_all_that_is_stable():
    """At the amplitude that it names: D beyond 2 M/T, and below the bound not."""
    own = load_scenario(
        "unknown_block",
        ["law=trajectory_adaptive", f"{ADAPTIVE}.adaptation.rate=5000"],
    ).repulsion.trajectory_adaptive
    loop = PointLoop(own, own.adaptation, motor_lag_s=0.05)
    targets = swinging_target(1.0, 60.0, 0.025)
    assert np.abs(run_point(loop, targets).gains[:, 1]).max() > 80.0
    slower = loop._replace(
        adaptation=own.adaptation.model_copy(update={"rate": 1500.0})
    )
    assert np.abs(run_point(slower, targets).gains[:, 1]).max() < 80.0


def test_each_robot_is_named():
    field = f"robots.second.{FILTERED}.damping_n_s_m"
    (note,) = load_scenario("robots_2", [f"{field}=90"]).notes()
    assert note.startswith(f"{field} is 90")


def test_the_command_tells_it_before_it_runs(capsys, tmp_path):
    field = f"{FILTERED}.damping_n_s_m"
    words = ["simulate", "unknown_block", "--set", f"{field}=90", "--set"]
    phonotaxis.main([*words, "duration_s=0.1", "--out", str(tmp_path / "out")])
    assert capsys.readouterr().err.startswith(f"phonotaxis: {field} is 90")
