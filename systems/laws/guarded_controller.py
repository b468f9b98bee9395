"""The controller of the guarded law, which plans routes and evades moving bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.base.robot import RobotParameters, body_radius
from systems.framework.block import OBJECT, Block, Port, Step
from systems.framework.signals import TICK_S
from systems.laws.parameters import AttractionParameters
from systems.planning.drive_state import (
    GIVING_UP,
    DriveNumbers,
    DriveState,
    make_drive_state,
)
from systems.planning.following import CRUISE_SPEED_M_S
from systems.planning.guarded_drive import drive_guarded
from systems.planning.looks import HazardSensors
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.braking import CREEP_M_S
from systems.safety.outline import Outline, is_long
from systems.safety.parameters import GuardParameters
from systems.safety.views import range_errors

#: Distance that routes keep between the body and occupied cells, m.
_CLEARANCE_M = 0.02
#: Share of the top speed at which a fast robot drives. The rest is left for turns.
_CRUISE_SHARE = 0.86
#: Share at which a long body passes: of the largest speed that counts as rest, or, if
#: all obstacles are at rest, of the speed of a small robot.
_CREEP_SHARE = 0.96
#: Width of a passage that a long body passes without lining up if all obstacles are at
#: rest, as a multiple of its width.
_WIDE = 1.5


def guarded_step(
    tick: int, state: DriveState, inputs: Any, outputs: Any, numbers: DriveNumbers
) -> None:
    """Computes the twist, the plan, and the port ``gives_up`` of one tick."""
    drive_guarded(tick, state, inputs, numbers)
    memory, (twist, plan, gives_up) = state.memory, outputs
    twist[0], twist[1] = memory.speed[0], memory.turn[0]
    plan[0], plan[1] = memory.mode[0], memory.carrot[0]
    plan[2], plan[3] = memory.carrot[1], memory.way_left_m[0]
    gives_up[0] = 1.0 if memory.mode[0] == GIVING_UP else 0.0


class GuardedController(Block):
    """Plans a route to the target and commands speed and yaw rate along the route.

    Every 0.5 s, the block computes the cheapest route through free and unknown space.
    The route leaves room for the width of the body if the body is longer than wide, and
    otherwise for the smallest disc around the axle that contains the body at every
    heading. It costs more where this disc does not fit, because the robot cannot turn
    there. An unknown cell of the map costs a little more than a free cell. A cell with
    echoes costs much more.

    The robot drives straight toward a point of the route. This is the farthest point
    for which the straight line costs little more than the route. The speed depends on
    the remaining distance. The robot weaves from side to side, so that its narrow
    sensor cones also see the space beside it.

    Five rules keep the robot from getting stuck:

    - Before the robot first moves, it looks to both sides.
    - If the guard stops the robot, the robot looks past both sides of the cell that
      blocks it. If this cell is still not free, routes avoid it for a time.
    - If the robot still does not get away, or if it cannot turn, it backs off. If it
      cannot back off, it drives ahead for room to turn.
    - If the guard stops the robot near a target at rest, the robot rests there.
    - If every route of the last 20 s crossed cells with echoes, the robot stops. The
      port ``gives_up`` is then 1 until there is a route without such cells.

    A long body lines up with passages that are narrower than its disc, and creeps
    through them (``systems.planning.passing``).

    The block also tracks moving bodies (``systems.planning.hazards``). An echo from
    floor that was free before counts as a moving body. While such a body may come near,
    the block compares several pairs of speed and heading. It chooses the pair with the
    least cost. The cost has three terms: the deviation from the wanted motion, the
    nearness of the bodies, and whether the sensors see the bodies.

    The port ``plan`` has four numbers: the mode, the position (x, y) of the point to
    which the robot drives, m, and the remaining distance, m. The modes are:

    - 0: no target
    - 1: driving
    - 2: looking
    - 3: backing off, or driving ahead for room to turn
    - 4: no route found

    This law needs the guard, because the law alone does not avoid obstacles.

    The abstract state is ``DriveState``. The outputs depend on the state and the
    present inputs. There is no latency.

    Args:
        robot: Size of the body, and position of the control point P ahead of the axle.
        attraction: ``AttractionParameters``. The block uses only the follow distance.
        sensors: Parameters of the range sensors.
        guard: Parameters of the guard and its map.
        tick_s: Control period, s.

    Reference: our own work; docs/guard.md.
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
        sensors: UltrasonicParameters = UltrasonicParameters(),
        guard: GuardParameters = GuardParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("guarded_controller")
        margin = guard.place_error_m + _CLEARANCE_M
        # In a passage, a body that is longer than wide is narrower than its disc. For a
        # wide body, the difference is too small to risk a place where it cannot turn.
        disc, outline = body_radius(robot), Outline.of(robot)
        narrow = 0.5 * robot.width_m if robot.length_m > robot.width_m else disc
        creep = 0.0
        if is_long(outline):
            # Echoes seem to come from up to one cell in front of a wall.
            rest = CREEP_M_S if guard.obstacle_speed_m_s else CRUISE_SPEED_M_S
            creep, narrow = _CREEP_SHARE * rest, narrow - guard.cell_m
        widest = 2.0 * (disc + margin)
        if guard.obstacle_speed_m_s == 0.0:
            widest = min(widest, _WIDE * robot.width_m)
        numbers = DriveNumbers(
            attraction.follow_distance_m,
            robot.control_point_m,
            hazard_sensors(sensors, robot, tick_s),
            (0.5 * robot.length_m, 0.5 * robot.width_m),
            (narrow + margin, disc + margin),
            cruise_speed(robot),
            tick_s,
            creep,
            widest,
        )
        state = make_drive_state(guard.cells_for(disc), sensors.count)
        self.declare(
            Step(guarded_step, numbers, state),
            tick_s=tick_s,
            sizes={"sensors": sensors.count},
        )


def cruise_speed(robot: RobotParameters) -> float:
    """Computes the largest speed that the guarded law wants, m/s."""
    return max(CRUISE_SPEED_M_S, _CRUISE_SHARE * robot.top_speed_m_s)


def hazard_sensors(
    sensors: UltrasonicParameters, robot: RobotParameters, tick_s: float
) -> HazardSensors:
    """Collects the sensor properties that the tracker of moving bodies needs.

    These are the positions, directions, ranges, and errors of the range sensors.
    ``robot`` has the position of the control point P. ``tick_s`` is the control period,
    s.
    """
    axes, places, half_angles = sensors.beams
    return HazardSensors(
        np.add(places, [robot.control_point_m, 0.0]),
        np.column_stack([axes, half_angles]),
        sensors.each("maximum_range_m"),
        range_errors(sensors),
        sensors.each("noise_m"),
        tick_s,
    )
