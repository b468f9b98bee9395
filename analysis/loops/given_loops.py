"""Loops that users give: models of the ``control`` package, or Drake diagrams."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.loops.diagram_linearization import linearize
from analysis.loops.diagram_ports import find_source
from analysis.loops.linear_models import LinearModel
from analysis.loops.linearized_diagram import LinearizedDiagram
from analysis.loops.loop_margins import loop_margins
from analysis.loops.margin_results import LoopMargins
from analysis.loops.multiloop_disk import MultiloopDiskMargin, multiloop_disk_margin
from analysis.loops.response_margins import (
    delayed_response,
    measured_response,
    response_margins,
)
from systems.framework.input_error import InputError

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


def margins(loop: Any, *, delay_s: float = 0.0, unstable_poles: int = 0) -> LoopMargins:
    """Computes the stability margins of a loop with negative feedback.

    Args:
        loop: Loop transfer function L with one input and one output: a
            ``control.StateSpace`` or ``control.TransferFunction``, continuous or
            sampled; a ``control.FrequencyResponseData``; or the result of ``loop_at``
            or ``linearize``.
        delay_s: Pure delay of the loop in addition to that of ``loop``, s, >= 0. In a
            sampled loop, it is a whole number of periods.
        unstable_poles: Number of growing poles of L. It is needed only for frequency
            responses, which do not tell it.

    Returns:
        Gain, phase, delay, modulus and disk margins, and peaks of S and T. Those of a
        frequency response hold for its interpolation between the given frequencies.

    Raises:
        InputError: ``loop`` is not a model, or has several inputs or outputs.
        InputError: A frequency response has too few points, or does not decide whether
            the closed loop is stable.
        InputError: The delay is negative, or no whole number of periods.
    """
    from control import FrequencyResponseData

    if not 0.0 <= delay_s < math.inf:
        raise InputError("delay_s", f"is {delay_s:g}; give a time of 0 or more, in s")
    if isinstance(loop, FrequencyResponseData):
        given, stable = measured_response(loop, unstable_poles, delay_s)
        return response_margins(given, stable=stable)
    model = as_linear_model(loop)
    if not delay_s:
        return loop_margins(model)
    if model.period_s:
        return loop_margins(delayed_model(model, delay_s))
    given, stable = delayed_response(model, delay_s)
    return response_margins(given, stable=stable)


def delayed_model(model: LinearModel, delay_s: float) -> LinearModel:
    """Adds a delay of whole periods to the output of a sampled model.

    Raises InputError for any other delay.
    """
    periods = delay_s / (model.period_s or 1.0)
    count = round(periods)
    if abs(periods - count) > _WHOLE:
        raise InputError(
            "delay_s",
            f"is {periods:.4g} periods of {model.period_s:g} s; a sampled model has no "
            "motion between two samples: give a multiple of the period, or a diagram "
            "and a port to delay_margin",
        )
    if count == 0:
        return model
    n = len(model.A)
    A: NDArray[np.float64] = np.zeros((n + count, n + count))
    A[:n, :n], A[n, :n] = model.A, model.C[0]
    A[n + 1 :, n:-1] = np.eye(count - 1)
    B = np.zeros((n + count, 1))
    B[:n], B[n] = model.B, model.D[0]
    C = np.zeros((1, n + count))
    C[0, -1] = 1.0
    late = tuple(f"late_{k + 1}" for k in range(count))
    return replace(
        model,
        A=A,
        B=B,
        C=C,
        D=np.zeros((1, 1)),
        state_names=(*model.state_names, *late),
    )


def disk_margin(loop: Any, skew: float = 0.0) -> MultiloopDiskMargin:
    """Computes the disk margin of one loop, or of several loops at the same time.

    Args:
        loop: Loop transfer function L with as many outputs as inputs, of the types of
            ``margins``. The feedback is negative.
        skew: Skew of the disk, -1 to 1. With 0, gain increase and gain reduction count
            alike.

    Returns:
        Largest disk of gain and phase changes in all loops for which stability is
        guaranteed, and the smallest disk with a destabilizing change that was found.

    Raises:
        InputError: ``loop`` is not a model, or is not square.
    """
    if not -1.0 <= skew <= 1.0:
        raise InputError("skew", f"is {skew:g}; give a number from -1 to 1")
    return multiloop_disk_margin(as_linear_model(loop), skew)


def as_linear_model(loop: Any) -> LinearModel:
    """Converts a model of any accepted type."""
    if isinstance(loop, LinearModel):
        return loop
    if isinstance(loop, LinearizedDiagram):
        return loop.model
    import control

    if not isinstance(loop, control.StateSpace | control.TransferFunction):
        raise InputError(
            "loop",
            f"is a {type(loop).__name__}; give a control.StateSpace or "
            "control.TransferFunction, or open a diagram by loop_at(diagram, context, "
            "'block.port')",
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
