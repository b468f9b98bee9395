"""State of a diagram as one vector, and runs that begin at a given state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import InitializeParams

#: A port of a block: (role in ``SoundFollower.blocks``, name of the port).
Port = tuple[str, str]


class Runner:
    """Simulation whose state and cut inputs can be changed between steps.

    A cut input is an input port of a block that is disconnected from its source and has
    a fixed value. ``fix(context, port, value)`` sets this value. The simulation begins
    at ``state`` (n,), just before the control update at ``time_s``, which is a multiple
    of ``tick_s``. The simulator may belong to an ``IdealLoop``. Finish the simulation
    before you use this loop for anything else.
    """

    def __init__(
        self,
        simulator: Any,
        fix: Callable[[Any, Port, Any], None],
        state: NDArray[np.float64],
        time_s: float,
        tick_s: float,
    ) -> None:
        self._simulator, self._fix = simulator, fix
        self._context = simulator.get_mutable_context()
        # References to the parts of the state. To create them in every step would take
        # a tenth of the computing time.
        self._parts = [
            self._context.get_continuous_state_vector(),
            *map(
                self._context.get_discrete_state,
                range(self._context.num_discrete_state_groups()),
            ),
        ]
        begin(simulator, state, time_s, tick_s)

    def fix(self, port: Port, value: NDArray[np.float64]) -> None:
        """Sets the value of a cut input from now on, in the units of the port."""
        self._fix(self._context, port, value)

    def advance(self, time_s: float) -> None:
        """Simulates up to ``time_s``, without a control update at that time."""
        if time_s > self._context.get_time():
            self._simulator.AdvanceTo(time_s)

    def state(self) -> NDArray[np.float64]:
        """Returns the present state (n,)."""
        return np.concatenate([part.CopyToVector() for part in self._parts])

    def set_state(self, indices: Sequence[int], values: NDArray[np.float64]) -> None:
        """Replaces the elements of the state at ``indices`` by ``values``."""
        state = self.state()
        state[list(indices)] = values
        set_state(self._context, state)


def run_periods(
    simulator: Any, state: Any, time_s: float, periods: int, tick_s: float
) -> None:
    """Simulates ``periods`` control periods from the state (n,) at a time.

    The time ``time_s`` is rounded to a multiple of the control period ``tick_s``. The
    simulation starts and ends just before a control update.
    """
    begin(simulator, state, time_s, tick_s)
    # Drake's tick times are multiples of the period. A sum of periods would give a
    # slightly different time.
    simulator.AdvanceTo((round(time_s / tick_s) + periods) * tick_s)


def begin(simulator: Any, state: Any, time_s: float, tick_s: float) -> None:
    """Puts a simulator into a state (n,), just before a control update.

    This is the control update nearest to ``time_s``.
    """
    context = simulator.get_mutable_context()
    context.SetTime(round(time_s / tick_s) * tick_s)
    set_state(context, state)
    quiet = InitializeParams()
    quiet.suppress_initialization_events = True
    simulator.Initialize(quiet)


def set_state(context: Any, state: Any) -> None:
    """Sets the whole state from one vector (n,): continuous states, discrete groups."""
    start = context.num_continuous_states()
    context.SetContinuousState(state[:start])
    set_discrete_state(context, state[start:])


def set_discrete_state(context: Any, state: Any) -> None:
    """Sets all discrete groups of a context, in their order, from one vector."""
    start = 0
    for group in range(context.num_discrete_state_groups()):
        size = context.get_discrete_state(group).size()
        context.SetDiscreteState(group, state[start : start + size])
        start += size


def get_state(context: Any) -> Any:
    """Returns the whole state (n,), in the order of ``set_state``."""
    groups = [
        context.get_discrete_state(k).CopyToVector()
        for k in range(context.num_discrete_state_groups())
    ]
    continuous = context.get_continuous_state_vector().CopyToVector()
    return np.concatenate([continuous, *groups])
