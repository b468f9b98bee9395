"""Margins of the heading loop, by hand and by simulation."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from analysis.loops.heading_loop import heading_loop_margins
from systems.base.robot import RobotParameters
from systems.heading.heading_controller import HeadingController
from systems.heading.parameters import MotorDriverParameters

ROBOT = RobotParameters(preset="song2011_hearing")
PARTS = MotorDriverParameters(), ROBOT, 0.1


def test_without_sampling_they_are_those_of_the_formula():
    """|L| = 1 and the phase there, of 1.146 (2 + 0.5/s + 0.01 s) / (s (0.1 s + 1))."""
    turn = math.degrees(2 * 0.01 * 0.2 / 0.2)

    def loop(w):
        s = 1j * w
        return turn * (2 + 0.5 / s + 0.01 * s) / (s * (0.1 * s + 1))

    low, high = 0.1, 20.0
    for _ in range(80):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if abs(loop(middle)) > 1 else (low, middle)
    phase = 180.0 + math.degrees(cmath.phase(loop(low)))
    found = heading_loop_margins(*PARTS)
    assert found.continuous_phase_margin_deg == pytest.approx(phase, abs=0.01)
    assert found.crossover_rad_s == pytest.approx(low, rel=0.01)


def test_they_are_as_the_design_expects():
    """2.2 rad/s, 72 deg, 0.56 s; half a tick of hold takes 1.6 deg off."""
    found = heading_loop_margins(*PARTS)
    assert found.crossover_rad_s == pytest.approx(2.2, abs=0.1)
    assert found.continuous_phase_margin_deg == pytest.approx(72.0, abs=0.6)
    held = math.degrees(found.crossover_rad_s * 0.0125)
    assert found.phase_lost_deg == pytest.approx(held, abs=0.1)
    assert found.delay_margin_s == pytest.approx(0.56, abs=0.02)


def test_a_longer_tick_costs_a_degree():
    """10 ms as printed against 25 ms: half a tick of delay at the crossover."""
    short, long = (heading_loop_margins(*PARTS, tick_s=t) for t in (0.010, 0.025))
    lost = short.phase_margin_deg - long.phase_margin_deg
    assert lost == pytest.approx(math.degrees(2.25 * 0.0075), abs=0.4)


def turns(late_ticks):
    """(n,) deviation of the blocks' own loop, with heading that comes late, deg."""
    step = HeadingController().step
    state, theta, rate, seen = np.array(step.state), 0.0, 0.0, []
    gammas = []
    for tick in range(1600):
        seen.append(theta)
        now = seen[max(0, tick - late_ticks)]
        duty = [[0.0, 0.0]]
        step.step(tick, state, [[1.0], [now], [1.0]], duty, step.numbers)
        wanted = math.degrees((duty[0][0] - duty[0][1]) * 0.2 / 0.2)
        keep = math.exp(-0.025 / 0.1)
        theta += wanted * 0.025 + (rate - wanted) * 0.1 * (1.0 - keep)
        rate = wanted + (rate - wanted) * keep
        gammas.append(1.0 - theta)
    return np.array(gammas)


def test_the_loop_itself_is_stable_up_to_its_delay_margin():
    ticks = heading_loop_margins(*PARTS).delay_margin_ticks
    below, above = (turns(round(share * ticks)) for share in (0.85, 1.15))
    assert np.abs(below[-200:]).max() < 0.5 * np.abs(below[200:400]).max()
    assert np.abs(above[-200:]).max() > np.abs(above[200:400]).max()
