"""Loops that users give: models of the ``control`` package, or Drake diagrams.

All functions for loops of users accept the same types, see ``Loop``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import System

from analysis.loops.diagram_linearization import linearize
from analysis.loops.diagram_ports import find_source
from analysis.loops.linear_models import LinearModel
from analysis.loops.linearized_diagram import LinearizedDiagram
from analysis.loops.response_margins import response_period
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    import control

#: Loop of a user: a linear model, a frequency response, or a Drake diagram, which is
#: opened at a port.
Loop: TypeAlias = (
    "LinearModel | LinearizedDiagram | control.StateSpace | control.TransferFunction"
    " | control.FrequencyResponseData | System"
)

#: Largest relative difference between equal matrices.
_SAME = 1e-6
#: Largest distance of a number of periods from a whole number.
_WHOLE = 1e-6
#: Condition number above which a loop has no unique signals.
_SINGULAR = 1e12


def loop_at(diagram: Any, context: Any, port: Any) -> LinearModel:
    """Opens a loop of a Drake diagram at one input port, and linearizes it.

    The input of the model replaces the signal that the port receives. The output is
    the signal that would return to the port, with its sign changed. The model is
    therefore the loop transfer function L of a loop with negative feedback, as the
    margins expect it.

    In a sampled loop, the signal at the port must be constant between the periods of
    the model, because L describes one value per period. The function checks this: it
    closes L again, and compares the result with the linear model of the closed diagram.

    Args:
        diagram: A Drake ``Diagram``. It is not changed.
        context: Its root context, at the operating point. None: the default context.
        port: Input port inside the diagram: a name ``block.port``, or the port itself.

    Returns:
        Loop transfer function. It has one input and one output per element of the port.

    Raises:
        InputError: The port is not known, is not a vector, or is not connected to an
            output port of the diagram.
        InputError: The signal at the port changes within the period of the diagram.
    """
    return opened_loop(diagram, context, port).model


class OpenedLoop(NamedTuple):
    """Loop of a diagram that is opened at one input port."""

    model: LinearModel
    """Loop transfer function for negative feedback."""
    source: Any
    """Output port that feeds the input port."""
    read_after: bool
    """Whether the port receives the signal as it is after the updates that begin a
    period, as a continuous block does, and not before, as a sampled block does."""


def opened_loop(diagram: Any, context: Any, port: Any) -> OpenedLoop:
    """Opens a loop as ``loop_at`` does, and states how the port receives the signal."""
    if port is None:
        raise InputError(
            "port",
            "is missing; name the input port at which to open the loop: "
            "port='block.port'",
        )
    source = find_source(diagram, port)
    closed = linearize(diagram, context, inputs=(), outputs=()).model
    # A continuous block receives the signal as it is after the updates, and a sampled
    # block as it is before.
    for read_after in (False, True):
        model = linearize(
            diagram, context, inputs=[port], outputs=[source], read_after=read_after
        ).model
        if _closes_to(model, closed):
            name = port if isinstance(port, str) else port.get_name()
            loop = replace(model, name=f"loop at {name}", C=-model.C, D=-model.D)
            return OpenedLoop(loop, source, read_after)
    raise InputError(
        "port",
        f"the signal at {port!r} changes within {model.period_s:g} s, the period of "
        "the diagram, so that no single transfer function describes it; choose an "
        "input that a sampled block with this period feeds",
    )


def _closes_to(model: LinearModel, closed: LinearModel) -> bool:
    """Whether the model of the open loop becomes that of the closed loop."""
    back = np.eye(len(model.D)) - model.D
    if np.linalg.cond(back) > _SINGULAR:
        return False
    A = model.A + model.B @ np.linalg.solve(back, model.C)
    return bool(np.abs(A - closed.A).max(initial=0.0) <= _SAME * _size(closed.A))


def _size(matrix: NDArray[np.float64]) -> float:
    return max(1.0, float(np.abs(matrix).max(initial=0.0)))


def as_linear_model(loop: Loop, context: Any = None, port: Any = None) -> LinearModel:
    """Converts a loop of any type that has states; the arguments are those of users.

    Raises InputError for a frequency response and for other types.
    """
    refuse_place_without_diagram(loop, context, port)
    if isinstance(loop, LinearModel):
        return loop
    if isinstance(loop, LinearizedDiagram):
        return loop.model
    if isinstance(loop, System):
        return opened_loop(loop, context, port).model
    import control

    if is_response(loop):
        raise InputError(
            "loop",
            "is a frequency response, which has no states; give a model, for example "
            "a fit: control.StateSpace or control.TransferFunction",
        )
    if not isinstance(loop, control.StateSpace | control.TransferFunction):
        raise InputError(
            "loop",
            f"is a {type(loop).__name__}; give a control.StateSpace, "
            "control.TransferFunction or control.FrequencyResponseData, or a Drake "
            "diagram with port='block.port'",
        )
    if loop.dt is True:
        raise InputError(
            "loop", "is sampled with an unknown period (dt=True); state dt in s"
        )
    system = control.ss(loop)
    return LinearModel(
        name=system.name,
        A=system.A,
        B=system.B,
        C=system.C,
        D=system.D,
        state_names=tuple(system.state_labels),
        input_names=tuple(system.input_labels),
        output_names=tuple(system.output_labels),
        period_s=system.dt or None,
    )


def is_response(loop: Loop) -> TypeGuard[Any]:
    """Whether a loop is a ``control.FrequencyResponseData``."""
    from control import FrequencyResponseData

    return isinstance(loop, FrequencyResponseData)


def refuse_place_without_diagram(loop: Loop, context: Any, port: Any) -> None:
    """Raises InputError if a context or port is given without a Drake diagram."""
    for name, value in (("context", context), ("port", port)):
        if value is not None and not isinstance(loop, System):
            raise InputError(
                name,
                f"is {value!r}, but the loop is a {type(loop).__name__}; give {name} "
                "only with a Drake diagram, and other options by name",
            )


def delayed_model(model: LinearModel, delay_s: float) -> LinearModel:
    """Adds a delay of whole periods to all outputs of a sampled model.

    Raises InputError for any other delay.
    """
    count = whole_periods(delay_s, model.period_s or 1.0)
    if count == 0:
        return model
    n, width = len(model.A), len(model.C)
    more = count * width
    A: NDArray[np.float64] = np.zeros((n + more, n + more))
    A[:n, :n], A[n : n + width, :n] = model.A, model.C
    A[n + width :, n : n + more - width] = np.eye(more - width)
    B = np.zeros((n + more, model.B.shape[1]))
    B[:n], B[n : n + width] = model.B, model.D
    C = np.zeros((width, n + more))
    C[:, n + more - width :] = np.eye(width)
    late = tuple(f"late_{k + 1}" for k in range(more))
    return replace(
        model,
        A=A,
        B=B,
        C=C,
        D=np.zeros_like(model.D),
        state_names=(*model.state_names, *late),
    )


def check_delay(loop: Loop, delay_s: float) -> None:
    """Raises InputError for a delay that is negative or no whole number of periods."""
    if not 0.0 <= delay_s < math.inf:
        raise InputError("delay_s", f"is {delay_s:g}; give a time of 0 or more, in s")
    if is_response(loop) and (period := response_period(loop)):
        whole_periods(delay_s, period)


def whole_periods(delay_s: float, period_s: float) -> int:
    """Number of periods of a delay; InputError if it is not a whole number."""
    periods = delay_s / period_s
    count = round(periods)
    if abs(periods - count) > _WHOLE:
        raise InputError(
            "delay_s",
            f"is {periods:.4g} periods of {period_s:g} s; a sampled loop has no "
            "motion between two samples: give a multiple of the period, or a diagram "
            "and a port to delay_margin",
        )
    return count
