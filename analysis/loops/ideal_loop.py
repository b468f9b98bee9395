"""The control loop with exact sensors as a map over one control period, differentiable.

The diagram has the same builder, blocks and integrator as the simulation. Only the
sensors differ: hearing and obstacle sensing are exact, and wheel angles are not
rounded. Therefore, every block can be converted to Drake's AutoDiffXd.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, Simulator_

from analysis.loops.autodiff import seed, value_and_gradient
from analysis.loops.diagram_state import (
    Port,
    Runner,
    get_state,
    run_periods,
    set_state,
)
from analysis.loops.diagram_timing import block_timings
from analysis.loops.diagram_twin import autodiff_twin, by_differences
from analysis.loops.ideal_scenarios import require_ideal
from diagrams import build_sound_follower
from diagrams.building.laws import why_law_by_differences
from diagrams.building.robot import parts_of
from diagrams.running.simulation import simulator_config
from diagrams.scenario.own_versions import loaded_digests
from diagrams.scenario.scenario import Scenario
from systems import DiffDrivePlant, WheelCommand, WheelOdometry
from systems.framework.input_error import InputError

#: Number of control periods after which the tracker has settled. With exact hearing,
#: its slowest mode shrinks to 0.27 of its size in each period.
SETTLING_TICKS = 40
#: States that the analysis uses, by part. A block that replaces the part has them, too.
_NAMED = {
    "plant": DiffDrivePlant.states,
    "command": WheelCommand.states,
    "odometry": WheelOdometry.states,
}


@dataclass(frozen=True)
class PeriodDerivatives:
    """Linearization of one control period: x+ = f(x, u) and y = g(x, u).

    x is the state before the control update that begins the period, and x+ the state
    one period later. The inputs u are held over the period. The outputs y are those
    before the control update that begins the period.
    """

    next_state: NDArray[np.float64]
    """(n,) state x+ one period later."""
    A: NDArray[np.float64]
    """(n, n) derivative of the next state by the state."""
    B: NDArray[np.float64]
    """(n, m) derivative of the next state by the inputs."""
    y: NDArray[np.float64]
    """(p,) outputs before the control update."""
    C: NDArray[np.float64]
    """(p, n) derivative of the outputs by the state."""
    D: NDArray[np.float64]
    """(p, m) derivative of the outputs by the inputs."""


class IdealLoop:
    """Closed control loop with exact sensors, as a float and an AutoDiffXd diagram.

    The AutoDiffXd diagram is called the twin. It is made once, by conversion of the
    float diagram. The state vector has first the continuous states of the diagram, then
    its discrete groups. ``state_names`` names the elements. A period begins just before
    one control update and ends just before the next. The scenario must have exact
    sensors, as the result of ``ideal_scenario`` has. Raises InputError if the scenario
    cannot be differentiated.
    """

    def __init__(self, scenario: Scenario) -> None:
        require_ideal(scenario)
        self.scenario = scenario
        self.follower = build_sound_follower(scenario)
        self._require_forces()
        self._require_one_period()
        self.twin: Any = autodiff_twin(self.follower.diagram)
        twins = map(
            self.twin.GetSubsystemByName,
            (*self.follower.sources, *self.follower.robots),
        )
        self._twin_blocks = {
            part: block
            for twin in twins
            for part, block in parts_of(twin).blocks.items()
        }
        self.state_names: tuple[str, ...] = self._names()
        self.sampled_twins: dict[str, Any] = {}
        """Continuous blocks as AutoDiffXd blocks in discrete time, by role. Module
        ``analysis.loops.block_models`` fills this cache."""
        self._simulators: dict[Any, Any] = {}

    @property
    def tick_s(self) -> float:
        """Control period, s."""
        return self.scenario.tick_s

    def _require_forces(self) -> None:
        """Raises InputError if the law does not push a virtual mass."""
        block = self.follower.blocks["controller"]
        for port in ("acceleration_W", "forces_W"):
            if not block.HasOutputPort(port):
                raise InputError(
                    "law",
                    f"{self.scenario.only.law!r} has no output port {port}, and "
                    "linear models need a law that pushes a virtual mass; use "
                    "such a law, or simulate",
                )

    def _require_one_period(self) -> None:
        """Raises InputError if a block does not update once per control period."""
        for path, timing in block_timings(self.follower.diagram):
            if timing is None or abs(timing.period_s - self.tick_s) > 1e-9:
                period = f"every {timing.period_s:g} s" if timing else "irregularly"
                raise InputError(
                    "blocks",
                    f"{path.rpartition('/')[2]} updates {period}, and the report needs "
                    f"an update per control period of {self.tick_s:g} s; use this "
                    "period, or linearize the diagram over the common period: "
                    "phonotaxis.linearize(diagrams.build_sound_follower(scenario)"
                    ".diagram, context)",
                )

    def differences(self) -> tuple[str, ...]:
        """Returns what Drake cannot differentiate, a sentence each.

        The derivatives of these laws and blocks are differences.
        """
        found = [
            f"The block {role} does not convert to AutoDiffXd. Its derivatives are "
            "differences."
            for role, block in self._twin_blocks.items()
            if by_differences(block)
        ]
        if why := why_law_by_differences(self.scenario):
            found.append(
                f"Drake cannot differentiate the law {self.scenario.only.law} ({why}). "
                "Its derivatives are differences."
            )
        return tuple(found)

    def block(self, role: str, *, twin: bool = False) -> Any:
        """Returns the block of a role, such as "controller".

        The block is that of the float diagram, or with ``twin`` that of the AutoDiffXd
        diagram.
        """
        return self._twin_blocks[role] if twin else self.follower.blocks[role]

    def _names(self) -> tuple[str, ...]:
        """Names ``part.element`` of all states, with numbers for unnamed elements."""
        context = self.follower.diagram.CreateDefaultContext()
        continuous: list[str] = []
        discrete: list[str] = []
        for part, block in self.follower.only.blocks.items():
            own = block.GetMyContextFromRoot(context)
            size, names = own.num_total_states(), getattr(block, "states", ())
            if len(names) != size:
                names = tuple(f"state_{k}" for k in range(size))
            for name in _NAMED.get(part, ()):
                if name not in names:
                    raise InputError(
                        "blocks",
                        f"{block.get_name()} has no state {name}, and the report needs "
                        f"the states of the block that it replaces; name them in its "
                        f"class: states = {_NAMED[part]}",
                    )
            kind = continuous if own.num_continuous_states() else discrete
            kind.extend(f"{part}.{name}" for name in names)
        return (*continuous, *discrete)

    def indices(self, role: str) -> list[int]:
        """Returns the indices of a block's states in the state vector."""
        prefix = f"{role}."
        return [k for k, n in enumerate(self.state_names) if n.startswith(prefix)]

    def context(self, state: NDArray[np.float64], time_s: float = 0.0) -> Any:
        """Returns the root context of the float diagram at a state (n,).

        The context is valid until the next call of a method of this loop.
        """
        simulator = self._simulator(frozenset(), twin=False)
        context = simulator.get_mutable_context()
        context.SetTime(time_s)
        set_state(context, state)
        return context

    def period_map(
        self,
        state: NDArray[np.float64],
        time_s: float = 0.0,
        *,
        fixed: Mapping[Port, Sequence[float]] | None = None,
        periods: int = 1,
    ) -> NDArray[np.float64]:
        """Returns the state (n,) after a number of whole periods.

        ``state`` and the result are states just before a control update. ``time_s`` is
        the time of ``state`` and a multiple of the control period. The input ports
        ``fixed`` are cut off from their sources and have the given constant values.
        """
        fixed = fixed or {}
        simulator = self._simulator(frozenset(fixed), twin=False)
        context = simulator.get_mutable_context()
        for port, value in fixed.items():
            self.fix(context, port, np.asarray(value, dtype=float))
        run_periods(simulator, state, time_s, periods, self.tick_s)
        return get_state(context)

    def period_derivatives(
        self,
        state: NDArray[np.float64],
        time_s: float = 0.0,
        *,
        inputs: Mapping[tuple[Port, ...], Sequence[float]] | None = None,
        outputs: Sequence[Port] = (),
    ) -> PeriodDerivatives:
        """Differentiates one period with AutoDiff through the whole diagram.

        ``state`` (n,) is the state just before the control update at ``time_s``, which
        is a multiple of the control period. Each key of ``inputs`` is a tuple of input
        ports. These ports are cut off from their sources, and all of them receive the
        same value. The values of all keys, in their order, are the inputs u, which are
        held over the period. The output ports ``outputs`` are read before the control
        update.
        """
        inputs = inputs or {}
        ports = frozenset(port for group in inputs for port in group)
        simulator = self._simulator(ports, twin=True)
        context = simulator.get_mutable_context()
        values = [np.asarray(value, dtype=float) for value in inputs.values()]
        seeded = seed(np.concatenate([state, *values]))
        start = count = len(state)
        for group, value in zip(inputs, values, strict=True):
            for port in group:
                part = seeded[start : start + len(value)]
                self.fix(context, port, part, twin=True)
            start += len(value)
        context.SetTime(time_s)
        set_state(context, seeded[:count])
        read = [self._read(context, port) for port in outputs]
        y, by_all = value_and_gradient(
            np.concatenate(read) if read else np.empty(0), start
        )
        run_periods(simulator, seeded[:count], time_s, 1, self.tick_s)
        after, jacobian = value_and_gradient(get_state(context), start)
        return PeriodDerivatives(
            next_state=after,
            A=jacobian[:, :count],
            B=jacobian[:, count:],
            y=y,
            C=by_all[:, :count],
            D=by_all[:, count:],
        )

    def runner(
        self, state: NDArray[np.float64], time_s: float, fixed: Sequence[Port] = ()
    ) -> Runner:
        """Prepares a run of the float diagram that can be stopped at any time.

        The run begins at ``state`` (n,), just before the control update at ``time_s``,
        which is a multiple of the control period. The input ports ``fixed`` are cut off
        from their sources. ``Runner.fix`` sets their values.
        """
        simulator = self._simulator(frozenset(fixed), twin=False)
        return Runner(simulator, self.fix, state, time_s, self.tick_s)

    def settled_state(
        self,
        pose_WB: Sequence[float],
        v_WP: tuple[float, float] = (0.0, 0.0),
        begin_s: float = 0.0,
    ) -> tuple[NDArray[np.float64], float]:
        """Returns the state (n,) after a long steady motion, and its time, s.

        The motion lasts SETTLING_TICKS control periods. It begins at ``begin_s`` with
        the robot at ``pose_WB``, m and rad. The acceleration from the law is replaced
        by zero, so that the robot keeps the velocity ``v_WP``, m/s, which is zero or
        along its heading. The source follows its path, which should be steady from
        ``begin_s`` on. In the returned state, just before a control update, the tracker
        and the memory of the controller have settled.
        """
        context = self.follower.diagram.CreateDefaultContext()
        state = get_state(context)
        speed = math.hypot(*v_WP)
        wheel = speed / self.scenario.only.robot.wheel_radius_m
        still = [*pose_WB, 0.0, 0.0]
        state[self.indices("plant")] = [*still, wheel, wheel]
        state[self.indices("odometry")] = still
        state[self.indices("command")] = [*v_WP, wheel, wheel]
        tracker = self.indices("tracker")
        state[tracker[:9]] = [*pose_WB] * 3
        no_force = {("command", "acceleration_W"): (0.0, 0.0)}
        state = self.period_map(state, begin_s, fixed=no_force, periods=SETTLING_TICKS)
        time_s = begin_s + SETTLING_TICKS * self.tick_s
        # Without this, rounding errors would give obstacles a tiny speed, and the
        # derivative of the force by this speed would appear in the linear model.
        remembered = self.period_map(state, time_s, fixed=no_force)
        controller = self.indices("controller")
        state[controller] = remembered[controller]
        return state, time_s

    def _simulator(self, fixed: frozenset[Port], *, twin: bool) -> Any:
        """Simulator for runs in which these ports are fixed; made at the first use."""
        key = (fixed, twin)
        if key not in self._simulators:
            make, diagram = (
                (Simulator_[AutoDiffXd], self.twin)
                if twin
                else (Simulator, self.follower.diagram)
            )
            simulator = make(diagram)
            ApplySimulatorConfig(simulator_config(self.scenario), simulator)
            self._simulators[key] = simulator
        return self._simulators[key]

    def fix(self, context: Any, port: Port, value: Any, *, twin: bool = False) -> None:
        """Cuts an input port off from its source in a root context; sets its value."""
        role, name = port
        block = self.block(role, twin=twin)
        own = block.GetMyMutableContextFromRoot(context)
        block.GetInputPort(name).FixValue(own, value)

    def _read(self, context: Any, port: Port) -> Any:
        role, name = port
        block = self.block(role, twin=True)
        return block.GetOutputPort(name).Eval(block.GetMyContextFromRoot(context))


@lru_cache(maxsize=64)
def _cached_loop(key: str, _own_code: str) -> IdealLoop:
    return IdealLoop(Scenario.model_validate_json(key))


def ideal_loop(scenario: Scenario) -> IdealLoop:
    """Returns the control loop of a scenario with exact sensors (``ideal_scenario``).

    Callers with the same scenario get the same object. Each process builds the loop of
    a scenario only once, because Drake never frees blocks that are written in Python.
    Raises InputError if the scenario has no linear model.
    """
    return _cached_loop(scenario.model_dump_json(), str(loaded_digests(scenario)))
