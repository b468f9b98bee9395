"""Operating points: equilibria of the closed loop at rest and while following.

At an equilibrium at rest, the robot may have any heading. The linear model of the whole
loop therefore has a pole at z = 1. The models in this module describe only the motion
of the control point P, and do not contain this pole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from analysis.loops.force_field import ForceField
from analysis.loops.ideal_loop import IdealLoop, ideal_loop
from analysis.loops.ideal_scenarios import changed, ideal_scenario
from analysis.loops.linear_models import (
    NEUTRAL,
    LinearModel,
    Mode,
    minimal_model,
    s_plane,
)
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point

Kind = Literal["sink", "saddle", "source"]

#: A force below this counts as zero, N.
NO_FORCE_N = 1e-9
#: If the smallest principal stiffness is below this share of the largest, the
#: equilibrium is part of a continuum.
FLAT = 1e-6
#: Time after which the source drives straight at constant speed, up to rounding errors,
#: s.
_STEADY_S = 20.0


@dataclass(frozen=True)
class OperatingPoint:
    """Equilibrium of the loop: the robot rests, or follows at constant velocity."""

    loop: IdealLoop = field(repr=False)
    p_WP: NDArray[np.float64]
    """(2,) position of the control point P in W at ``time_s``, m."""
    theta_WB: float
    """Heading toward the source, rad. At rest, P is in equilibrium at any heading."""
    v_WS: NDArray[np.float64]
    """(2,) velocity of the source in W, m/s. The robot has the same velocity."""
    force_n: float
    """Force that remains on P at the numerical solution, N."""
    stiffness_n_m: NDArray[np.float64]
    """(2, 2) negative derivative of the force on P by the position of P, N/m."""
    state: NDArray[np.float64] = field(repr=False)
    """(n,) state of the diagram, just before a control update."""
    time_s: float
    """Time of this control update, s."""

    @property
    def moves(self) -> bool:
        """Whether the robot follows a moving source."""
        return bool(np.any(self.v_WS))

    @property
    def p_WS(self) -> NDArray[np.float64]:
        """(2,) position of the source at ``time_s`` in W, m."""
        return np.array(self.loop.scenario.source.path().pose(self.time_s)[:2])

    @property
    def source_distance_m(self) -> float:
        """Distance between P and the source, m."""
        return float(np.linalg.norm(self.p_WS - self.p_WP))

    @property
    def offset_m(self) -> float:
        """Distance between P and the source, minus the follow distance, m."""
        return (
            self.source_distance_m
            - self.loop.scenario.follower.attraction.follow_distance_m
        )

    @property
    def axes(self) -> NDArray[np.float64]:
        """(2, 2) unit vectors in W: row 0 toward the source, row 1 to the left."""
        c, s = math.cos(self.theta_WB), math.sin(self.theta_WB)
        return np.array([[c, s], [-s, c]])

    @property
    def continuum(self) -> bool:
        """Whether P can rest along a curve, for example a circle around the source."""
        sizes = np.abs(np.linalg.eigvals(self.stiffness_n_m))
        return bool(sizes.min() < FLAT * max(sizes.max(), 1.0)) and not self.moves

    @cached_property
    def motion(self) -> LinearModel:
        """Sampled model of the motion of the control point P in the closed loop.

        - Inputs: sudden changes of the velocity of the virtual mass along x and y of
          the world frame W, m/s.
        - Outputs: position of P in W, m. If the operating point moves, also the
          heading, rad.
        """
        A = self.loop.period_derivatives(self.state, self.time_s).A
        return motion_model(self, A, self.loop.tick_s)

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes of the motion without neutral ones (z = 1), the slowest decay first."""
        return tuple(
            mode
            for mode in self.motion.modes
            if mode.z is not None and abs(mode.z - 1.0) > NEUTRAL
        )

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Poles ln(z)/T of the motion, rad/s, without neutral poles (z = 1)."""
        poles = self.motion.poles
        return s_plane(poles[np.abs(poles - 1.0) > NEUTRAL], self.loop.tick_s)

    @property
    def stable(self) -> bool:
        """Whether all motions about the point decay, apart from neutral modes."""
        return bool((self.eigenvalues.real < 0.0).all())

    @property
    def kind(self) -> Kind:
        """Kind of the equilibrium, by the number of growing modes of the motion.

        Without growing modes, the point is a ``sink``. With one, it is a ``saddle``.
        With two or more, it is a ``source``; this term has nothing to do with the
        source of sound. A growing oscillation counts as one mode.
        """
        growing = self.eigenvalues[self.eigenvalues.real >= 0.0]
        directions = int(np.sum(growing.imag >= -1e-9))
        kinds: tuple[Kind, ...] = ("sink", "saddle", "source")
        return kinds[min(directions, 2)]

    @property
    def clearance_m(self) -> float:
        """Distance from P to the nearest body, m."""
        return min(distance for _, distance in self._distances())

    @property
    def nearest_body(self) -> str:
        """Name of the body nearest to P."""
        return min(self._distances(), key=lambda item: item[1])[0]

    def _distances(self) -> list[tuple[str, float]]:
        return [
            (name, body.distance((self.p_WP[0], self.p_WP[1]), self.time_s))
            for name, body in self.loop.scenario.bodies().items()
        ]


def motion_model(
    point: OperatingPoint, A: NDArray[np.float64], period_s: float
) -> LinearModel:
    """Returns a model of the motion of P alone.

    ``A`` (n, n) maps deviations of the state of the whole loop over ``period_s``, s.
    The model has the signals of ``OperatingPoint.motion``, and only the controllable
    and observable states.
    """
    names = point.loop.state_names
    kick = [names.index(f"command.v_WP_{axis}") for axis in "xy"]
    x, y, theta = (names.index(f"plant.{name}") for name in ("x", "y", "theta"))
    epsilon = point.loop.scenario.only.robot.control_point_m
    C = np.zeros((3, len(A)))
    C[0, x] = C[1, y] = C[2, theta] = 1.0
    C[0, theta] = -epsilon * math.sin(point.theta_WB)
    C[1, theta] = epsilon * math.cos(point.theta_WB)
    shown = 3 if point.moves else 2
    whole = LinearModel(
        name="motion of P",
        A=A,
        B=np.eye(len(A))[:, kick],
        C=C[:shown],
        D=np.zeros((shown, 2)),
        state_names=names,
        input_names=("kick_x", "kick_y"),
        output_names=("p_WP_x", "p_WP_y", "theta_WB")[:shown],
        period_s=period_s,
    )
    return minimal_model(whole)


def resting_equilibrium(loop: IdealLoop, p_WP: NDArray[np.float64]) -> OperatingPoint:
    """Returns the equilibrium at rest with P at (2,) ``p_WP`` in W, m.

    The robot heads toward the source. Raises InputError if a force acts at ``p_WP`` or
    a body moves.
    """
    field_ = ForceField(loop)
    force, slope = field_.gradient(p_WP)
    left = float(np.linalg.norm(force))
    if left > NO_FORCE_N:
        raise InputError(
            "p_WP",
            f"at ({p_WP[0]:g}, {p_WP[1]:g}) a force of {left:.3g} N acts, and "
            "there is no equilibrium; use a point from "
            "find_equilibria(scenario).points",
        )
    to_source = field_.p_WS - p_WP
    theta = math.atan2(to_source[1], to_source[0])
    x, y = control_point((*p_WP, theta), -loop.scenario.only.robot.control_point_m)
    state, time_s = loop.settled_state((x, y, theta))
    return OperatingPoint(
        loop=loop,
        p_WP=np.asarray(p_WP, dtype=float),
        theta_WB=theta,
        v_WS=np.zeros(2),
        force_n=left,
        stiffness_n_m=-slope,
        state=state,
        time_s=time_s,
    )


def moving_equilibrium(
    scenario: Scenario, velocity_W: tuple[float, float] | None = None
) -> OperatingPoint:
    """Returns the equilibrium of following a source at constant velocity.

    The source drives straight on at ``velocity_W`` in W, m/s. By default, the speed is
    ``source.speed_m_s`` and the direction is x. The robot follows straight behind the
    source and heads in the direction of motion. Obstacles are left out, because none
    moves with the robot. The calculation assumes exact sensors. Raises InputError if
    the source is at rest, or not slower than the top speed of the robot, or if the
    forces balance at no distance.
    """
    vx, vy = velocity_W or (scenario.source.speed_m_s, 0.0)
    speed, top = math.hypot(vx, vy), scenario.only.robot.top_speed_m_s
    if not 0.0 < speed < top:
        raise InputError(
            "velocity_W",
            f"a source at {speed:g} m/s cannot be followed steadily; give "
            f"a speed above 0 and below robot.top_speed_m_s = {top:g} m/s",
        )
    loop = ideal_loop(_steady_scenario(scenario, vx, vy))
    attraction = loop.scenario.follower.attraction
    heading = np.array([vx, vy]) / speed
    theta = math.atan2(vy, vx)
    epsilon = loop.scenario.only.robot.control_point_m

    p_WS = np.array(loop.scenario.source.path().pose(_STEADY_S)[:2])

    def settled(distance: float) -> tuple[NDArray[np.float64], float]:
        place = p_WS - (distance + epsilon) * heading
        pose = (place[0], place[1], theta)
        return loop.settled_state(pose, (vx, vy), _STEADY_S)

    def pull(distance: float) -> float:
        """Acceleration from the law toward the source at a distance in m, m/s^2."""
        state, time_s = settled(distance)
        read = [("controller", "acceleration_W")]
        return float(loop.period_derivatives(state, time_s, outputs=read).y @ heading)

    guess = attraction.follow_distance_m
    if attraction.stiffness_n_m > 0.0:
        guess += attraction.damping_n_s_m * speed / attraction.stiffness_n_m
    try:
        found = root_scalar(pull, x0=guess, x1=guess + 0.05, xtol=1e-14)
    except (ArithmeticError, InputError):
        found = None
    if found is None or not found.converged or abs(pull(found.root)) > 1e-9:
        raise InputError(
            "velocity_W",
            f"no distance behind a source at {speed:g} m/s balances the "
            "forces; lower repulsion, or raise attraction.stiffness_n_m",
        )
    state, time_s = settled(found.root)
    return _moving_point(loop, state, time_s, (vx, vy), theta)


def _steady_scenario(scenario: Scenario, vx: float, vy: float) -> Scenario:
    """Ideal scenario without obstacles, with a source that drives 900 m straight on."""
    speed = math.hypot(vx, vy)
    source = {
        "waypoints_m": [[0.0, 0.0], [900.0 * vx / speed, 900.0 * vy / speed]],
        "speed_m_s": speed,
        "start_time_s": 0.0,
        "at_end": "stop",
    }
    start = {"position_m": [-5.0 * vx, -5.0 * vy - 5.0], "heading_deg": 0.0}
    return changed(
        ideal_scenario(scenario), {"obstacles": [], "source": source, "start": start}
    )


def _moving_point(
    loop: IdealLoop,
    state: NDArray[np.float64],
    time_s: float,
    velocity: tuple[float, float],
    theta: float,
) -> OperatingPoint:
    read = [("controller", "acceleration_W")]
    found = loop.period_derivatives(state, time_s, outputs=read)
    pose = state[loop.indices("plant")[:3]]
    p_WP = np.array(
        control_point(pose.tolist(), loop.scenario.only.robot.control_point_m)
    )
    mass = loop.scenario.only.robot.mass_kg
    return OperatingPoint(
        loop=loop,
        p_WP=p_WP,
        theta_WB=theta,
        v_WS=np.array(velocity),
        force_n=float(np.linalg.norm(found.y)) * mass,
        stiffness_n_m=-ForceField(loop, time_s).gradient(p_WP)[1],
        state=state,
        time_s=time_s,
    )
