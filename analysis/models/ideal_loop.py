"""The all-ideal build as a map of one period, with its derivatives.

The diagram is the one that simulates: its builder, its blocks, its integrator.
Only hearing and obstacle sensing are exact, and wheel angles are not rounded,
so that every block converts to AutoDiffXd.
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

from analysis.models.autodiff import seed, value_and_gradient
from analysis.models.diagram_state import (
    Port,
    Runner,
    get_state,
    run_periods,
    set_state,
)
from analysis.models.ideal_scenarios import (
    require_ideal,
)
from diagrams import build_sound_follower
from diagrams.building.robot import parts_of
from diagrams.running.simulation import simulator_config
from diagrams.scenario.own_code import loaded_digests
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

#: The tracker's slowest mode decays as 0.27 a tick where hearing is exact.
SETTLING_TICKS = 40


@dataclass(frozen=True)
class PeriodDerivatives:
    """One period about a state: x+ = f(x, u), y = g(x, u) at its first tick."""

    next_state: NDArray[np.float64]
    """(n,) state a period later."""
    A: NDArray[np.float64]
    """(n, n) its derivative by the state."""
    B: NDArray[np.float64]
    """(n, m) its derivative by the inputs that are held over the period."""
    y: NDArray[np.float64]
    """(p,) outputs at the tick that begins the period, before its updates."""
    C: NDArray[np.float64]
    """(p, n) their derivative by the state."""
    D: NDArray[np.float64]
    """(p, m) their derivative by the inputs."""


class IdealLoop:
    """The all-ideal build, and its AutoDiff twin: converted once, used again.

    The state is the diagram's, named by ``state_names``: continuous
    first, then the discrete groups. A period begins just before the updates of
    a tick and ends just before those of the next.

    Args:
        scenario: All ideal, see ``ideal_scenario``.

    Raises:
        InputError: The scenario, or a law of the user's, has no derivative.
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
        """Continuous blocks as maps of one period, see
        ``analysis.models.block_models``."""
        self._simulators: dict[Any, Any] = {}

    @property
    def tick_s(self) -> float:
        """The period, s."""
        return self.scenario.tick_s

    def _require_forces(self) -> None:
        """Refuses a law whose loop is another than that of the virtual mass."""
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
        """Lets a law that is a user's own meet a variable before all else does."""
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
        """A block by its role in ``SoundFollower.blocks``, float or AutoDiffXd.

        Args:
            role: A key of ``SoundFollower.blocks``.
            twin: Whether the one for AutoDiffXd is meant.

        Returns:
            A LeafSystem of float, or of AutoDiffXd.
        """
        return self._twin_blocks[role] if twin else self.follower.blocks[role]

    def _names(self) -> tuple[str, ...]:
        """``part.element`` of every state: continuous first, then discrete.

        What a block does not name, as a user's own law, is numbered.
        """
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
        """Where a block's state stands in the state vector."""
        prefix = f"{role}."
        return [k for k, n in enumerate(self.state_names) if n.startswith(prefix)]

    def context(self, state: NDArray[np.float64], time_s: float = 0.0) -> Any:
        """The float diagram's context at a state; valid until the next call.

        Args:
            state: (n,) of the diagram.
            time_s: Its time, s.

        Returns:
            The root context.
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
        """The state some periods later.

        Args:
            state: (n,) just before the updates of the tick at ``time_s``.
            time_s: A multiple of the period, s.
            fixed: Values of input ports that are cut off from their source.
            periods: Number of periods.

        Returns:
            (n,) just before the updates of the tick that many periods later.
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
        """One period's derivatives, by AutoDiff through the whole diagram.

        Args:
            state: (n,) just before the updates of the tick at ``time_s``.
            time_s: A multiple of the period, s.
            inputs: Input ports that are cut off from their source and held over
                the period; those of one key share a value and its derivative.
            outputs: Output ports to differentiate at the first tick.

        Returns:
            The next state, the outputs, and the derivatives of both.
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
        """A run of the float diagram from a state, to be stopped at any moment.

        Args:
            state: (n,) just before the updates of the tick at ``time_s``.
            time_s: A multiple of the period, s.
            fixed: Input ports that are cut off, and fed by ``Runner.fix``.

        Returns:
            The run, before its first tick.
        """
        simulator = self._simulator(frozenset(fixed), twin=False)
        return Runner(simulator, self.fix, state, time_s, self.tick_s)

    def settled_state(
        self,
        pose_WB: Sequence[float],
        v_WP: tuple[float, float] = (0.0, 0.0),
        begin_s: float = 0.0,
    ) -> tuple[NDArray[np.float64], float]:
        """State in which all that remembers has seen a steady motion for long.

        The robot moves at a constant velocity along its heading, or rests; the
        source does what its path says; forces do not act meanwhile.

        Args:
            pose_WB: Pose at ``begin_s``, m and rad.
            v_WP: Velocity of P in W, m/s, along the heading.
            begin_s: A multiple of the period, s: when the source's motion is steady.

        Returns:
            State and its time in s.
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
        # An obstacle's speed of rounding errors alone would have a slope.
        remembered = self.period_map(state, time_s, fixed=no_force)
        controller = self.indices("controller")
        state[controller] = remembered[controller]
        return state, time_s

    def _simulator(self, fixed: frozenset[Port], *, twin: bool) -> Any:
        """A simulator whose context has these ports fixed, made once."""
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
        """Cuts an input port off from its source and sets what it reads.

        Args:
            context: Root context of the diagram, changed.
            port: Role of the block, and name of its input port.
            value: (size of the port,), in its unit; AutoDiffXd for the twin.
            twin: Whether the context is that of the AutoDiff diagram.
        """
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
    """The loop of a scenario, built and converted once in a process.

    Drake never frees blocks written in Python, so that a build should be used
    again.

    Raises:
        InputError: The scenario has no linear model.
    """
    return _cached_loop(scenario.model_dump_json(), str(loaded_digests(scenario)))
