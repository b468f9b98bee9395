"""The map of a Drake diagram over one period, and its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    InitializeParams,
    Simulator_,
    SimulatorConfig,
)

from analysis.loops.autodiff import seed, value_and_gradient
from analysis.loops.diagram_ports import Signal
from analysis.loops.diagram_state import get_state, set_state
from analysis.loops.diagram_timing import Timing, first_update, leaf_systems
from analysis.loops.linear_models import LinearModel
from analysis.loops.linearized_diagram import LinearizedDiagram, Undifferentiated
from systems.framework.differences import slopes_at
from systems.framework.input_error import InputError

#: Relative change of the Jacobian below which an integration step is short enough.
_CONVERGED = 1e-9
#: Largest number of integration steps between two updates.
_MOST_STEPS = 4096
#: Step of the differences, as a share of the larger of 1 and the value.
_STEP = 2e-5
#: A difference of the two one-sided slopes above this share of the larger of 1 and the
#: slope is a switch. For smooth functions, it is about the step.
_KINK = 1e-2


class DiagramMap:
    """The map that is linearized: from state and inputs to next state and outputs."""

    def __init__(
        self,
        diagram: Any,
        context: Any,
        sources: Sequence[Signal],
        sinks: Sequence[Signal],
        timings: Sequence[Timing],
        period_s: float | None,
        *,
        read_after: bool = False,
        older_for_s: float | None = None,
    ) -> None:
        self.read_after, self.older_for_s = read_after, older_for_s
        self.diagram, self.context, self.period_s = diagram, context, period_s
        self.sources, self.sinks = sources, sinks
        self.state = get_state(context)
        self.values = [signal.value(diagram, context) for signal in sources]
        time = float(context.get_time())
        late = [t for t in timings if period_s and t.offset_s >= time + period_s]
        if late:
            raise InputError(
                "context",
                f"is at {time:g} s, but an update begins at {late[0].offset_s:g} s; "
                f"set the time to {late[0].offset_s:g} s or later",
            )
        self.start_s = first_update(timings, time)
        self.end_s = first_update(timings, time + period_s) if period_s else time
        self.steps = 1

    @property
    def point(self) -> NDArray[np.float64]:
        """(n + m,) state, followed by the inputs; with ``older_for_s``, twice."""
        values = self.values if self.older_for_s is None else self.values * 2
        return np.concatenate([self.state, *values])

    def linearized(self, *, differences_only: bool) -> LinearizedDiagram:
        """Computes the model in both ways, if possible."""
        twin = None if differences_only else self.diagram.ToAutoDiffXdMaybe()
        plain = self._simulator(self.diagram, float)
        if twin is not None:
            smooth = self._simulator(twin, AutoDiffXd)
            values, jacobian = self._converged(lambda: self._by_autodiff(smooth))
            method = "AutoDiffXd"
            checked, _, kinks = self._by_differences(plain)
            difference = float(np.abs(jacobian - checked).max(initial=0.0))
        else:
            values, _ = self._converged(
                lambda: (self._map(plain, self.point), np.empty(0))
            )
            jacobian, difference, kinks = self._by_differences(plain)
            method = "differences"
        if not (np.isfinite(jacobian).all() and np.isfinite(values).all()):
            row, column = np.argwhere(~np.isfinite(jacobian))[0]
            raise InputError(
                "diagram",
                f"has no linear model: the derivative of {self._rows()[row]} by "
                f"{self._columns()[column]} is not finite; choose another context",
            )
        count = len(self.state)
        drift = values[:count] - (self.state if self.period_s else 0.0)
        model = LinearModel(
            name=self.diagram.get_name() or "diagram",
            A=jacobian[:count, :count],
            B=jacobian[:count, count:],
            C=jacobian[count:, :count],
            D=jacobian[count:, count:],
            state_names=self._states(),
            input_names=tuple(self._columns()[count:]),
            output_names=tuple(self._rows()[count:]),
            period_s=self.period_s,
        )
        left_out = (*self._switches(kinks), *self._opaque(converted=twin is not None))
        return LinearizedDiagram(model, method, difference, drift, left_out)

    def _map(self, simulator: Any, point: Any) -> Any:
        """Returns the next state and the outputs; ``point`` may be AutoDiffXd."""
        system, context = simulator.get_system(), simulator.get_mutable_context()
        count = len(self.state)
        later = self._fix(system, context, point, count)
        context.SetTime(self.start_s)
        set_state(context, point[:count])
        if self.period_s is None:
            outputs = [signal.eval(system, context) for signal in self.sinks]
            after = system.EvalTimeDerivatives(context).CopyToVector()
            return np.concatenate([after, *outputs])
        simulator.get_mutable_integrator().set_maximum_step_size(
            self.period_s / self.steps
        )
        quiet = InitializeParams()
        quiet.suppress_initialization_events = True
        simulator.Initialize(quiet)
        if self.read_after:
            simulator.AdvancePendingEvents()
        outputs = [signal.eval(system, context) for signal in self.sinks]
        if self.older_for_s is not None:
            simulator.AdvanceTo(self.start_s + self.older_for_s)
            self._fix(system, context, point, later)
        simulator.AdvanceTo(self.end_s)
        return np.concatenate([get_state(context), *outputs])

    def _fix(self, system: Any, context: Any, point: Any, start: int) -> int:
        """Sets the inputs to the elements of ``point`` from ``start`` on.

        Returns the index after these elements.
        """
        for signal, value in zip(self.sources, self.values, strict=True):
            signal.fix(system, context, point[start : start + len(value)])
            start += len(value)
        return start

    def _simulator(self, system: Any, scalar: type) -> Any:
        """Prepares a simulation of the diagram, or of its AutoDiffXd twin."""
        context = system.CreateDefaultContext()
        context.SetTimeStateAndParametersFrom(self.context)
        system.FixInputPortsFrom(self.diagram, self.context, context)
        simulator = Simulator_[scalar](system, context)
        config = SimulatorConfig(
            integration_scheme="runge_kutta5",
            max_step_size=self.period_s or 1.0,
            use_error_control=False,
        )
        ApplySimulatorConfig(config, simulator)
        return simulator

    def _by_autodiff(self, simulator: Any) -> tuple[Any, Any]:
        point = seed(self.point)
        return value_and_gradient(self._map(simulator, point), len(point))

    def _converged(self, compute: Callable[[], tuple[Any, Any]]) -> tuple[Any, Any]:
        """Halves the integration step until the result does not change."""
        found = compute()
        if self.period_s is None or not self.context.num_continuous_states():
            return found
        while self.steps < _MOST_STEPS:
            self.steps *= 2
            before, found = found, compute()
            pairs = [
                (a, b) for a, b in zip(before, found, strict=True) if a is not None
            ]
            if all(
                np.abs(a - b).max(initial=0.0)
                <= _CONVERGED * max(1.0, np.abs(b).max(initial=0.0))
                for a, b in pairs
            ):
                break
        return found

    def _by_differences(self, simulator: Any) -> tuple[Any, float, Any]:
        """Returns the Jacobian, its estimated error, and the kinks of its elements."""
        point = self.point
        here = self._map(simulator, point)
        near, far, kinks = np.zeros((3, len(here), len(point)))
        for k in range(len(point)):
            found = slopes_at(
                lambda moved: self._map(simulator, moved), point, here, k, _STEP
            )
            near[:, k], far[:, k] = found.near, found.far
            kinks[:, k] = np.abs(found.ahead - found.behind)
        # The error of a central difference grows with the square of the step.
        jacobian = near + (near - far) / 3.0
        scale = np.maximum(1.0, np.abs(jacobian))
        error = float(np.abs(near - far).max(initial=0.0)) / 3.0
        return jacobian, error, kinks / scale

    def _switches(self, kinks: Any) -> list[Undifferentiated]:
        rows, columns = self._rows(), self._columns()
        found = []
        for row in np.flatnonzero((kinks > _KINK).any(axis=1)):
            column = int(kinks[row].argmax())
            found.append(
                Undifferentiated(
                    rows[row],
                    f"switches: its slopes for more and for less {columns[column]} "
                    f"differ by {kinks[row, column]:.3g}; the model has one slope",
                )
            )
        return found

    def _opaque(self, *, converted: bool) -> list[Undifferentiated]:
        found = []
        for path, leaf in leaf_systems(self.diagram):
            if leaf.CreateDefaultContext().num_abstract_states():
                found.append(
                    Undifferentiated(path, "has an abstract state, which is not varied")
                )
            if not converted and leaf.ToAutoDiffXdMaybe() is None:
                found.append(
                    Undifferentiated(
                        path,
                        "does not convert to AutoDiffXd; its slopes are differences",
                    )
                )
        return found

    def _states(self) -> tuple[str, ...]:
        continuous: list[str] = []
        discrete: list[str] = []
        for path, leaf in leaf_systems(self.diagram):
            own = leaf.CreateDefaultContext()
            first = own.num_continuous_states()
            count = len(get_state(own))
            names = tuple(getattr(leaf, "states", ()))
            if len(names) != count:
                names = (
                    *(f"x[{k}]" for k in range(first)),
                    *(f"d[{k}]" for k in range(count - first)),
                )
            continuous += [f"{path}.{name}" for name in names[:first]]
            discrete += [f"{path}.{name}" for name in names[first:]]
        return (*continuous, *discrete)

    def _columns(self) -> list[str]:
        inputs = _elements(self.sources)
        if self.older_for_s is None:
            return [*self._states(), *inputs]
        older = [f"{name}_older" for name in inputs]
        return [*self._states(), *older, *inputs]

    def _rows(self) -> list[str]:
        return [*self._states(), *_elements(self.sinks)]


def _elements(signals: Sequence[Signal]) -> list[str]:
    return [name for signal in signals for name in signal.elements]
