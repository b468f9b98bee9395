"""Micro switches: which half touches, what they do not feel, and faults."""

from __future__ import annotations

import numpy as np
import pytest

from systems.base.robot import RobotParameters
from systems.framework.compiling import njit
from systems.framework.faults import Fault
from systems.ranging.contact_switches import ContactSwitches

BODY = RobotParameters(length_m=0.2, width_m=0.3)


def felt(
    pose,
    followed=(9.0, 9.0, 0.0),
    box=(5.0, 5.0, 0.0),
    compiled=False,
    width=0.1,
    size=(0.2, 0.2, 0.0),
    robot=BODY,
    faults=(),
):
    """Left, right and touched, of a box of 0.2 m and what is followed, 0.1 m long."""
    block = ContactSwitches(
        faults=faults,
        robot=robot,
        bodies=1,
        source_size=(0.1, width),
    )
    work = njit(block.step.step, cache=True) if compiled else block.step.step
    inputs = tuple(map(np.array, (pose, box, size, followed)))
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
        Fault(sensor="contact_switches", number=1, kind="stuck_open"),
        Fault(sensor="contact_switches", number=2, kind="stuck_closed", start_s=0.1),
    )
    assert felt((0, 0, 0), (0.155, 0.0, 0.0), faults=stuck)[:2] == [0, 1]
    late = (
        Fault(sensor="contact_switches", number=2, kind="stuck_closed", start_s=0.2),
    )
    assert felt((0, 0, 0), faults=late)[:2] == [0, 0]


@pytest.mark.parametrize(
    ("y", "switches"),
    [(0.02, [1, 1]), (-0.02, [1, 1]), (0.06, [1, 0]), (-0.06, [0, 1])],
)
def test_a_post_near_the_middle_closes_both(y, switches):
    """The middle is a tenth of the width to either side: 3 cm."""
    assert felt((0, 0, 0), (0.155, y, 0.0), width=0.01)[:2] == switches


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize(("gap", "switches"), [(0.009, [1, 1, 0]), (0.011, [0, 0, -1])])
def test_a_wall_of_ten_meters_is_felt_at_its_end_too(gap, switches, compiled):
    """Across the front, 0.1 m ahead: its middle is 4.8 m to the side."""
    wall = (0.1 + gap + 0.05, 4.8, 0.0)
    assert (
        felt((0, 0, 0), box=wall, size=(0.1, 10.0, 0.0), compiled=compiled) == switches
    )


def test_a_robot_longer_than_two_meters_feels_ahead_of_its_front():
    """A post at its front, which is 1.5 m from the origin of B."""
    long = RobotParameters(length_m=3.0, width_m=0.3)
    assert (
        felt((0, 0, 0), box=(1.559, 0.0, 0.0), size=(0.1, 0.1, 0.0), robot=long)[0] == 1
    )
    assert (
        felt((0, 0, 0), box=(1.561, 0.0, 0.0), size=(0.1, 0.1, 0.0), robot=long)[0] == 0
    )
