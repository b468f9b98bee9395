"""A diagram's whole state as one vector, and runs that begin from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import InitializeParams

#: A port of a block: (role in ``SoundFollower.blocks``, name of the port).
Port = tuple[str, str]


class Runner:
    """A simulation whose state and cut inputs can be changed between steps.

    It shares its context with other uses of the same loop: finish one first.

    Args:
        simulator: Its context is used.
        fix: ``fix(context, port, value)`` sets what a cut input reads.
        state: (n,) just before the updates of the tick at ``time_s``.
        time_s: A multiple of the period, s.
        tick_s: The period, s.
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
        # Objects by which Python sees the parts: to make them anew costs a tenth.
        self._parts = [
            self._context.get_continuous_state_vector(),
            *map(
                self._context.get_discrete_state,
                range(self._context.num_discrete_state_groups()),
            ),
        ]
        begin(simulator, state, time_s, tick_s)

    def fix(self, port: Port, value: NDArray[np.float64]) -> None:
        """What a cut input reads from now on.

        Args:
            port: Role of the block, and name of its input port.
            value: (size of the port,), in its unit.
        """
        self._fix(self._context, port, value)

    def advance(self, time_s: float) -> None:
        """Simulates until then; a tick at that moment is still to come."""
        if time_s > self._context.get_time():
            self._simulator.AdvanceTo(time_s)

    def state(self) -> NDArray[np.float64]:
        """(n,) now."""
        return np.concatenate([part.CopyToVector() for part in self._parts])

    def set_state(self, indices: Sequence[int], values: NDArray[np.float64]) -> None:
        """Replaces elements of the state.

        Args:
            indices: k places in the state.
            values: (k,) their new values.
        """
        state = self.state()
        state[list(indices)] = values
        set_state(self._context, state)


def run_periods(
    simulator: Any, state: Any, time_s: float, periods: int, tick_s: float
) -> None:
    """Simulates whole periods from a state, to just before the next tick.

    Args:
        simulator: Its context is changed.
        state: (n,) just before the updates of the tick at ``time_s``.
        time_s: A multiple of the period, s.
        periods: How many, 0 or more.
        tick_s: The period, s.
    """
    begin(simulator, state, time_s, tick_s)
    # Ticks are multiples in Drake's arithmetic: a sum could miss the next one.
    simulator.AdvanceTo((round(time_s / tick_s) + periods) * tick_s)


def begin(simulator: Any, state: Any, time_s: float, tick_s: float) -> None:
    """Puts a simulator just before the updates of the tick at ``time_s``.

    Args:
        simulator: Its context is changed.
        state: (n,) just before the updates of the tick.
        time_s: Of the tick; rounded to a multiple of the period, s.
        tick_s: The period, s.
    """
    context = simulator.get_mutable_context()
    context.SetTime(round(time_s / tick_s) * tick_s)
    set_state(context, state)
    quiet = InitializeParams()
    quiet.suppress_initialization_events = True
    simulator.Initialize(quiet)


def set_state(context: Any, state: Any) -> None:
    """Sets the whole state: continuous first, then the discrete groups.

    Args:
        context: Of a diagram, changed.
        state: (n,) floats, or AutoDiffXd where the context is of these.
    """
    start = context.num_continuous_states()
    context.SetContinuousState(state[:start])
    set_discrete_state(context, state[start:])


def set_discrete_state(context: Any, state: Any) -> None:
    """Sets the discrete groups from one vector.

    Args:
        context: Of a diagram, changed.
        state: (m,) one group after the other.
    """
    start = 0
    for group in range(context.num_discrete_state_groups()):
        size = context.get_discrete_state(group).size()
        context.SetDiscreteState(group, state[start : start + size])
        start += size


def get_state(context: Any) -> Any:
    """(n,) the whole state, in the order of ``set_state``."""
    groups = [
        context.get_discrete_state(k).CopyToVector()
        for k in range(context.num_discrete_state_groups())
    ]
    continuous = context.get_continuous_state_vector().CopyToVector()
    return np.concatenate([continuous, *groups])
