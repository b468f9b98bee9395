"""The law that looks before it moves: plans through what is known, and is guarded."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters, body_radius
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import read_arrays
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step
from systems.laws.guarded import GuardedParameters
from systems.laws.parameters import AttractionParameters
from systems.planning.evasion import EvasionNumbers
from systems.planning.guarded_drive import (
    AT_TICK,
    CARROT_X,
    CARROT_Y,
    GIVING_UP,
    MEMORY,
    MODE,
    SPEED,
    TURN,
    WAY_LEFT,
    DriveNumbers,
    drive_guarded,
)
from systems.planning.hazards import Hazards, HazardSensors, make_hazards
from systems.planning.parameters import FollowingParameters
from systems.planning.way import Way, make_way
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.free_space import make_free_space
from systems.safety.parameters import FreeSpaceParameters


def guarded_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: DriveNumbers
) -> None:
    """The twist of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: None: all is in ``numbers``.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``DriveNumbers``.
    """
    drive_guarded(tick, inputs, numbers)
    _tell(numbers.memory, outputs)


class GuardedController(LeafSystem):
    """Plans a way to the target through seen and unknown space, and looks ahead.

    .. pydrake_system::

        name: GuardedController
        input_ports:
        - p_WS_estimated [m]
        - v_WS_estimated [m/s]
        - target_valid [0 or 1]
        - pose_WB_estimated [m, m, rad]
        - guard_report [number of what was done, m, m, m]
        - ranges [m]
        - echo [0 or 1]
        - range_ages [s, since each sensor fired]
        - free_space [FreeSpace]
        output_ports:
        - twist_B [m/s, rad/s]
        - plan [number of what it does, m, m, m]
        - gives_up [0 or 1]

    Every ``replan_s`` it seeks the cheapest way for the disc that holds the body:
    unknown cells cost a little more than those seen free, what echoed much more. It
    drives towards the farthest point of the way that is worth driving to straight, at a
    speed for the way to go, and weaves, so that narrow cones sweep what lies beside it.
    Before it first moves it looks to both sides. Where the guard lets it not go on, it
    looks past both sides of the cell that blocks; if that stays unseen, ways keep off
    it for a time. What stays all the same backs off.

    What moves it tracks (``systems.planning.hazards``): echoes from floor that was seen
    free are of bodies that have come there. While one may come near, it takes of some
    speeds and headings the one of least price: off what is wanted, off the bodies,
    and off keeping them in view.

    Where for ``search_way_s`` every way leads through what echoes, and unknown space
    leads nowhere, it stands and says so (``gives_up``), until there is one.

    ``plan``: 0 no target, 1 driving, 2 looking, 3 backing off, 4 no way found; the
    point it heads for, and the way to go. It needs the guard: by itself it keeps off
    nothing.

    Abstract state: the memory of ``systems.planning.guarded_drive`` and the way. Rate
    and latency: a function of state and present inputs, at every tick; no latency.

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

    FACTS = BlockFacts(
        "controller",
        "control",
        columns={
            "twist_B": ("wanted_speed", "wanted_turn"),
            "plan": ("plan_mode", "carrot_x", "carrot_y", "way_left"),
        },
    )

    def __init__(
        self,
        *,
        robot: RobotParameters | None = None,
        attraction: AttractionParameters | None = None,
        repulsion: Any = None,
        following: FollowingParameters | None = None,
        sensors: Any = None,
        known: FreeSpaceParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        robot, known = robot or RobotParameters(), known or FreeSpaceParameters()
        own = GuardedParameters() if repulsion is None else repulsion.guarded
        following = following or FollowingParameters()
        self._tick_s = tick_s
        self.set_name("guarded_controller")
        sensors = sensors or UltrasonicParameters()
        memory = np.zeros((1, MEMORY))
        memory[0, AT_TICK] = -1.0
        self._numbers = DriveNumbers(
            memory,
            make_way(known.cells),
            make_free_space(1, known.cell_m, 1, 2),
            own,
            following,
            (attraction or AttractionParameters()).follow_distance_m,
            robot.control_point_m,
            make_hazards(sensors.count),
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
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size)
            for name, size in (
                ("p_WS_estimated", 2),
                ("v_WS_estimated", 2),
                ("target_valid", 1),
                ("pose_WB_estimated", 3),
                ("guard_report", 4),
                ("ranges", sensors.count),
                ("echo", sensors.count),
                ("range_ages", sensors.count),
            )
        ]
        self._free_space = self.DeclareAbstractInputPort(
            name="free_space", model_value=Value(object())
        )
        self.DeclareAbstractState(Value(_copied(self._numbers)))
        self.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._remember
        )
        ports = *self._inputs, self._free_space
        sources = {port.ticket() for port in ports}
        sources |= {self.time_ticket(), self.xa_ticket()}
        self._decided: Any = declare_cache(self, "decided", self._decide, sources)
        for place, (name, size) in enumerate(
            (("twist_B", 2), ("plan", 4), ("gives_up", 1))
        ):

            def calc(context: Any, output: Any, place: int = place) -> None:
                output.SetFromVector(self._decided.Eval(context)[1][place])

            self.DeclareVectorOutputPort(
                name=name,
                size=size,
                calc=calc,
                prerequisites_of_calc={self._decided.ticket()},
            )

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        memory, way, hazards = _copied(self._numbers)
        space = run.carried["free_space"](0)
        numbers = self._numbers._replace(
            memory=memory, way=way, space=space, hazards=hazards
        )
        return Step(guarded_step, numbers)

    def _decide(self, context: Any) -> tuple[Any, Any]:
        """Memory and way, and the outputs."""
        state: Any = context.get_abstract_state(0).get_value()
        tick = round(context.get_time() / self._tick_s)
        numbers = self._numbers._replace(
            memory=state[0], way=state[1], hazards=state[2]
        )
        outputs = np.zeros(2), np.zeros(4), np.zeros(1)
        # What was decided at this tick is not decided twice.
        if state[0][0, AT_TICK] != tick:
            memory, way, hazards = _copied(numbers)
            numbers = numbers._replace(memory=memory, way=way, hazards=hazards)
            inputs = read_arrays(context, self._inputs)
            space: Any = self._free_space.Eval(context)
            guarded_step(tick, (), inputs, outputs, numbers._replace(space=space))
        else:
            _tell(numbers.memory, outputs)
        return (numbers.memory, numbers.way, numbers.hazards), outputs

    def _remember(self, context: Any, state: Any) -> None:
        known = self._decided.Eval(context)[0]
        state.get_mutable_abstract_state(0).set_value(known)


@register_jitable
def _tell(memory, outputs):  # type: ignore[no-untyped-def]
    """Outputs from the memory."""
    twist, plan, gives_up = outputs
    twist[0], twist[1] = memory[0, SPEED], memory[0, TURN]
    plan[0], plan[1] = memory[0, MODE], memory[0, CARROT_X]
    plan[2], plan[3] = memory[0, CARROT_Y], memory[0, WAY_LEFT]
    gives_up[0] = 1.0 if memory[0, MODE] == GIVING_UP else 0.0


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


def _copied(numbers: DriveNumbers) -> tuple[Any, Way, Hazards]:
    arrays: list[Any] = [np.copy(values) for values in numbers.way]
    return np.copy(numbers.memory), Way(*arrays), numbers.hazards.copy()
