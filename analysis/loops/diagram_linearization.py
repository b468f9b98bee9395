"""Linear models of any Drake diagram, with continuous and sampled states.

Drake's ``Linearize`` refuses diagrams that have both. Here, the diagram is simulated
over one period, after which all its updates repeat. The derivative of this map is the
sampled model. It is computed twice: with AutoDiffXd through Drake's simulator, and with
central differences of the simulated states.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydrake.systems.framework import System

from analysis.loops.diagram_map import DiagramMap
from analysis.loops.diagram_ports import find_signals
from analysis.loops.diagram_timing import block_timings, common_period
from analysis.loops.linearized_diagram import LinearizedDiagram
from systems.framework.input_error import InputError


def linearize(
    diagram: Any,
    context: Any = None,
    *,
    inputs: Sequence[Any] | None = None,
    outputs: Sequence[Any] | None = None,
    period_s: float | None = None,
    read_after: bool = False,
    differences_only: bool = False,
) -> LinearizedDiagram:
    """Linearizes any Drake system: continuous, sampled at several rates, or both.

    The state is the one just before the updates at the time of the context. With
    discrete states, the model maps this state, and inputs that are held over one
    period, to the state one period later. The period is the least common multiple of
    all update periods. Without discrete states, the model is the derivative of the time
    derivatives.

    Args:
        diagram: A Drake ``Diagram`` or ``LeafSystem``. It is not changed.
        context: Its root context, with values at all input ports that are used. None:
            the default context.
        inputs: Inputs of the model: names of input ports of the diagram, or names
            ``block.port`` of input ports inside it, or the ports themselves. An input
            inside the diagram is cut off from its source. This opens loops. None: all
            vector input ports of the diagram.
        outputs: Outputs of the model, named in the same way. None: all vector output
            ports of the diagram.
        period_s: Period of the whole diagram, s. It is needed only for blocks whose
            period Drake does not tell, because they have several.
        read_after: Whether to read the outputs just after the updates that begin the
            period, instead of just before.
        differences_only: Whether to use differences even if all blocks convert to
            AutoDiffXd.

    Returns:
        The model, its accuracy, and a list of what it does not describe.

    Raises:
        InputError: A port is not known or not a vector, an input that is used has no
            value, an update begins later than one period after the context, or the
            diagram has no linear model, because a value is not finite.
    """
    if not isinstance(diagram, System):
        raise InputError(
            "diagram",
            f"is {diagram!r}, not a Drake system; for a scenario, use "
            "phonotaxis.stability('default').state_space()",
        )
    if context is None:
        context = diagram.CreateDefaultContext()
    try:
        diagram.ValidateContext(context)
    except RuntimeError:
        raise InputError(
            "context",
            "belongs to another system; make it with diagram.CreateDefaultContext()",
        ) from None
    sources = find_signals(diagram, inputs, "input")
    sinks = find_signals(diagram, outputs, "output")
    timings, unknown = [], []
    for block in block_timings(diagram):
        if block.timing is None:
            unknown.append(block.path)
        else:
            timings.append(block.timing)
    if unknown and period_s is None:
        raise InputError(
            "diagram",
            f"block {unknown[0]!r} has a discrete state, but no single update period; "
            "state period_s, after which all updates repeat",
        )
    period = period_s or (common_period(timings) if timings else None)
    mapped = DiagramMap(
        diagram, context, sources, sinks, timings, period, read_after=read_after
    )
    try:
        return mapped.linearized(differences_only=differences_only)
    except RuntimeError as error:  # of Drake, for example an input without a value
        raise InputError(
            "context", f"Drake cannot compute the diagram here: {error}"
        ) from error
