"""Defines ``Block``, the base class of all blocks of the block diagrams.

A block declares its ports, its state and its columns in the results table once.
``Block`` creates the following from this declaration:

- the Drake ports, the state and its update;
- the check that all inputs are finite;
- the table of ports in the docstring;
- the columns in the results table of a run;
- the step of the compiled simulation loop.
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

from systems.framework.arguments import with_checked_parameters
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
    """Number of elements, or ``OBJECT`` if the port carries an object. A string such as
    ``sensors`` or ``3 bodies`` is a named size, or a multiple of a named size. The
    block gives the values of the named sizes to ``declare``."""
    unit: str
    """Units of the elements, for example ``m, m, rad``, or the type of the object."""
    columns: str | tuple[str, ...] = ()
    """Names of the elements as columns in the results table of a run. ``range_{}``
    stands for ``range_1``, ``range_2`` and so on. A port without names is not in the
    table."""

    def elements(self, sizes: Mapping[str, int]) -> int:
        """Returns the number of elements of a port that carries numbers.

        ``sizes`` has the values of the named sizes.
        """
        if isinstance(self.size, int):
            return self.size
        factor, _, name = self.size.rpartition(" ")
        return int(factor or 1) * sizes[name]

    def column_names(self, sizes: Mapping[str, int]) -> tuple[str, ...]:
        """Returns one name per element; the tuple is empty if the table omits the port.

        ``sizes`` has the values of the named sizes.
        """
        if isinstance(self.columns, str):
            count = self.elements(sizes)
            return tuple(self.columns.format(k + 1) for k in range(count))
        return self.columns


class Step(NamedTuple):
    """The computation of a block in one control period (tick).

    Drake and the compiled simulation loops use the same computation. The function
    ``step(tick, state, inputs, outputs, numbers)`` does three things:

    - It reads the inputs.
    - It fills the outputs, element by element.
    - It replaces the state by the state of the next tick.

    ``inputs`` and ``outputs`` have one entry per port, in the order of the declaration.
    An entry is the object that the port carries, or a sequence of numbers. The sequence
    is an array in compiled code, and a list of float or AutoDiffXd in Drake. Drake also
    passes arrays if the state is a named tuple, or if ``declare`` was called with
    ``arrays``.
    """

    step: Callable[..., None]
    numbers: Any
    """Constants of the step, in a named tuple. Its fields are numbers, arrays,
    functions, parameters, or tuples of these. A field ``noise`` of the type
    ``TickNoise`` gets a new value in each run, according to the seed of the run."""
    state: Any = ()
    """State at the first tick (control period): a sequence of numbers or a named tuple.
    The fields of the named tuple are arrays or named tuples of arrays. The step changes
    the arrays in place."""
    publish: Callable[..., None] | None = None
    """Function ``publish(state, outputs, numbers)`` that fills the outputs. Only blocks
    whose outputs depend on nothing but the state have this function. Their step does
    not fill the outputs."""
    host: Any = None
    """``HostCall`` of a step that calls Python. This reference keeps the address of the
    function valid during the loop."""
    carries: Mapping[str, Callable[[int], Any]] = {}
    """One function per output port that carries an object, by the name of the port.
    Each function returns the object at a given tick (control period)."""


class RunFacts(NamedTuple):
    """Facts about a run that a step needs in a compiled simulation loop.

    Several runs use the same blocks, but differ in start pose, seed and obstacles.
    Therefore these values replace the values with which a block was constructed.
    """

    ticks: int
    tick_s: float
    initial_pose: tuple[float, float, float]
    """x, y and heading of the robot in the world frame W at the start, m, m and rad."""
    step_s: float
    """Largest step of the integrator, s."""
    seed_of: Callable[[str], int]
    """Function that returns the seed of a block, given the name of the block."""
    carried: Mapping[str, Callable[[int], Any]]
    """One function per input port that carries an object, by the name of the port. Each
    function returns the object at a given tick (control period)."""
    mapped: Any = ()
    """(n, 5) obstacles in the robot's map. The columns are x, y, theta, length and
    width in W, m and rad."""
    goal: tuple[float, float] | None = None
    """Position (x, y) of the robot's goal in W, m. None: the robot has no goal."""


def has_arrays(state: Any) -> bool:
    """Returns whether a state is a named tuple of arrays."""
    return hasattr(state, "_fields")


def copied(state: Any) -> Any:
    """Copies a named tuple of arrays and numbers, including nested named tuples.

    The copy shares no array with ``state``.
    """
    if has_arrays(state):
        return type(state)(*map(copied, state))
    return np.copy(state) if isinstance(state, np.ndarray) else state


class _Declared:
    """The declaration of a block, and the methods that evaluate the declaration.

    Private names start with two underscores. Python then renames them, so that they
    cannot collide with the names of a subclass.
    """

    part: ClassVar[str] = ""
    """The role of the block in its robot, for example ``plant`` or ``tracker``. A block
    replaces any other block with the same role."""
    stage: ClassVar[Stage] = "control"
    """The place of the block in the signal chain."""
    inputs: Sequence[Port] = ()
    """Input ports, in the order of the step."""
    outputs: Sequence[Port] = ()
    """Output ports, in the order of the step. The step fills only ports that carry
    numbers. A port that carries an object publishes the state's field of the same
    name."""
    states: Sequence[str] = ()
    """Names of the elements of the state, continuous elements first."""
    columns: Mapping[str, tuple[str, ...]] = {}
    """Names of the columns in the table of a run, by output port."""
    step: Step

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for name in ("__init__", "_construct"):  # a template has the latter
            if name in vars(cls):
                setattr(cls, name, with_checked_parameters(vars(cls)[name]))
        own = cls.__doc__ or ""
        if (cls.inputs or cls.outputs) and ".. pydrake_system::" not in own:
            cls.__doc__ = _with_port_table(cls)

    def declare_ports(
        self: Any,
        *,
        sizes: Mapping[str, int] | None = None,
        omit: Collection[str] = (),
    ) -> list[Any]:
        """Declares the input ports and the columns of a block without a ``Step``.

        Afterwards, the block must declare its output ports with ``declare_output``.

        Args:
            sizes: Values of the named sizes in the declarations of the ports.
            omit: Names of ports that this block does not have.

        Returns:
            The Drake input ports.
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
            name: Name of the port in ``outputs``.
            calc: Function ``calc(context, output)`` that sets the output.
            prerequisites: Dependency tickets of all values that ``calc`` reads.

        Returns:
            The Drake output port.
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
        """Declares the ports, the state, the update and the outputs of a block.

        A cache entry stores the result of the step, so that Drake computes the step
        only once for all output ports. If the step has the function ``publish``, a
        second cache entry stores the outputs. The second entry depends only on the
        state. Therefore the outputs have no direct feedthrough.

        The initial state of the step determines the kind of the Drake state:

        - a sequence of numbers: a discrete state;
        - a named tuple of arrays: an abstract state;
        - an empty sequence: no Drake state.

        Args:
            step: The computation of the block in one control period.
            tick_s: Period of the update, s.
            sizes: Values of the named sizes in the declarations of the ports.
            omit: Names of ports that this block does not have.
            unread: Names of input ports that the step does not read. They must be the
                last input ports, and may stay unconnected.
            arrays: Whether Drake passes arrays instead of lists to the step. A step
                that calls compiled functions needs arrays.
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
            # The abstract value holds the tick of the last update, the state after
            # this update, and the outputs of this tick. The outputs remain valid until
            # the next tick begins.
            self.DeclareAbstractState(Value((-1, copied(step.state), None)))
            self.DeclarePeriodicUnrestrictedUpdateEvent(
                period_sec=tick_s, offset_sec=0.0, update=self.__replace_arrays
            )
            sources.add(self.xa_ticket())
            if step.publish is not None:
                # Drake replaces abstract states before blocks with a discrete state
                # read their inputs. These inputs must be those of the previous tick.
                # Therefore published values are a discrete state, too.
                published = self.__publish(step.state)
                self.__ends = np.cumsum(self.__output_sizes)[:-1]
                self.DeclareDiscreteState(np.concatenate(published))
                self.DeclarePeriodicDiscreteUpdateEvent(
                    period_sec=tick_s, offset_sec=0.0, update=self.__replace_published
                )
        elif len(step.state) or step.publish is not None:
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
        """Returns the step of the block for one run of a compiled simulation loop.

        Args:
            run: Facts about the run.

        Returns:
            The step, with its own copy of the state, and with noise from the seed of
            the run.

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
        """Returns one entry per input port. The entry of an unread port is empty."""
        ports, objects = self.__read_ports, self.__objects
        read = read_arrays if self.__as_arrays else read_lists
        numbers = [port for k, port in enumerate(ports) if k not in objects]
        inputs: list[Any] = read(context, numbers)
        for place in objects:
            inputs.insert(place, ports[place].Eval(context))
        return inputs + [[]] * (len(self.__input_ports) - len(inputs))

    def __blank_outputs(self: Any) -> list[Any]:
        """Returns one entry per output port that carries numbers."""
        if self.__as_arrays:
            return [np.full(n, self._scalar(0.0)) for n in self.__output_sizes]
        return [[self._scalar(0.0)] * count for count in self.__output_sizes]

    def __compute(self: Any, context: Any) -> tuple[Any, Any]:
        """Returns the outputs, and the state of the next tick."""
        step: Step = self.step
        tick = round(float_of(context.get_time()) / self.__tick_s)
        outputs = () if step.publish is not None else self.__blank_outputs()
        state: Any = []
        if has_arrays(step.state):
            done, state, known = context.get_abstract_state(0).get_value()
            # The update of this tick is complete, so its outputs are still valid.
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
    """The base class of a block. ``Block_[T]`` is the base class for a scalar type."""

    _scalar = float


class _DifferentiableBlock(LeafSystem_[AutoDiffXd], _Declared):
    _scalar = AutoDiffXd


#: Base class of a block that is a template, by scalar type.
Block_: dict[Any, Any] = {float: Block, AutoDiffXd: _DifferentiableBlock}


def period_of(block: Any) -> float | None:
    """Returns the period of a block's step, s; None for any other Drake system."""
    return getattr(block, "_Declared__tick_s", None)


def _field_at(state: Any, name: str, _tick: int) -> Any:
    return getattr(state, name)


def part_of(system: Any) -> str:
    """Returns the part of a system. The default is ``controller``."""
    return getattr(system, "part", "") or "controller"


def _with_port_table(cls: Any) -> str:
    """Returns the docstring with a table of the ports after the summary."""
    summary, _, rest = inspect.cleandoc(cls.__doc__ or "").partition("\n\n")
    # The class of a template is local to a function that has the name of the class.
    name = cls.__qualname__.partition("_.<locals>")[0].rpartition(".")[2]
    lines = [".. pydrake_system::", "", f"    name: {name}"]
    for heading, ports in (("input_ports", cls.inputs), ("output_ports", cls.outputs)):
        if ports:
            lines.append(f"    {heading}:")
            lines += [f"    - {port.name} [{port.unit}]" for port in ports]
    return "\n\n".join([summary, "\n".join(lines), rest]).rstrip() + "\n"
