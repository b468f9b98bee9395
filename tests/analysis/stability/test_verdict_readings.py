"""Each verdict reads the number that its name says, of parts that are made up.

Where several values are read the least, the greatest, the first and the last
differ, in size and in sign.
"""

from __future__ import annotations

import math
from types import SimpleNamespace as Made

import numpy as np
import pytest

from analysis.stability.law_analysis import Study
from analysis.stability.verdict_parts import verdict_parts
from analysis.stability.verdict_readings import (
    read_contact,
    read_cycle,
    read_damping,
    read_decay,
    read_delay,
    read_jams,
    read_offset,
    read_passive,
    read_prediction,
    read_routes,
    read_start,
    read_trials,
    read_worst_case,
    read_worst_margin,
)
from diagrams.scenario.scenario import Scenario

T = 0.025
#: (phase deg, gain dB, M_s, alpha) of three cuts: no extreme is first or last.
CUTS = ((50.0, 9.0, 1.5, 0.9), (20.0, 30.0, 4.0, 0.3), (80.0, 2.0, 1.1, 1.4),
        (60.0, 12.0, 2.5, 0.7))  # fmt: skip


def cut(phase_deg, gain_db, peak, alpha):
    margins = Made(
        phase_margin_deg=phase_deg,
        gain_margin_db=gain_db,
        sensitivity_peak=peak,
        disk=Made(alpha=alpha),
    )
    return Made(margins=margins)


def place(offset_m, *, stable=True):
    return Made(offset_m=offset_m, stable=stable)


def study(**parts):
    """A study whose parts are made up; ``parts`` in the place of some of them."""
    rest = Made(
        # Damping ratios 0.6 and 0.28; the fast pair, ratio 0.05, is a motor's.
        eigenvalues=np.array(
            [-0.6 + 0.8j, -0.6 - 0.8j, -0.28 - 0.96j, -0.28 + 0.96j, -0.2, -5 + 100j]
        ),
        offset_m=-0.07,
    )
    found = {
        "equilibria": Made(
            at=rest,
            search=Made(
                points=[place(0.0), place(3.0), place(3.0, stable=False), place(-2.0),
                        place(1.1), place(0.9)],
                switching=[],
            ),
        ),
        "margins": Made(implemented=[cut(*values) for values in CUTS]),
        "sampled": Made(margins=[Made(delay_s=s) for s in (0.4, 0.2, math.inf)]),
        "burst_cycle": Made(
            today="motion",
            cycles=[Made(hold="world", largest=0.5), Made(hold="motion", largest=0.7),
                    Made(hold="robot", largest=1.3)],
        ),
        "robustness": Made(cloud=Made(worst_growth_per_s=-0.3)),
        "contact_robustness": Made(cloud=Made(worst_growth_per_s=0.6)),
        "certificates": (
            Made(
                certificate=Made(start_certified=True),
                trials=Made(inside_collisions=3),
            ),
        ),
        "energy_balance": Made(
            passivity=Made(largest_injection_n_s_m=0.6, attraction_damping_n_s_m=1.5)
        ),
        "linear_models": Made(routes=Made(matrix_difference=3e-12)),
        "step": Made(frequency_error=-0.03, damping_error=0.01),
    }  # fmt: skip
    settings = {"law": "conventional", "stop": {"goal_margin_m": 1.0}}
    return Study(Scenario.model_validate(settings), {**found, **parts})


@pytest.mark.parametrize(
    ("name", "least", "largest"),
    [
        ("phase_margin_deg", 20.0, 80.0),
        ("gain_margin_db", 2.0, 30.0),
        ("sensitivity_peak", 1.1, 4.0),
        ("disk", 0.3, 1.4),
    ],
)
def test_worst_margin_is_the_least_or_the_largest_as_asked(name, least, largest):
    assert read_worst_margin(name, largest=False)(study()) == least
    assert read_worst_margin(name, largest=True)(study()) == largest


#: By the criterion's name: value, and whether it passes.
EXPECTED = {
    "growth at rest": (-0.2, "pass"),
    "damping ratio at rest": (0.28, "fail"),
    "least phase margin": (20.0, "fail"),
    "least gain margin": (2.0, "fail"),
    "largest sensitivity peak": (4.0, "fail"),
    "least disk margin": (0.3, "fail"),
    "least delay margin": (0.2, "pass"),
    "deviation remaining after a burst cycle": (0.7, "pass"),
    "growth at rest, worst parameters": (-0.3, "pass"),
    "growth before an obstacle, worst parameters": (0.6, "fail"),
    "places where the robot can jam": (2.0, "fail"),
    "offset from the follow point at rest": (0.07, "pass"),
    "start certified": (1.0, "pass"),
    "largest power of the velocity term": (0.4, "pass"),
    "collisions from certified starts": (3.0, "fail"),
    "error of the linear prediction of a small step": (3.0, "fail"),
    "difference between two computations of the model": (3e-12, "pass"),
}


def verdicts(made):
    (part,) = verdict_parts()
    return {verdict.name: verdict for verdict in part.compute(made)}


def test_every_verdict_reads_what_its_name_says():
    """The contact's two are of the scenario itself: see the independent evals."""
    found = verdicts(study())
    contact = {
        "growth where the law is stiffest",
        "growth where the law is stiffest, echoes one tick late",
    }
    assert set(found) == set(EXPECTED) | contact
    for name, (value, verdict) in EXPECTED.items():
        assert found[name].value == pytest.approx(value, rel=1e-9), name
        assert found[name].verdict == verdict, name


@pytest.mark.parametrize("ticks", [0, 1])
def test_contact_growth_is_a_root_of_the_difference_equation(ticks):
    """K_r + K_0 on a position some ticks old, D_r, 50 ms of lag: an own polynomial."""
    scenario = Scenario.model_validate(
        {"law": "conventional", "laws": {"conventional": {"stiffness_n_m": 30.0}}}
    )
    mass, lag = scenario.only.robot.mass_kg, scenario.only.plant.motor_lag_s
    attraction = scenario.follower.attraction
    decay = math.exp(-T / lag)
    k = T / mass * (30.0 + attraction.stiffness_n_m)
    d = T / mass * attraction.damping_n_s_m
    # v+ = v + T a; w+ = decay w + (1 - decay) v+; p+ = p + b w + (T - b) v+.
    z, b = np.poly1d([1.0, 0.0]), lag * (1.0 - decay)
    moved = (T - b) * (z - decay) + b * (1.0 - decay)
    motion = (z - 1.0 + d) * (z - 1.0) * (z - decay) * z**ticks + k * moved * z
    growth = math.log(np.abs(motion.roots).max()) / T
    assert read_contact(Study(scenario), ticks) == pytest.approx(growth, abs=2e-3)
    assert growth > 0.05
    named = verdicts(Study(scenario, study().found))
    name = (
        "growth where the law is stiffest",
        "growth where the law is stiffest, echoes one tick late",
    )
    assert named[name[ticks]].value == read_contact(Study(scenario), ticks)


@pytest.mark.parametrize(
    ("waypoints", "margin"), [([[2, 0]], 0.3), ([[2, 0], [5, 0]], 0.8)]
)
def test_a_jam_is_a_sink_where_a_run_is_not_in_its_goal(waypoints, margin):
    """0.3 m beyond the follow distance of a resting source, 0.8 m of a moving one."""
    places = [place(sign * margin + step) for sign in (-1, 1) for step in (-0.01, 0.01)]
    source = {"source": {"waypoints_m": waypoints}}
    switching = [
        Made(p_WP=[2.0 + 1.2 + margin + step, 0.0], attractive=attractive)
        for step, attractive in ((-0.01, True), (0.01, True), (0.01, False))
    ]
    search = Made(points=places, switching=switching)
    found = {"equilibria": Made(search=search)}
    assert read_jams(Study(Scenario.model_validate(source), found)) == 2.0


def test_signs_and_sides_do_not_hide():
    assert read_offset(study(equilibria=Made(at=Made(offset_m=0.2)))) == 0.2
    off = {"frequency_error": 0.01, "damping_error": -0.05}
    assert read_prediction(study(step=Made(**off))) == pytest.approx(5.0)
    growing = Made(at=Made(eigenvalues=np.array([-3.0, 0.1 + 2j, 0.1 - 2j, -0.2])))
    assert read_decay(study(equilibria=growing)) == 0.1
    assert read_damping(study(equilibria=growing)) == pytest.approx(-0.1 / 2.0025, 1e-4)
    crept = Made(at=Made(eigenvalues=np.array([-3.0, -0.4])))
    assert read_damping(study(equilibria=crept)) == 1.0
    moves = (Made(certificate=Made(start_certified=None)),)
    assert "bodies move" in str(read_start(study(certificates=moves)))
    no = (Made(certificate=Made(start_certified=False)),)
    assert read_start(study(certificates=no)) == 0.0
    one = Made(margins=[Made(delay_s=math.inf)])
    assert read_delay(study(sampled=one)) == math.inf


@pytest.mark.parametrize(
    ("read", "part", "reason"),
    [
        (read_worst_margin("disk", largest=False), "margins", "margins were not"),
        (read_delay, "sampled", "delay margins were not"),
        (read_cycle, "burst_cycle", "the burst cycle was not"),
        (read_worst_case("robustness"), "robustness", "it was not computed"),
        (read_passive, "energy_balance", "no radial force"),
        (read_start, "certificates", "no energy certificate"),
        (read_trials, "certificates", "no certificate"),
        (read_routes, "linear_models", "no linear models"),
        (read_prediction, "step", "no step"),
    ],
)
def test_what_is_not_there_is_said(read, part, reason):
    found = read(study(**{part: None}))
    assert isinstance(found, str)
    assert reason in found


def test_empty_parts_and_no_damping_have_no_number():
    assert isinstance(read_delay(study(sampled=Made(margins=[]))), str)
    empty = Made(implemented=[])
    assert isinstance(
        read_worst_margin("disk", largest=False)(study(margins=empty)), str
    )
    undamped = Made(largest_injection_n_s_m=0.6, attraction_damping_n_s_m=0.0)
    assert isinstance(read_passive(study(energy_balance=Made(passivity=undamped))), str)
    assert isinstance(read_contact(Study(Scenario(law="none")), 0), str)
    with pytest.raises(ValueError, match="equilibria: has no result"):
        read_jams(study(equilibria=None))
