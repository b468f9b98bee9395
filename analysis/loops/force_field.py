"""Force on the control point of a robot at rest, as a function of position.

The force is the output of the simulation's own controller, with exact sensors as its
input. P is the control point ahead of the wheel axle.
"""

from __future__ import annotations

import math
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.loops.autodiff import seed, value_and_gradient
from analysis.loops.ideal_loop import IdealLoop
from analysis.loops.ideal_scenarios import moving_bodies
from systems.framework.elementary import float_of
from systems.framework.input_error import InputError


class ForceField:
    """Force on the control point P of a robot at rest, as a function of position.

    With exact sensors, the force does not depend on the robot's heading, with one
    exception: a source straight behind the robot pulls slightly sideways. The heading
    is therefore 0 or pi, so that the source is never straight behind. The controller
    takes the speed of every obstacle as zero, as in the first control period in which
    an obstacle is visible. Moving bodies are frozen at ``time_s``. Raises InputError if
    a body moves and ``time_s`` is None.
    """

    def __init__(self, loop: IdealLoop, time_s: float | None = None) -> None:
        scenario = loop.scenario
        moving = moving_bodies(scenario)
        if moving and time_s is None:
            raise InputError(
                f"{', '.join(moving)}",
                "moves, and equilibria need bodies at rest; use "
                "frozen_scenario(scenario, time_s), or moving_equilibrium for a "
                "source at constant velocity",
            )
        self.loop = loop
        self._time_s = time_s or 0.0
        self._pose_WS = np.array(scenario.source.path().pose(self._time_s))
        self._contexts: dict[tuple[str, bool], Any] = {}
        self._attraction_share = 1.0

    def with_attraction(self, share: float) -> ForceField:
        """Returns the field with an attraction that is ``share`` times as stiff."""
        other = copy(self)
        other._attraction_share = share
        return other

    @property
    def p_WS(self) -> NDArray[np.float64]:
        """(2,) position of the source in W, m."""
        return self._pose_WS[:2]

    def force(self, p_WP: ArrayLike) -> NDArray[np.float64]:
        """(2,) sum of attraction and repulsion at ``p_WP`` in W, N."""
        forces = self._forces(np.asarray(p_WP, dtype=float), twin=False)
        return np.asarray(self._attraction_share * forces[:2] + forces[2:], dtype=float)

    def gradient(
        self, p_WP: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns the force (2,), N, and its derivative by position (2, 2), N/m."""
        forces = self._forces(seed(p_WP), twin=True)
        return value_and_gradient(self._attraction_share * forces[:2] + forces[2:], 2)

    def damping(self, p_WP: ArrayLike) -> float:
        """Damping -dF_x/dv_x at ``p_WP`` for P at rest, N s/m.

        F_x is the force on P along x in W, and v_x the velocity of P along x.
        """
        self._forces(np.asarray(p_WP, dtype=float), twin=True)
        block, context = self._controller(twin=True)
        port = block.GetInputPort("v_WP")
        port.FixValue(context, seed([0.0, 0.0]))
        forces = block.GetOutputPort("forces_W").Eval(context)
        port.FixValue(context, np.zeros(2))
        _, slope = value_and_gradient(forces[:2] + forces[2:], 2)
        return -float(slope[0, 0])

    @cached_property
    def reach_m(self) -> float:
        """Largest distance at which the sensor sees a body, m."""
        return self.loop.scenario.follower.ultrasonic.maximum_range_m

    def law(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the (n,) push of one body at rest, N, at (n,) distances, m.

        The push is positive away from the body. It is 0 beyond ``reach_m``.
        """
        block, context = self._controller(twin=False)
        self._see(block, context, np.zeros(3), [1.0, 0.0, 0.0])
        port = block.GetInputPort("collision_vectors_B")
        read = block.GetOutputPort("forces_W")
        forces = np.zeros(len(distances))
        for k, c in enumerate(distances):
            if c <= self.reach_m:
                port.FixValue(context, [c, 0.0, 0.0, 0.0, 0.0, 0.0])
                forces[k] = -read.Eval(context)[2]
        return forces

    def _controller(self, *, twin: bool) -> tuple[Any, Any]:
        block, made = self.loop.block("controller", twin=twin), ("controller", twin)
        if made not in self._contexts:
            context = self._contexts[made] = block.CreateDefaultContext()
            for name, value in (
                ("p_WS_estimated", self.p_WS),
                ("target_valid", [1.0]),
                ("v_WP", [0.0, 0.0]),
            ):
                block.GetInputPort(name).FixValue(context, np.asarray(value))
        return block, self._contexts[made]

    def _sensor(self, *, twin: bool) -> tuple[Any, Any]:
        block, made = self.loop.block("collision", twin=twin), ("collision", twin)
        if made not in self._contexts:
            context = self._contexts[made] = block.CreateDefaultContext()
            block.GetInputPort("pose_WS").FixValue(context, self._pose_WS)
            obstacles = self.loop.block("obstacles")
            bodies = obstacles.CreateDefaultContext()
            bodies.SetTime(self._time_s)
            for name in ("poses_WO", "sizes"):
                value = obstacles.GetOutputPort(name).Eval(bodies)
                block.GetInputPort(name).FixValue(context, value)
        return block, self._contexts[made]

    def _see(self, block: Any, context: Any, pose: Any, features: Any) -> None:
        block.GetInputPort("pose_WB_estimated").FixValue(context, pose)
        block.GetInputPort("features").FixValue(context, np.asarray(features))

    def _forces(self, p_WP: Any, *, twin: bool) -> Any:
        # A source straight behind the robot would pull sideways.
        theta = 0.0 if float_of(p_WP[0]) <= self.p_WS[0] else math.pi
        offset = self.loop.scenario.only.robot.control_point_m
        x, y = p_WP[0] - offset * math.cos(theta), p_WP[1] - offset * math.sin(theta)
        pose = np.array([x, y, theta + 0.0 * p_WP[0]])
        sensor, own = self._sensor(twin=twin)
        sensor.GetInputPort("pose_WB").FixValue(own, pose)
        features = sensor.GetOutputPort("features").Eval(own)
        vectors = sensor.GetOutputPort("collision_vectors_B").Eval(own)
        block, context = self._controller(twin=twin)
        self._see(block, context, pose, features)
        block.GetInputPort("collision_vectors_B").FixValue(context, vectors)
        return block.GetOutputPort("forces_W").Eval(context).copy()
