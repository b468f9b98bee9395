"""Micro switches: which half touches, what they do not feel, and faults."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from systems.base.robot import RobotParameters
from systems.ranging.contact_switches import ContactSwitches
from systems.ranging.parameters import ContactFaultParameters, ContactParameters

BODY = RobotParameters(length_m=0.2, width_m=0.3)


def felt(
    pose,
    followed=(9.0, 9.0, 0.0),
    box=(5.0, 5.0, 0.0),
    compiled=False,
    width=0.1,
    **own,
):
    """Left, right and touched, of a box of 0.2 m and what is followed, 0.1 m long."""
    block = ContactSwitches(
        parameters=ContactParameters(**own),
        robot=BODY,
        bodies=1,
        source_size=(0.1, width),
    )
    work = njit(block.step.step) if compiled else block.step.step
    inputs = tuple(map(np.array, (pose, box, (0.2, 0.2), followed)))
    outputs = np.zeros(2), np.zeros(1)
    work(4, np.zeros(0), inputs, outputs, block.step.numbers)
    return [*outputs[0].tolist(), outputs[1][0]]


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize(
    ("y", "switches"), [(0.0, [1, 1]), (0.18, [1, 0]), (-0.18, [0, 1])]
)
def test_the_side_that_touches_closes(y, switches, compiled):
    """The front is at 0.1; a source with its edge there closes what it covers."""
    assert felt((0, 0, 0), (0.155, y, 0.0), compiled=compiled) == [*switches, 1]


def test_it_feels_as_far_as_its_reach_and_no_farther():
    assert felt((0, 0, 0), (0.1595, 0.0, 0.0))[:2] == [1, 1]
    assert felt((0, 0, 0), (0.1605, 0.0, 0.0))[:2] == [0, 0]


def test_flank_and_rear_feel_nothing():
    assert felt((0, 0, 0), (0.0, 0.205, 0.0))[:2] == [0, 0]
    assert felt((0, 0, np.pi), (0.155, 0.0, 0.0))[:2] == [0, 0]


def test_a_wall_closes_them_as_the_source_does():
    assert felt((0, 0, 0), box=(0.205, 0.0, 0.0)) == [1, 1, 0]


def test_switches_that_are_stuck_say_so_always():
    stuck = (
        ContactFaultParameters(switch=1, kind="stuck_open"),
        ContactFaultParameters(switch=2, kind="stuck_closed", start_s=0.1),
    )
    assert felt((0, 0, 0), (0.155, 0.0, 0.0), faults=stuck)[:2] == [0, 1]
    late = (ContactFaultParameters(switch=2, kind="stuck_closed", start_s=0.2),)
    assert felt((0, 0, 0), faults=late)[:2] == [0, 0]


@pytest.mark.parametrize(
    ("y", "switches"),
    [(0.02, [1, 1]), (-0.02, [1, 1]), (0.06, [1, 0]), (-0.06, [0, 1])],
)
def test_a_post_near_the_middle_closes_both(y, switches):
    """The middle is a tenth of the width to either side: 3 cm."""
    assert felt((0, 0, 0), (0.155, y, 0.0), width=0.01)[:2] == switches
