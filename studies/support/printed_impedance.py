"""The conventional law of routes with printed signs, or with damping that fades.

A scenario names these blocks in its field ``blocks``; they replace its controller.
"""

from __future__ import annotations

from diagrams import Scenario
from systems.framework.block import Block, Step
from systems.laws.trajectory.trajectory_impedance_controller import (
    TrajectoryImpedanceController,
    TrajectoryNumbers,
    trajectory_impedance_step,
    trajectory_numbers,
)


class _ChangedImpedance(Block):
    """``TrajectoryImpedanceController`` with other constants of its step."""

    part = "controller"
    inputs = TrajectoryImpedanceController.inputs
    outputs = TrajectoryImpedanceController.outputs

    def __init__(self, *, scenario: Scenario) -> None:
        super().__init__()
        own = scenario.router.gains
        numbers = trajectory_numbers(own, scenario.only.robot, scenario.tick_s)
        step = Step(trajectory_impedance_step, self.changed(numbers))
        self.declare(step, tick_s=scenario.tick_s)

    def changed(self, numbers: TrajectoryNumbers) -> TrajectoryNumbers:
        """Replaces some constants."""
        raise NotImplementedError


class SignsOfEq10(_ChangedImpedance):
    """The spring is at rest on the obstacle, and so pulls toward it."""

    def changed(self, numbers: TrajectoryNumbers) -> TrajectoryNumbers:
        """Moves the point of no force from S to the obstacle."""
        return numbers._replace(contacts=numbers.contacts._replace(rest_m=0.0))


class SignsOfEq4And5(_ChangedImpedance):
    """The dampers of contacts drive the motion."""

    def changed(self, numbers: TrajectoryNumbers) -> TrajectoryNumbers:
        """Turns the sign of D_e."""
        return numbers._replace(contact_damping=-numbers.contact_damping)


class FadingDamping(_ChangedImpedance):
    """The damping of a contact grows from 0 at the edge of the zone."""

    def changed(self, numbers: TrajectoryNumbers) -> TrajectoryNumbers:
        """Lets the damping fade."""
        return numbers._replace(contacts=numbers.contacts._replace(fades=True))
