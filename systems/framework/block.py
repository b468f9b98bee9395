"""The base of all blocks: a block declares its ports, state and columns once.

From this declaration ``Block`` makes the Drake ports, the state and its update, the
check that all inputs are finite, the port table of the docstring, the columns in the
table of a run, and the step of the compiled loop.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem, LeafSystem_

from systems.framework.cache import declare_cache
from systems.framework.finite import read_arrays, read_lists
from systems.framework.input_error import InputError
from systems.framework.noise import TickNoise, tick_noise
from systems.framework.scalar_math import float_of

Stage = Literal["world", "hearing", "obstacle sensing", "control", "robot"]
#: The stages of the signal chain, in order.
STAGES: tuple[Stage, ...] = (
    "world",
    "hearing",
    "obstacle sensing",
    "control",
    "robot",
)

#: The size of a port that carries a Python object instead of numbers.
OBJECT = "object"


class Port(NamedTuple):
    """An input or output port of a block."""

    name: str
    size: int | str
    """Number of elements; or a multiple of a size that the block knows when it is made,
    as ``sensors`` or ``3 bodies``; or ``OBJECT``."""
    unit: str
    """Units of the elements, as ``m, m, rad``, or the type of the object."""
    columns: str | tuple[str, ...] = ()
    """Names of the elements in the table of a run; ``range_{}`` stands for ``range_1``,
    ``range_2`` and so on. Without columns the port is not in the table."""

    def elements(self, sizes: Mapping[str, int]) -> int:
        """Number of elements.

        Args:
            sizes: The sizes that the block knows, by name.

        Returns:
            The number; that of a port that carries an object is not known.
        """
        if isinstance(self.size, int):
            return self.size
        factor, _, name = self.size.rpartition(" ")
        return int(factor or 1) * sizes[name]

    def column_names(self, sizes: Mapping[str, int]) -> tuple[str, ...]:
        """Names of the elements in the table of a run.

        Args:
            sizes: The sizes that the block knows, by name.

        Returns:
            One name per element; empty if the port is not in the table.
        """
        if isinstance(self.columns, str):
            count = self.elements(sizes)
            return tuple(self.columns.format(k + 1) for k in range(count))
        return self.columns


class Step(NamedTuple):
    """What a block computes in a tick, for Drake and for compiled loops.

    ``step(tick, state, inputs, outputs, numbers)`` reads the inputs, fills the outputs
    element by element, and replaces the state by that of the next tick. ``inputs`` and
    ``outputs`` have one entry per port, in the order of the declaration: a sequence of
    numbers, or the object that the port carries. The sequences are lists of float or
    AutoDiffXd in Drake and arrays in compiled code.
    """

    step: Callable[..., None]
    numbers: Any
    """What the step depends on and never changes: a named tuple of numbers, arrays,
    functions and parameters, or of tuples of these. A field ``noise`` is a
    ``TickNoise``; each run gives it the seed of the run."""
    state: Any = ()
    """At the first tick: a sequence of numbers, or a named tuple of arrays (or of named
    tuples of arrays), which the step changes in place."""
    publish: Callable[..., None] | None = None
    """``publish(state, outputs, numbers)`` fills the outputs of a block whose outputs
    depend on its state alone. The step then does not fill them."""
    host: Any = None
    """``HostCall`` of a step that calls Python; the loop keeps it alive."""
    carries: Mapping[str, Callable[[int], Any]] = {}
    """What each output port that carries an object has at a tick."""


class RunFacts(NamedTuple):
    """What a step needs to know of the run in a compiled loop.

    Blocks are shared by runs that differ in start, seed and layout. Therefore these
    values come from the run, whatever the block was made with.
    """

    ticks: int
    tick_s: float
    initial_pose: tuple[float, float, float]
    """Of the robot in W, m and rad."""
    scheme: str
    """Of the integrator, as ``runge_kutta3``."""
    step_s: float
    """Largest step of the integrator, s."""
    seed_of: Callable[[str], int]
    """Seed of a block, by the name of the block."""
    carried: Mapping[str, Callable[[int], Any]]
    """What the input ports that carry objects have at a tick, by name."""
    mapped: Any = ()
    """(n, 5) x, y, theta, length, width of the obstacles in the robot's map, m and
    rad."""
    goal: tuple[float, float] | None = None
    """Position of the goal of the robot, m, if it has one."""


def has_arrays(state: Any) -> bool:
    """Whether a state is a named tuple of arrays, which a step changes in place."""
    return hasattr(state, "_fields")


def copied(state: Any) -> Any:
    """A deep copy of a named tuple of arrays, or of named tuples of arrays.

    Args:
        state: Its fields may also be numbers, which a step cannot change.

    Returns:
        A state that shares no array with the first one.
    """
    if has_arrays(state):
        return type(state)(*map(copied, state))
    return np.copy(state) if isinstance(state, np.ndarray) else state


class _Declared:
    """The declaration of a block, and what is made of it.

    Its private names are mangled, so that blocks can use any name of their own.
    """

    part: ClassVar[str] = ""
    """The role of the block in its robot, as ``plant`` or ``tracker``. A block replaces
    another one by having the same part."""
    stage: ClassVar[Stage] = "control"
    """The place of the block in the signal chain."""
    inputs: Sequence[Port] = ()
    """Input ports, in the order of the step."""
    outputs: Sequence[Port] = ()
    """Output ports, in the order of the step. One that carries an object publishes the
    field of that name of a state of arrays; the step does not fill it."""
    states: Sequence[str] = ()
    """Names of the elements of the state, continuous elements first."""
    columns: Mapping[str, tuple[str, ...]] = {}
    """The columns of each output port that is in the table of a run."""
    step: Step

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if {"inputs", "outputs"}.intersection(vars(cls)):
            cls.__doc__ = _with_port_table(cls)

    def declare_ports(
        self: Any,
        *,
        sizes: Mapping[str, int] | None = None,
        omit: Collection[str] = (),
    ) -> list[Any]:
        """Declares the input ports and the columns of a block that computes by itself.

        Such a block adds its output ports by ``declare_output``.

        Args:
            sizes: The sizes that the ports refer to.
            omit: Names of ports that this block does not have.

        Returns:
            The input ports.
        """
        self.__sizes = {**(sizes or {})}
        self.__input_ports = [
            self.__declare_input(port) for port in self.inputs if port.name not in omit
        ]
        self.__outputs = [port for port in self.outputs if port.name not in omit]
        self.__output_sizes = [
            port.elements(self.__sizes)
            for port in self.__outputs
            if port.size != OBJECT
        ]
        self.columns = {
            port.name: port.column_names(self.__sizes)
            for port in self.__outputs
            if port.columns
        }
        return list(self.__input_ports)

    def declare_output(
        self: Any, name: str, calc: Callable[[Any, Any], None], prerequisites: set[Any]
    ) -> Any:
        """Declares one of the output ports.

        Args:
            name: As in ``outputs``.
            calc: ``calc(context, output)`` sets the output.
            prerequisites: Tickets of what ``calc`` reads.

        Returns:
            The port.
        """
        (port,) = (port for port in self.__outputs if port.name == name)
        if port.size == OBJECT:
            return self.DeclareAbstractOutputPort(
                name=name,
                alloc=lambda: Value(object()),
                calc=calc,
                prerequisites_of_calc=prerequisites,
            )
        return self.DeclareVectorOutputPort(
            name=name,
            size=port.elements(self.__sizes),
            calc=calc,
            prerequisites_of_calc=prerequisites,
        )

    def declare(
        self: Any,
        step: Step,
        *,
        tick_s: float,
        sizes: Mapping[str, int] | None = None,
        omit: Collection[str] = (),
        unread: Collection[str] = (),
        arrays: bool = False,
    ) -> None:
        """Declares ports, state, update and outputs of a block that does a ``Step``.

        Args:
            step: What the block computes in a tick.
            tick_s: Period of the update, s.
            sizes: The sizes that the ports refer to.
            omit: Names of ports that this block does not have.
            unread: Names of input ports, the last ones, that the step does not read.
                They may stay unconnected.
            arrays: Whether the step wants arrays instead of lists in Drake, too,
                because it calls compiled functions.
        """
        self.declare_ports(sizes=sizes, omit=omit)
        self.step, self.__tick_s = step, tick_s
        self.__as_arrays = arrays or has_arrays(step.state)
        self.__read_ports = [
            port for port in self.__input_ports if port.get_name() not in unread
        ]
        self.__objects = [
            place
            for place, port in enumerate(self.__read_ports)
            if port.get_name() in self.__object_names()
        ]
        sources = {port.ticket() for port in self.__read_ports}
        sources.add(self.time_ticket())
        if has_arrays(step.state):
            # The tick that the state belongs to, the state, and the outputs of the tick
            # before, which hold until the next one begins.
            self.DeclareAbstractState(Value((-1, copied(step.state), None)))
            self.DeclarePeriodicUnrestrictedUpdateEvent(
                period_sec=tick_s, offset_sec=0.0, update=self.__replace_arrays
            )
            sources.add(self.xa_ticket())
            if step.publish is not None:
                # Drake replaces abstract states before the blocks that have a discrete
                # state read their inputs, which must be those of the tick before.
                # Therefore published values are a discrete state, too.
                published = self.__publish(step.state)
                self.__ends = np.cumsum(self.__output_sizes)[:-1]
                self.DeclareDiscreteState(np.concatenate(published))
                self.DeclarePeriodicDiscreteUpdateEvent(
                    period_sec=tick_s, offset_sec=0.0, update=self.__replace_published
                )
        elif len(step.state):
            self.DeclareDiscreteState([self._scalar(x) for x in step.state])
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=tick_s, offset_sec=0.0, update=self.__replace_state
            )
            sources.add(self.xd_ticket())
        self.__computed = declare_cache(self, "step", self.__compute, sources)
        shown = self.__computed
        if step.publish is not None:
            state = {self.xd_ticket()}
            shown = declare_cache(self, "published", self.__published, state)
        index = 0
        for port in self.__outputs:
            if port.size == OBJECT:
                self.__declare_object_output(port.name)
                continue

            def calc(context: Any, output: Any, index: int = index) -> None:
                output.SetFromVector(shown.Eval(context)[0][index])

            self.declare_output(port.name, calc, {shown.ticket()})
            index += 1

    def __declare_object_output(self: Any, name: str) -> None:
        def calc(context: Any, output: Any) -> None:
            output.set_value(getattr(self.__computed.Eval(context)[1], name))

        self.declare_output(name, calc, {self.__computed.ticket()})

    def step_for(self: Any, run: RunFacts) -> Step:
        """What the block computes in each tick of a compiled loop.

        Args:
            run: The run.

        Returns:
            The step, with a state of its own and the noise of the run.

        Raises:
            InputError: The block has no step.
        """
        if not hasattr(self, "step"):
            raise InputError(
                "engine",
                f"{self.get_name()} has no step, which a compiled loop needs; declare "
                "one, or run with engine drake",
            )
        step: Step = self.step
        if isinstance(getattr(step.numbers, "noise", None), TickNoise):
            noise = tick_noise(run.seed_of(self.get_name()))
            step = step._replace(numbers=step.numbers._replace(noise=noise))
        if has_arrays(step.state):
            state = copied(step.state)
            carries = {
                port.name: partial(_field_at, state, port.name)
                for port in self.__outputs
                if port.size == OBJECT
            }
            step = step._replace(state=state, carries=carries)
        return step

    def __object_names(self: Any) -> set[str]:
        return {port.name for port in self.inputs if port.size == OBJECT}

    def __declare_input(self: Any, port: Port) -> Any:
        if port.size == OBJECT:
            return self.DeclareAbstractInputPort(
                name=port.name, model_value=Value(object())
            )
        return self.DeclareVectorInputPort(
            name=port.name, size=port.elements(self.__sizes)
        )

    def __read(self: Any, context: Any) -> list[Any]:
        """One entry per input port; that of an unread port is empty."""
        ports, objects = self.__read_ports, self.__objects
        read = read_arrays if self.__as_arrays else read_lists
        numbers = [port for k, port in enumerate(ports) if k not in objects]
        inputs: list[Any] = read(context, numbers)
        for place in objects:
            inputs.insert(place, ports[place].Eval(context))
        return inputs + [[]] * (len(self.__input_ports) - len(inputs))

    def __blank_outputs(self: Any) -> list[Any]:
        """One entry per output port that carries numbers."""
        if self.__as_arrays:
            return [np.full(n, self._scalar(0.0)) for n in self.__output_sizes]
        return [[self._scalar(0.0)] * count for count in self.__output_sizes]

    def __compute(self: Any, context: Any) -> tuple[Any, Any]:
        """The outputs, and the state of the next tick."""
        step: Step = self.step
        tick = round(float_of(context.get_time()) / self.__tick_s)
        outputs = () if step.publish is not None else self.__blank_outputs()
        state: Any = []
        if has_arrays(step.state):
            done, state, known = context.get_abstract_state(0).get_value()
            # The update of this tick has been done: its outputs hold.
            if done == tick:
                return known, state
            state = copied(state)
        elif len(step.state):
            state = self.__state(context)
        step.step(tick, state, self.__read(context), outputs, step.numbers)
        return outputs, state

    def __publish(self: Any, state: Any) -> list[Any]:
        step: Step = self.step
        assert step.publish is not None
        outputs: list[Any] = self.__blank_outputs()
        step.publish(state, outputs, step.numbers)
        return outputs

    def __published(self: Any, context: Any) -> tuple[Any, None]:
        if has_arrays(self.step.state):
            return np.split(self.__state(context), self.__ends), None
        return self.__publish(self.__state(context)), None

    def __state(self: Any, context: Any) -> Any:
        state = context.get_discrete_state(0).CopyToVector()
        return state if self.__as_arrays else state.tolist()

    def __replace_state(self: Any, context: Any, discrete_state: Any) -> None:
        discrete_state.set_value(0, np.array(self.__computed.Eval(context)[1]))

    def __replace_published(self: Any, context: Any, discrete_state: Any) -> None:
        state = context.get_abstract_state(0).get_value()[1]
        discrete_state.set_value(0, np.concatenate(self.__publish(state)))

    def __replace_arrays(self: Any, context: Any, state: Any) -> None:
        outputs, arrays = self.__computed.Eval(context)
        tick = round(float_of(context.get_time()) / self.__tick_s)
        value = tick, arrays, outputs
        state.get_mutable_abstract_state(0).set_value(value)


class Block(LeafSystem, _Declared):
    """The base of a block. ``Block_[T]`` is that of a template."""

    _scalar = float


class _DifferentiableBlock(LeafSystem_[AutoDiffXd], _Declared):
    _scalar = AutoDiffXd


#: The base of a block's template, by scalar type.
Block_: dict[Any, Any] = {float: Block, AutoDiffXd: _DifferentiableBlock}


def _field_at(state: Any, name: str, _tick: int) -> Any:
    return getattr(state, name)


def part_of(system: Any) -> str:
    """The part of a system; that of a system that states none is ``controller``."""
    return getattr(system, "part", "") or "controller"


def _with_port_table(cls: Any) -> str:
    """The docstring, with a table of the ports after the summary."""
    summary, _, rest = inspect.cleandoc(cls.__doc__ or "").partition("\n\n")
    # The class of a template is local to the function of that name.
    name = cls.__qualname__.partition("_.<locals>")[0].rpartition(".")[2]
    lines = [".. pydrake_system::", "", f"    name: {name}"]
    for heading, ports in (("input_ports", cls.inputs), ("output_ports", cls.outputs)):
        if ports:
            lines.append(f"    {heading}:")
            lines += [f"    - {port.name} [{port.unit}]" for port in ports]
    return "\n\n".join([summary, "\n".join(lines), rest]).rstrip() + "\n"
