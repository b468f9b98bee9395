"""Loops that users give: models of the ``control`` package, or Drake diagrams."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.diagram_linearization import linearize
from analysis.loops.diagram_ports import find_source
from analysis.loops.linear_models import LinearModel
from analysis.loops.linearized_diagram import LinearizedDiagram
from analysis.loops.loop_margins import LoopMargins, loop_margins
from analysis.loops.multiloop_disk import MultiloopDiskMargin, multiloop_disk_margin
from systems.framework.input_error import InputError

#: Largest relative difference between equal matrices.
_SAME = 1e-6
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
            return replace(model, name=f"loop at {name}", C=-model.C, D=-model.D)
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


def margins(loop: Any) -> LoopMargins:
    """Computes the stability margins of a loop with negative feedback.

    Args:
        loop: Loop transfer function L with one input and one output: a
            ``control.StateSpace`` or ``control.TransferFunction``, continuous or
            sampled, or the result of ``loop_at`` or ``linearize``.

    Returns:
        Gain, phase, delay, modulus and disk margins, and peaks of S and T.

    Raises:
        InputError: ``loop`` is not a model, or has several inputs or outputs.
    """
    return loop_margins(as_linear_model(loop))


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
