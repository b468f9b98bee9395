"""The guarded law: it plans through what is known, and looks before it moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.base.robot import RobotParameters, body_radius
from systems.framework.block import OBJECT, Block, Port, Step
from systems.framework.signals import TICK_S
from systems.laws.guarded import GuardedParameters
from systems.laws.parameters import AttractionParameters
from systems.laws.repulsion import RepulsionParameters
from systems.planning.evasion import EvasionNumbers
from systems.planning.guarded_drive import (
    CARROT_X,
    CARROT_Y,
    GIVING_UP,
    MEMORY,
    MODE,
    SPEED,
    TURN,
    WAY_LEFT,
    DriveNumbers,
    DriveState,
    drive_guarded,
)
from systems.planning.hazards import HazardSensors, make_hazards
from systems.planning.parameters import FollowingParameters
from systems.planning.way import make_way
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.parameters import FreeSpaceParameters


def guarded_step(
    tick: int, state: DriveState, inputs: Any, outputs: Any, numbers: DriveNumbers
) -> None:
    """The twist of one tick."""
    drive_guarded(tick, state, inputs, numbers)
    memory, (twist, plan, gives_up) = state.memory, outputs
    twist[0], twist[1] = memory[0, SPEED], memory[0, TURN]
    plan[0], plan[1] = memory[0, MODE], memory[0, CARROT_X]
    plan[2], plan[3] = memory[0, CARROT_Y], memory[0, WAY_LEFT]
    gives_up[0] = 1.0 if memory[0, MODE] == GIVING_UP else 0.0


class GuardedController(Block):
    """Plans a way to the target through seen and unknown space, and looks ahead.

    Every ``replan_s`` it finds the cheapest way for the disc that holds the body:
    unknown cells cost a little more than those seen free, cells with echoes much more.
    It drives toward the farthest point of the way that it can reach straight at little
    cost, at a speed for the way to go, and weaves, so that narrow cones sweep what lies
    beside it. Before it first moves it looks to both sides. Where the guard stops it,
    it looks past both sides of the cell that blocks; if this cell stays unseen, ways
    avoid it for a time. If nothing changes, it backs off.

    It tracks moving bodies (``systems.planning.hazards``): echoes from floor that was
    seen free are of bodies that have come there. While one may come near, it takes of
    some speeds and headings the one of least cost: the deviation from what is wanted,
    the distance from the bodies, and whether the sensors see them.

    If for ``search_way_s`` every way leads through cells with echoes, and unknown space
    leads nowhere, it stops and reports this (``gives_up``), until there is a way.

    ``plan``: 0 no target, 1 driving, 2 looking, 3 backing off, 4 no way found; the
    point it heads for, and the way to go. It needs the guard: by itself it avoids
    nothing.

    Abstract state: ``DriveState``. Rate and latency: a function of state and present
    inputs, at every tick; no latency.

    Args:
        robot: Its body, and place of P.
        attraction: The follow distance.
        repulsion: ``RepulsionParameters``; uses ``guarded``.
        following: How fast it drives and turns.
        sensors: The range sensors.
        known: Grid of the map.
        tick_s: Period of the controller, s.

    Reference: ours; docs/guard.md.
    """

    inputs = (
        Port("p_WS_estimated", 2, "m"),
        Port("v_WS_estimated", 2, "m/s"),
        Port("target_valid", 1, "0 or 1"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port("guard_report", 4, "number of the action, m, m, m"),
        Port("ranges", "sensors", "m"),
        Port("echo", "sensors", "0 or 1"),
        Port("range_ages", "sensors", "s, since each sensor fired"),
        Port("free_space", OBJECT, "FreeSpace"),
    )
    outputs = (
        Port("twist_B", 2, "m/s, rad/s", ("wanted_speed", "wanted_turn")),
        Port(
            "plan",
            4,
            "number of the mode, m, m, m",
            ("plan_mode", "carrot_x", "carrot_y", "way_left"),
        ),
        Port("gives_up", 1, "0 or 1"),
    )

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        repulsion: RepulsionParameters = RepulsionParameters(),
        following: FollowingParameters = FollowingParameters(),
        sensors: UltrasonicParameters = UltrasonicParameters(),
        known: FreeSpaceParameters = FreeSpaceParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("guarded_controller")
        own = repulsion.guarded
        numbers = DriveNumbers(
            own,
            following,
            attraction.follow_distance_m,
            robot.control_point_m,
            hazard_sensors(sensors, robot, known, own, tick_s),
            EvasionNumbers(
                following.turn_gain,
                following.turn_rate_rad_s,
                (0.5 * robot.length_m, 0.5 * robot.width_m),
                following.cruise_speed_m_s,
                own.risk_gain,
                own.watch_gain,
            ),
            body_radius(robot) + known.place_error_m + own.clearance_m,
            tick_s,
        )
        state = DriveState(
            np.zeros((1, MEMORY)), make_way(known.cells), make_hazards(sensors.count)
        )
        self.declare(
            Step(guarded_step, numbers, state),
            tick_s=tick_s,
            sizes={"sensors": sensors.count},
        )


def hazard_sensors(
    sensors: UltrasonicParameters,
    robot: RobotParameters,
    known: FreeSpaceParameters,
    own: GuardedParameters,
    tick_s: float,
) -> HazardSensors:
    """What the tracks of what moves need to know.

    Args:
        sensors: The range sensors.
        robot: Place of P.
        known: Of the map, for the margin of ranges.
        own: Parameters of the law.
        tick_s: Period of the controller, s.

    Returns:
        Places, directions and errors of the sensors, and the bodies' top speed.
    """
    axes, places, half_angle = sensors.beams
    return HazardSensors(
        np.add(places, [robot.control_point_m, 0.0]),
        np.column_stack([axes, np.full(len(axes), half_angle)]),
        sensors.maximum_range_m,
        known.range_error(sensors),
        sensors.noise_m,
        own.hazard_speed_m_s,
        tick_s,
    )
