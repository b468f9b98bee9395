"""Evaluates one block, with inputs, state and time that a test sets."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator_, SimulatorConfig

from analysis.loops.diagram_ports import carries_numbers, ports_of
from phonotaxis.testing.ports import (
    differentiates,
    elements,
    example,
    input_port,
    numbers_of,
    output_port,
    port_value,
)
from systems.framework.block import copied, has_arrays, period_of
from systems.framework.finite import block_name
from systems.framework.input_error import InputError, shortened
from systems.framework.signals import TICK_S

_ROUNDING_S = 1e-9


class Bench:
    """A block whose inputs, state and time are set by a test.

    The bench works with every block of phonotaxis, with your own blocks, and with any
    other Drake system, including diagrams. If a block supports Drake's type AutoDiffXd,
    so does the bench.

    Args:
        block: The block. It must not be part of a diagram.
        time_s: Time, s.
        state: Initial state, see the property ``state``. None: the block's own initial
            state.
        tick_s: Duration of a tick, s. None: the period of the block. A block that
            updates nothing periodically has the default control period, 0.025 s.
        **inputs: Values of input ports by name, see ``set``.

    Raises:
        InputError: The block has no input port of a given name, or a value does not
            have the shape of the port or of the state.
    """

    def __init__(
        self,
        block: Any,
        /,
        *,
        time_s: float = 0.0,
        state: Any = None,
        tick_s: float | None = None,
        **inputs: Any,
    ) -> None:
        self.block = block
        self.tick_s = tick_s or _period_of(block)
        """Duration of a tick, s."""
        self.context = block.CreateDefaultContext()
        """Drake context of the block."""
        self.context.SetTime(time_s)
        self._simulator: Any = None
        self._simulated_s = math.nan
        if state is not None:
            self.state = state
        self.set(**inputs)

    def set(self, /, **inputs: Any) -> Self:
        """Sets input ports. Each input keeps its value until it is set again.

        Args:
            **inputs: Values by name of the port: n numbers for a port with n elements,
                one number for a port with one element, or the object that the port
                carries.

        Returns:
            The bench itself.

        Raises:
            InputError: The block has no input port of a given name, or a value does not
                have the shape of the port. The message contains the line to type.
        """
        for name, value in inputs.items():
            port = input_port(self.block, name)
            port.FixValue(self.context, port_value(self.block, port, value))
        return self

    def output(self, name: str) -> Any:
        """Evaluates an output port.

        Args:
            name: Name of the port.

        Returns:
            (n,) array of the values, or the object that the port carries.

        Raises:
            InputError: The block has no such output port.
            InputError: The output needs an input that has no value.
        """
        port = output_port(self.block, name)
        with self._explained(f"the output {name!r}", port):
            return port.Eval(self.context)

    def outputs(self, names: Iterable[str] | None = None) -> dict[str, Any]:
        """Evaluates several output ports.

        Args:
            names: Names of output ports. None: all output ports.

        Returns:
            Values by name of the port, see ``output``.

        Raises:
            InputError: See ``output``.
        """
        if names is None:
            names = [port.get_name() for port in ports_of(self.block, "output")]
        return {name: self.output(name) for name in names}

    @property
    def time_s(self) -> float:
        """Time of the block, s."""
        return float(self.context.get_time())

    @property
    def state(self) -> Any:
        """State of the block.

        It is an (n,) array with the continuous state first, and then the discrete
        state. If the state of the block is a named tuple, it is a copy of this tuple.
        """
        if self._is_tuple:
            return copied(self.context.get_abstract_state(0).get_value()[1])
        return np.concatenate([self._continuous(), *self._groups()])

    @state.setter
    def state(self, state: Any) -> None:
        if self._is_tuple:
            self._set_tuple(state)
            return
        context, block = self.context, self.block
        values = np.atleast_1d(numbers_of(block, state))
        continuous, groups = self._continuous(), self._groups()
        count = sum(map(len, groups), len(continuous))
        if values.shape != (count,):
            names = ", ".join(getattr(block, "states", ()))
            needed = f"{count}{f' ({names})' if names else ''}"
            raise InputError(
                block_name(block),
                f"state has {elements(values.size)}; it needs {needed}; write "
                f"state=[0.0] * {count}"
                if count
                else "has no state of numbers; remove state=",
            )
        if len(continuous):
            context.SetContinuousState(values[: len(continuous)])
        begin = len(continuous)
        for k, group in enumerate(groups):
            context.SetDiscreteState(k, values[begin : begin + len(group)])
            begin += len(group)

    def next_state(self) -> NDArray[Any]:
        """Evaluates the update of the discrete state in this tick (control period).

        Returns:
            (n,) array of the discrete state in the next tick. The state of the bench
            does not change.

        Raises:
            InputError: The update needs an input that has no value.
            InputError: The block has no discrete state of numbers with one period; use
                ``tick`` and ``state``.
        """
        if self._is_tuple or not self.context.num_discrete_state_groups():
            raise InputError(
                block_name(self.block),
                "has no discrete state of numbers; call tick(), and then read state",
            )
        with self._explained("the update of the state"):
            update = self.block.EvalUniquePeriodicDiscreteUpdate(self.context)
            return np.concatenate(_vectors(update))

    def rates(self) -> NDArray[Any]:
        """Evaluates the time derivatives of the continuous state.

        Returns:
            (n,) array; empty if the block has no continuous state.

        Raises:
            InputError: The derivatives need an input that has no value.
        """
        with self._explained("the derivatives of the state"):
            derivatives: Any = self.block.EvalTimeDerivatives(self.context)
        return np.asarray(derivatives.CopyToVector())

    def tick(self, **inputs: Any) -> Self:
        """Simulates one tick (control period): updates the state, and then the time.

        Drake's Simulator first updates the discrete state at the present time, and then
        integrates the continuous state until the next tick, with a relative accuracy of
        1e-7. All inputs are constant during the tick.

        Args:
            **inputs: Inputs that are set before the tick, see ``set``.

        Returns:
            The bench itself, at the time of the next tick.

        Raises:
            InputError: The update needs an input that has no value, or the value of an
                input has the wrong shape.
        """
        self.set(**inputs)
        if self._simulator is None:
            self._simulator = Simulator_[self._scalar](self.block, self.context)
            config = SimulatorConfig(
                integration_scheme="runge_kutta5",
                max_step_size=self.tick_s,
                accuracy=1e-7,
                use_error_control=True,
                start_time=self.time_s,  # Drake sets the time to this value
            )
            ApplySimulatorConfig(config, self._simulator)
        if self._simulated_s != self.time_s:
            self._simulator.Initialize()
        end = self.time_s + self.tick_s
        # A sum of many periods would miss the times of the updates.
        whole = round(end / self.tick_s) * self.tick_s
        with self._explained("the update of the state"):
            self._simulator.AdvanceTo(whole if abs(whole - end) < _ROUNDING_S else end)
        self._simulated_s = self.time_s
        return self

    @property
    def _scalar(self) -> Any:
        return AutoDiffXd if differentiates(self.block) else float

    @property
    def _is_tuple(self) -> bool:
        """Whether the state of the block is a named tuple."""
        return has_arrays(getattr(getattr(self.block, "step", None), "state", None))

    def _continuous(self) -> NDArray[Any]:
        return np.asarray(self.context.get_continuous_state_vector().CopyToVector())

    def _groups(self) -> list[NDArray[Any]]:
        """Returns the groups of the discrete state."""
        return _vectors(self.context.get_discrete_state())

    def _set_tuple(self, state: Any) -> None:
        """Sets a state that is a named tuple, and the outputs that depend on it."""
        step = self.block.step
        if type(state) is not type(step.state):
            raise InputError(
                block_name(self.block),
                f"state is {shortened(repr(state), 60)}; it needs a "
                f"{type(step.state).__name__}; write state=block.step.state",
            )
        # The update of no tick has been done, and its outputs are not known.
        self.context.SetAbstractState(0, (-1, copied(state), None))
        if step.publish is not None:
            ports = filter(carries_numbers, ports_of(self.block, "output"))
            published = [np.zeros(port.size()) for port in ports]
            step.publish(state, published, step.numbers)
            self.context.SetDiscreteState(np.concatenate(published))

    @contextmanager
    def _explained(self, what: str, port: Any = None) -> Iterator[None]:
        """Turns the error of an input without value into one that names the input.

        Args:
            what: What is evaluated, for the message.
            port: The output port that is evaluated; None for the state.
        """
        try:
            yield
        except Exception as error:
            missing = self._missing(str(error), port)
            if not missing:
                raise
            names = " and ".join(each.get_name() for each in missing)
            raise InputError(
                block_name(self.block),
                f"{what} needs {names}, which has no value; write "
                f"{', '.join(map(example, missing))}",
            ) from error

    def _missing(self, message: str, port: Any) -> list[Any]:
        """Returns the inputs without value that an evaluation needs."""
        unset = [
            p for p in ports_of(self.block, "input") if not p.HasValue(self.context)
        ]
        if port is not None:
            index = port.get_index()
            has_feedthrough = self.block.HasDirectFeedthrough
            return [p for p in unset if has_feedthrough(p.get_index(), index)]
        required = re.search(r"required InputPort\[\d+\] \((.*?)\)", message)
        if required is None:
            return []
        return [p for p in unset if p.get_name() == required[1]] or unset


def _period_of(block: Any) -> float:
    timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
    if timing is not None:
        return float(timing.period_sec())
    return period_of(block) or TICK_S


def _vectors(values: Any) -> list[NDArray[Any]]:
    """Returns the groups of discrete values of Drake as arrays."""
    return [values.get_vector(k).CopyToVector() for k in range(values.num_groups())]
