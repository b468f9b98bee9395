"""Each criterion reads the number that its name says, of data that are made up.

Where several values are read the least, the greatest, the first and the last
differ, in size and in sign.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.energy.energy_certificate import certify_energy
from analysis.stability.certificate_parts import CERTIFIED_STARTS, ENERGY_BALANCE
from analysis.stability.linear_parts import (
    LINEAR_MODELS,
    OPERATING_POINTS,
    STEP,
    count_jams,
)
from analysis.stability.margin_parts import MARGINS
from analysis.stability.report_parts import ROUTE_PARTS, SEARCH_PARTS, SOUND_PARTS
from analysis.stability.robustness_parts import (
    CONTACT_ROBUSTNESS,
    ROBUSTNESS,
    LoopRobustness,
)
from analysis.stability.sampling_parts import (
    BURST_CYCLE,
    CONTACT_MODE,
    DELAY_MARGINS,
    ContactMode,
    SampledLoop,
    contact_growth,
)
from diagrams.scenario.scenario import Scenario

T = 0.025
#: Stands in for any class.
Made: Any = SimpleNamespace
#: (phase deg, gain dB, M_s, alpha) of three cuts: no extreme is first or last.
CUTS = (("a", 50.0, 9.0, 1.5, 0.9), ("b", 20.0, 30.0, 4.0, 0.3),
        ("c", 80.0, 2.0, 1.1, 1.4), ("d", 60.0, 12.0, 2.5, 0.7))  # fmt: skip
#: Names of the cuts that have the extremes.
WORST = {
    "least phase margin": "at the b",
    "least gain margin": "at the c",
    "largest sensitivity peak": "at the b",
    "least disk margin": "at the b",
    "least delay margin": "at the place 1, along",
    "deviation remaining after a burst cycle": "hold `motion`",
}


def cut(name, phase_deg, gain_db, peak, alpha):
    margins = Made(
        name=f"L at the {name}",
        phase_margin_deg=phase_deg,
        gain_margin_db=gain_db,
        sensitivity_peak=peak,
        disk=Made(alpha=alpha),
    )
    return Made(margins=margins)


def place(offset_m, *, stable=True):
    return Made(offset_m=offset_m, stable=stable)


def points(**changed):
    """Made-up operating points; ``changed`` replaces some of their numbers."""
    rest = {
        # Damping ratios 0.6 and 0.28; the fast pair, ratio 0.05, is a motor's.
        "eigenvalues": np.array(
            [-0.6 + 0.8j, -0.6 - 0.8j, -0.28 - 0.96j, -0.28 + 0.96j, -0.2, -5 + 100j]
        ),
        "offset_m": -0.07,
    }
    return Made(at=Made(**(rest | changed)), jams=2)


def sampled(*delays_s):
    margins = (
        Made(delay_s=each, at=f"place {k}", direction="along")
        for k, each in enumerate(delays_s)
    )
    return SampledLoop(T, np.array([]), tuple(margins), None)


def uncertain(growth_per_s):
    cloud, bound = Made(worst_growth_per_s=growth_per_s), "a test"
    return LoopRobustness(cloud, (), bound)


def certified(start, collisions=3):
    return Made(
        certificate=Made(start_certified=start),
        trials=Made(inside_collisions=collisions),
    )


def power(injected, damping):
    return Made(
        passivity=Made(
            largest_injection_n_s_m=injected, attraction_damping_n_s_m=damping
        )
    )


CYCLES = Made(
    today="motion",
    cycles=[Made(hold="world", largest=0.5), Made(hold="motion", largest=0.7),
            Made(hold="robot", largest=1.3)],
)  # fmt: skip

#: Part, made-up data; and by the criterion's name: value, and whether it passes.
EXPECTED: list[tuple[Any, Any, dict[str, tuple[float, str]]]] = [
    (OPERATING_POINTS, points(), {
        "growth at rest": (-0.2, "pass"),
        "damping ratio at rest": (0.28, "fail"),
        "places where the robot can jam": (2.0, "fail"),
        "offset from the follow point at rest": (0.07, "pass"),
    }),
    (MARGINS, Made(implemented=[cut(*values) for values in CUTS]), {
        "least phase margin": (20.0, "fail"),
        "least gain margin": (2.0, "fail"),
        "largest sensitivity peak": (4.0, "fail"),
        "least disk margin": (0.3, "fail"),
    }),
    (DELAY_MARGINS, sampled(0.4, 0.2, math.inf), {
        "least delay margin": (0.2, "pass"),
    }),
    (BURST_CYCLE, CYCLES, {"deviation remaining after a burst cycle": (0.7, "pass")}),
    (CONTACT_MODE, ContactMode(Made(), -0.1, 0.4), {
        "growth where the law is stiffest": (-0.1, "pass"),
        "growth where the law is stiffest, echoes one tick late": (0.4, "fail"),
    }),
    (ROBUSTNESS, uncertain(-0.3), {"growth at rest, worst parameters": (-0.3, "pass")}),
    (CONTACT_ROBUSTNESS, uncertain(0.6), {
        "growth before an obstacle, worst parameters": (0.6, "fail"),
    }),
    (CERTIFIED_STARTS, certified(start=True), {
        "start certified": (1.0, "pass"),
        "collisions from certified starts": (3.0, "fail"),
    }),
    (ENERGY_BALANCE, power(0.6, 1.5), {
        "largest power of the velocity term": (0.4, "pass"),
    }),
    (LINEAR_MODELS, Made(routes=Made(matrix_difference=3e-12)), {
        "difference between two computations of the model": (3e-12, "pass"),
    }),
    (STEP, Made(frequency_error=-0.03, damping_error=0.01), {
        "error of the linear prediction of a small step": (3.0, "fail"),
    }),
]  # fmt: skip


def verdicts(part, data):
    return {each.name: each.judge(data) for each in part.criteria}


@pytest.mark.parametrize(("part", "data", "expected"), EXPECTED)
def test_every_criterion_reads_what_its_name_says(part, data, expected):
    found = verdicts(part, data)
    assert list(found) == list(expected)
    for name, (value, verdict) in expected.items():
        assert found[name].value == pytest.approx(value, rel=1e-9), name
        assert found[name].verdict == verdict, name
        assert found[name].where == WORST.get(name, ""), name


def test_no_criterion_is_left_out_above_and_no_name_occurs_twice():
    judged = {part.key for part in SOUND_PARTS if part.criteria}
    assert judged == {part.key for part, _, _ in EXPECTED}
    for parts in (SOUND_PARTS, ROUTE_PARTS, SEARCH_PARTS):
        names = [each.name for part in parts for each in part.criteria]
        assert len(set(names)) == len(names)


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
    assert contact_growth(scenario, ticks) == pytest.approx(growth, abs=2e-3)
    assert growth > 0.05


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
    assert count_jams(Scenario.model_validate(source), search) == 2


def test_jams_are_sinks_before_and_behind_the_goal():
    settings = {"law": "conventional", "stop": {"goal_margin_m": 1.0}}
    places = [place(0.0), place(3.0), place(3.0, stable=False), place(-2.0),
              place(1.1), place(0.9)]  # fmt: skip
    search = Made(points=places, switching=[])
    assert count_jams(Scenario.model_validate(settings), search) == 2


def test_signs_and_sides_do_not_hide():
    outward = verdicts(OPERATING_POINTS, points(offset_m=0.2))
    assert outward["offset from the follow point at rest"].value == 0.2
    (off,) = verdicts(STEP, Made(frequency_error=0.01, damping_error=-0.05)).values()
    assert off.value == pytest.approx(5.0)
    growing = points(eigenvalues=np.array([-3.0, 0.1 + 2j, 0.1 - 2j, -0.2]))
    found = verdicts(OPERATING_POINTS, growing)
    assert found["growth at rest"].value == 0.1
    ratio = found["damping ratio at rest"].value
    assert ratio == pytest.approx(-0.1 / 2.0025, 1e-4)
    crept = verdicts(OPERATING_POINTS, points(eigenvalues=np.array([-3.0, -0.4 + 0j])))
    assert crept["damping ratio at rest"].value == 1.0
    outside = verdicts(CERTIFIED_STARTS, certified(start=False))["start certified"]
    assert (outside.value, outside.verdict) == (0.0, "fail")
    (endless,) = verdicts(DELAY_MARGINS, sampled(math.inf)).values()
    assert (endless.value, endless.verdict) == (math.inf, "pass")


@pytest.mark.parametrize(
    ("part", "data", "name", "reason"),
    [
        (CERTIFIED_STARTS, certified(start=None), "start certified", "bodies move"),
        (DELAY_MARGINS, sampled(), "least delay margin", "no such number"),
        (MARGINS, Made(implemented=[]), "least disk margin", "no such number"),
        (
            ENERGY_BALANCE,
            power(0.6, 0.0),
            "largest power of the velocity term",
            "no damping",
        ),
        (
            CONTACT_MODE,
            ContactMode(Made(), None, None),
            "growth where the law is stiffest",
            "does not push",
        ),
    ],
)
def test_a_number_that_does_not_exist_has_a_reason(part, data, name, reason):
    verdict = verdicts(part, data)[name]
    assert (verdict.value, verdict.verdict) == (None, "not applicable")
    assert reason in verdict.text


def test_without_a_push_there_is_no_growth_in_contact():
    assert contact_growth(Scenario(law="none"), 0) is None


@pytest.mark.parametrize(("spring_n_m", "certified"), [(0.01, 0.0), (1000.0, 1.0)])
def test_a_start_is_certified_by_the_spring_before_it(two_boxes, spring_n_m, certified):
    """A box stands on the way down to the source; 1000 N/m hold 320 J, 0.01 nothing."""
    stiffness = f"laws.conventional.stiffness_n_m={spring_n_m}"
    damping = "laws.conventional.damping_n_s_m=0.001"
    scenario = two_boxes("conventional", stiffness, damping)
    data = Made(
        certificate=certify_energy(scenario, cell_m=0.02),
        trials=Made(inside_collisions=0),
    )
    assert verdicts(CERTIFIED_STARTS, data)["start certified"].value == certified
