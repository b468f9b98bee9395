"""The control loop with exact sensors as a map over one period, with derivatives.

The diagram has the same builder, blocks and integrator as the simulation. Only the
sensors differ: hearing and obstacle sensing are exact, and wheel angles are not
rounded. Therefore every block can be converted to Drake's AutoDiffXd.
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
from analysis.loops.ideal_scenarios import require_ideal
from diagrams import build_sound_follower
from diagrams.building.robot import parts_of
from diagrams.running.simulation import simulator_config
from diagrams.scenario.own_code import loaded_digests
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

#: Periods after which the tracker has settled. With exact hearing, its slowest mode
#: decays by a factor of 0.27 per period.
SETTLING_TICKS = 40


@dataclass(frozen=True)
class PeriodDerivatives:
    """Linearization of one control period: x+ = f(x, u) and y = g(x, u).

    The inputs u are held over the period. The outputs y are those at the beginning of
    the period, before the control update.
    """

    next_state: NDArray[np.float64]
    """(n,) state one period later."""
    A: NDArray[np.float64]
    """(n, n) derivative of the next state by the state."""
    B: NDArray[np.float64]
    """(n, m) derivative of the next state by the inputs, held over the period."""
    y: NDArray[np.float64]
    """(p,) outputs at the beginning of the period, before the control update."""
    C: NDArray[np.float64]
    """(p, n) derivative of the outputs by the state."""
    D: NDArray[np.float64]
    """(p, m) derivative of the outputs by the inputs."""


class IdealLoop:
    """Closed control loop with exact sensors, as a float and an AutoDiffXd diagram.

    The AutoDiffXd diagram is converted once and used again. The state is that of the
    diagram: first the continuous states, then the discrete groups. ``state_names``
    names its elements. A period begins just before one control update and ends just
    before the next. The scenario is that of ``ideal_scenario``. Raises InputError if
    the scenario, or a user's own law, has no derivative.
    """

    def __init__(self, scenario: Scenario) -> None:
        require_ideal(scenario)
        self.scenario = scenario
        self.follower = build_sound_follower(scenario)
        self._require_forces()
        twin: Any = self.follower.diagram.ToAutoDiffXdMaybe()
        if twin is None:
            raise InputError(
                "law",
                f"the block of {scenario.only.law!r} has no AutoDiffXd form; write it "
                "as a function law(c, s, laws) with pydrake.math, or as a "
                "TemplateSystem of float and AutoDiffXd",
            )
        self.twin: Any = twin
        self._twin_blocks = {
            part: block
            for name in (*self.follower.sources, *self.follower.robots)
            for part, block in parts_of(twin.GetSubsystemByName(name)).blocks.items()
        }
        self._try_law()
        self.state_names: tuple[str, ...] = self._names()
        self.sampled_twins: dict[str, Any] = {}
        """Continuous blocks as AutoDiffXd maps over one period, by role. See
        ``analysis.loops.block_models``."""
        self._simulators: dict[Any, Any] = {}

    @property
    def tick_s(self) -> float:
        """Control period, s."""
        return self.scenario.tick_s

    def _require_forces(self) -> None:
        """Raises an error if the law does not push a virtual mass."""
        block = self.follower.blocks["controller"]
        for port in ("acceleration_W", "forces_W"):
            if not block.HasOutputPort(port):
                raise InputError(
                    "law",
                    f"{self.scenario.only.law!r} has no output port {port}, and "
                    "linear models need a law that pushes a virtual mass; use "
                    "such a law, or simulate",
                )

    def _try_law(self) -> None:
        """Evaluates a user's own law with AutoDiffXd, to report errors early."""
        if ":" not in self.scenario.only.law:
            return
        block = self.block("controller", twin=True)
        context = block.CreateDefaultContext()
        inputs = {
            "p_WS_estimated": [2.0, 0.0],
            "target_valid": [1.0],
            "collision_vectors_B": [0.5, 0.0, 0.0, 0.0, 0.0, 0.0],
            "features": [1.0, 0.0, 0.0],
            "pose_WB_estimated": [0.0, 0.0, 0.0],
            "v_WP": [0.0, 0.0],
        }
        variables = seed(np.concatenate(list(inputs.values())))
        ends = np.cumsum([len(value) for value in inputs.values()])
        for name, part in zip(inputs, np.split(variables, ends[:-1]), strict=True):
            block.GetInputPort(name).FixValue(context, part)
        try:
            block.GetOutputPort("acceleration_W").Eval(context)
        except Exception as error:  # whatever a user's function raises
            own = error.__cause__ or error
            raise InputError(
                "law",
                f"{self.scenario.only.law!r} cannot be differentiated "
                f"({type(own).__name__}: {own}); write it with pydrake.math "
                "(exp, sqrt, ...) instead of math and numpy",
            ) from error

    def block(self, role: str, *, twin: bool = False) -> Any:
        """Returns the block of a role in the float or the AutoDiffXd (twin) diagram."""
        return self._twin_blocks[role] if twin else self.follower.blocks[role]

    def _names(self) -> tuple[str, ...]:
        """Names ``part.element`` of all states; states without a name are numbered."""
        context = self.follower.diagram.CreateDefaultContext()
        continuous: list[str] = []
        discrete: list[str] = []
        for part, block in self.follower.only.blocks.items():
            own = block.GetMyContextFromRoot(context)
            size, names = own.num_total_states(), getattr(block, "states", ())
            if len(names) != size:
                names = tuple(f"state_{k}" for k in range(size))
            kind = continuous if own.num_continuous_states() else discrete
            kind.extend(f"{part}.{name}" for name in names)
        return (*continuous, *discrete)

    def indices(self, role: str) -> list[int]:
        """Indices of the states of a block in the state vector."""
        prefix = f"{role}."
        return [k for k, n in enumerate(self.state_names) if n.startswith(prefix)]

    def context(self, state: NDArray[np.float64], time_s: float = 0.0) -> Any:
        """Returns the root context at a state (n,), valid until the next call."""
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
        """Returns the state (n,) after some whole periods.

        Both states are those just before a control update. ``time_s`` is a multiple of
        the period. The ports ``fixed`` are cut off from their source and have constant
        values.
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

        The state (n,) is that just before the control update at ``time_s``, a multiple
        of the period. The ports ``inputs`` are cut off from their source and held over
        the period. The ports of one key share a value and its derivative. The ports
        ``outputs`` are read before the control update.
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
        a multiple of the period. The ports ``fixed`` are cut off from their source.
        ``Runner.fix`` sets their values.
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

        The robot rests or moves at constant velocity along its heading, and the source
        follows its path. ``pose_WB`` is the pose, m and rad, at ``begin_s``, from which
        on the source moves steadily. The law's acceleration is zero meanwhile. At the
        end, just before a control update, the tracker and the controller's memory have
        settled.
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
        # Rounding errors would otherwise give obstacles a speed, and this a slope.
        remembered = self.period_map(state, time_s, fixed=no_force)
        controller = self.indices("controller")
        state[controller] = remembered[controller]
        return state, time_s

    def _simulator(self, fixed: frozenset[Port], *, twin: bool) -> Any:
        """A simulator whose context has these ports fixed, created at the first use."""
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
        """Cuts an input port in a root context off from its source; sets its value."""
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

    Each process builds and converts the loop of a scenario only once, because Drake
    never frees blocks that are written in Python. Callers with the same scenario share
    it. Raises InputError if the scenario has no linear model.
    """
    return _cached_loop(scenario.model_dump_json(), str(loaded_digests(scenario)))
