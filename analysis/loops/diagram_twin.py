"""The AutoDiffXd twin of a diagram, also if some blocks do not convert to AutoDiffXd.

Such a block is replaced by a block that calls the original. The derivatives of its
outputs and of its state are central differences of the original.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import (
    DiagramBuilder_,
    InputPortIndex,
    LeafSystem_,
    OutputPortIndex,
)

from analysis.loops.autodiff import value_and_gradient
from analysis.loops.diagram_ports import carries_numbers, ports_of
from analysis.loops.diagram_state import get_state, set_state
from systems.framework.differences import STEP
from systems.framework.input_error import InputError
from systems.framework.scalar_math import float_of

#: Numbers that identify a body or sensor. To vary them has no meaning.
_IDENTITY = "feature"


def autodiff_twin(system: Any) -> Any:
    """Converts a Drake system to AutoDiffXd.

    Args:
        system: Diagram or block of floats. Its parameters have their default values.

    Returns:
        A system with the same ports, states and subsystems. The blocks for which
        ``by_differences`` is true have derivatives from differences.

    Raises:
        InputError: A block that does not convert to AutoDiffXd has an abstract state or
            an output port that carries an object, or several periods.
    """
    converted = system.ToAutoDiffXdMaybe()
    if converted is not None:
        return converted
    if not hasattr(system, "GetSystems"):
        return BlockByDifferences(system)
    builder = DiagramBuilder_[AutoDiffXd]()
    twins = {
        part: builder.AddNamedSystem(part.get_name(), autodiff_twin(part))
        for part in system.GetSystems()
    }
    for (to, at), (of, port) in system.connection_map().items():
        builder.Connect(
            twins[of].get_output_port(int(port)), twins[to].get_input_port(int(at))
        )
    for index, own in enumerate(ports_of(system, "input")):
        first, *others = system.GetInputPortLocators(InputPortIndex(index))
        exported = builder.ExportInput(
            twins[first[0]].get_input_port(int(first[1])), own.get_name()
        )
        for part, at in others:
            builder.ConnectInput(exported, twins[part].get_input_port(int(at)))
    for index, own in enumerate(ports_of(system, "output")):
        part, port = system.get_output_port_locator(OutputPortIndex(index))
        builder.ExportOutput(twins[part].get_output_port(int(port)), own.get_name())
    twin = builder.Build()
    twin.set_name(system.get_name())
    return twin


def by_differences(system: Any) -> bool:
    """Whether the derivatives of a block of ``autodiff_twin`` are differences."""
    return isinstance(system, BlockByDifferences)


class BlockByDifferences(LeafSystem_[AutoDiffXd]):
    """AutoDiffXd form of a block that has none, with derivatives from differences.

    Only the elements of state and inputs that carry derivatives are varied. Numbers
    that identify a body or sensor are not varied.
    """

    def __init__(self, block: Any) -> None:
        super().__init__()
        self.set_name(block.get_name())
        self._block, self._own = block, block.CreateDefaultContext()
        _refuse_objects(block, self._own)
        self.states = tuple(getattr(block, "states", ()))
        if hasattr(block, "part"):
            self.part = block.part
        for port in ports_of(block, "input"):
            self.DeclareVectorInputPort(port.get_name(), port.size())
        for index, port in enumerate(ports_of(block, "output")):
            # An output that read all inputs would close an algebraic loop.
            read = [
                own
                for k, own in enumerate(ports_of(self, "input"))
                if block.HasDirectFeedthrough(k, index)
            ]
            self.DeclareVectorOutputPort(
                port.get_name(),
                port.size(),
                self._output(index, read),
                {
                    self.all_state_ticket(),
                    self.time_ticket(),
                    *(own.ticket() for own in read),
                },
            )
        continuous = self._own.num_continuous_states()
        if continuous:
            self.DeclareContinuousState(
                np.array([AutoDiffXd(x) for x in get_state(self._own)[:continuous]])
            )
        groups = self._own.num_discrete_state_groups()
        for k in range(groups):
            values = self._own.get_discrete_state(k).CopyToVector()
            self.DeclareDiscreteState(np.array([AutoDiffXd(x) for x in values]))
        event = block.GetUniquePeriodicDiscreteUpdateAttribute()
        if event is not None:
            self.DeclarePeriodicDiscreteUpdateEvent(
                event.period_sec(), event.offset_sec(), self._update
            )
        elif groups:
            raise InputError(
                block.get_name(),
                "does not convert to AutoDiffXd, and does not update its state with "
                "one period; convert it, or give it one period",
            )

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        """Computes the rates of the continuous state."""
        derivatives.SetFromVector(
            self._evaluate(context, self._rates, ports_of(self, "input"))
        )

    def _output(self, index: int, read: list[Any]) -> Callable[[Any, Any], None]:
        def compute(own: Any) -> NDArray[np.float64]:
            return np.asarray(self._block.get_output_port(index).Eval(own), dtype=float)

        def calc(context: Any, output: Any) -> None:
            output.SetFromVector(self._evaluate(context, compute, read))

        return calc

    def _update(self, context: Any, discrete_state: Any) -> None:
        read, start = ports_of(self, "input"), 0
        found = self._evaluate(context, self._updated, read)
        for k in range(discrete_state.num_groups()):
            group = discrete_state.get_mutable_vector(k)
            group.SetFromVector(found[start : start + group.size()])
            start += group.size()

    def _rates(self, own: Any) -> NDArray[np.float64]:
        rates: NDArray[np.float64] = self._block.EvalTimeDerivatives(own).CopyToVector()
        return rates

    def _updated(self, own: Any) -> NDArray[np.float64]:
        changed = self._block.EvalUniquePeriodicDiscreteUpdate(own)
        groups = range(changed.num_groups())
        return np.concatenate([changed.get_vector(k).CopyToVector() for k in groups])

    def _evaluate(
        self,
        context: Any,
        compute: Callable[[Any], NDArray[np.float64]],
        ports: list[Any],
    ) -> Any:
        """Returns values of the original, which reads these inputs, as AutoDiffXd."""
        state = get_state(context)
        names = [*self.states] if len(self.states) == len(state) else [""] * len(state)
        read = [port for port in ports if port.HasValue(context)]
        for port in read:
            names += [port.get_name()] * port.size()
        given = np.concatenate([state, *(port.Eval(context) for port in read)])
        point, gradient = value_and_gradient(given, 0)
        time_s = float_of(context.get_time())

        def at(vector: NDArray[np.float64]) -> NDArray[np.float64]:
            own, start = self._own, len(state)
            own.SetTime(time_s)
            set_state(own, vector[:start])
            for port in read:
                value = vector[start : start + port.size()]
                self._block.get_input_port(int(port.get_index())).FixValue(own, value)
                start += port.size()
            return np.array(compute(own), dtype=float)

        here = at(point)
        found = np.zeros((len(here), gradient.shape[1]))
        for k in np.flatnonzero(gradient.any(axis=1)):
            if _IDENTITY not in names[k]:
                step = np.zeros(len(point))
                step[k] = STEP * max(1.0, abs(point[k]))
                slope = (at(point + step) - at(point - step)) / (2.0 * step[k])
                found += np.outer(slope, gradient[k])
        pairs: Any = zip(here, found, strict=True)
        return np.array([AutoDiffXd(y, slopes) for y, slopes in pairs], dtype=object)


def _refuse_objects(block: Any, own: Any) -> None:
    """Raises InputError if a block has objects as state, input or output."""
    ports = [*ports_of(block, "input"), *ports_of(block, "output")]
    objects = [p.get_name() for p in ports if not carries_numbers(p)]
    if own.num_abstract_states():
        objects.append("its state")
    if objects:
        raise InputError(
            block.get_name(),
            f"does not convert to AutoDiffXd, and {objects[0]} is an object, which has "
            "no differences; use numbers, or define the block with TemplateSystem",
        )
