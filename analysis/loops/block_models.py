"""Linear model of the closed loop, joined from blocks that are linearized alone.

The joined blocks give the matrix of one control period. AutoDiff through the whole
diagram (``IdealLoop.period_derivatives``) gives the same matrix in another way. Both
ways use the same blocks, but connect, update and integrate them independently.
Therefore, each way checks the other.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import DiscreteTimeApproximation

from analysis.loops.autodiff import seed, value_and_gradient
from analysis.loops.diagram_ports import ports_of
from analysis.loops.diagram_state import set_discrete_state
from analysis.loops.diagram_twin import autodiff_twin
from analysis.loops.ideal_loop import IdealLoop
from analysis.loops.linear_models import LinearModel
from diagrams.running.simulation import simulator_config

#: Suffix of a signal's name if the signal is the value after the control update.
AFTER = "_after"


def sampled_blocks(
    loop: IdealLoop, state: NDArray[np.float64], time_s: float = 0.0
) -> tuple[LinearModel, ...]:
    """Linearizes each block that has inputs, alone, over one control period.

    A control update begins the period. Sampled blocks read the outputs of other blocks
    as they are before the update. Continuous blocks read outputs as they are after the
    update, because these values are held over the period. The model of a block that
    feeds a continuous block therefore has some outputs twice: before and after the
    update. ``state`` (n,) is the state of the loop just before the update.
    """
    after = loop.period_map(state, time_s)
    continuous = [
        role
        for role, block in loop.follower.blocks.items()
        if block.CreateDefaultContext().num_continuous_states()
    ]
    held = {
        port.get_name()
        for role in continuous
        for port in ports_of(loop.block(role), "input")
    }
    models = []
    for role, block in loop.follower.blocks.items():
        if block.num_input_ports() == 0:
            continue
        flows = role in continuous
        model = block_model(
            sampled_twin(loop, role) if flows else loop.block(role, twin=True),
            state[loop.indices(role)],
            # A continuous block reads held signals, as they are after the update.
            _input_values(loop, role, after if flows else state, time_s),
            period_s=loop.tick_s,
            ports=block,
            time_s=time_s,
            held=held,
            read_after=flows,
        )
        names = tuple(loop.state_names[k] for k in loop.indices(role))
        models.append(replace(model, name=role, state_names=names))
    return tuple(models)


def _input_values(
    loop: IdealLoop, role: str, state: NDArray[np.float64], time_s: float
) -> list[NDArray[np.float64]]:
    """Values at the input ports of a block when the diagram is at ``state``."""
    block = loop.block(role)
    own = block.GetMyContextFromRoot(loop.context(state, time_s))
    return [port.Eval(own).copy() for port in ports_of(block, "input")]


def block_model(
    twin: Any,
    state: NDArray[np.float64],
    values: Sequence[NDArray[np.float64]],
    *,
    period_s: float,
    ports: Any = None,
    time_s: float = 0.0,
    held: Collection[str] = (),
    read_after: bool = False,
) -> LinearModel:
    """Linearizes one sampled block over one control period.

    ``twin`` is the block as LeafSystem_[AutoDiffXd]. ``state`` (n,) is its state before
    the control update, and ``values`` are the values at its input ports. The signals of
    the model have the names ``port[element]``. ``ports`` is the block that has the
    names of the ports, by default ``twin``.

    Each output port whose name is in ``held`` is read by a continuous block. The model
    has its signals twice: before the update, and after the update with the suffix
    AFTER. If ``read_after`` is true, this block reads the outputs of other blocks after
    the update, and its inputs have this suffix.
    """
    ports = ports or twin
    count = len(state)
    seeded = seed(np.concatenate([state, *values]))
    context = _context(twin, time_s, seeded[:count])
    start = count
    for port, value in zip(ports_of(twin, "input"), values, strict=True):
        port.FixValue(context, seeded[start : start + len(value)])
        start += len(value)
    outputs = [port.Eval(context) for port in ports_of(twin, "output")]
    names = [name for port in ports_of(ports, "output") for name in _elements(port)]
    updated = np.empty(0)
    if count:
        changed = twin.EvalUniquePeriodicDiscreteUpdate(context)
        groups = range(changed.num_groups())
        updated = np.concatenate([changed.get_vector(k).CopyToVector() for k in groups])
    later = _context(twin, time_s, updated)
    for index, port in enumerate(ports_of(ports, "output")):
        if port.get_name() in held:
            outputs.append(twin.get_output_port(index).Eval(later))
            names += [f"{name}{AFTER}" for name in _elements(port)]
    suffix = AFTER if read_after else ""
    heard = [name for port in ports_of(ports, "input") for name in _elements(port)]
    _, by_all = value_and_gradient(updated, start)
    _, read = value_and_gradient(np.concatenate(outputs), start)
    return LinearModel(
        name=ports.get_name(),
        A=by_all[:, :count],
        B=by_all[:, count:],
        C=read[:, :count],
        D=read[:, count:],
        state_names=tuple(f"{ports.get_name()}.{k}" for k in range(count)),
        input_names=tuple(f"{name}{suffix}" for name in heard),
        output_names=tuple(names),
        period_s=period_s,
    )


def _context(block: Any, time_s: float, state: Any) -> Any:
    context = block.CreateDefaultContext()
    context.SetTime(time_s)
    if len(state):
        set_discrete_state(context, state)
    return context


def sampled_twin(loop: IdealLoop, role: str) -> Any:
    """Returns a continuous block as an AutoDiffXd block in discrete time.

    The time step is the control period.
    """
    if role not in loop.sampled_twins:
        config = simulator_config(loop.scenario)
        sampled = DiscreteTimeApproximation(loop.block(role), loop.tick_s, config)
        loop.sampled_twins[role] = autodiff_twin(sampled)
    return loop.sampled_twins[role]


def _elements(port: Any) -> list[str]:
    return [f"{port.get_name()}[{k}]" for k in range(port.size())]


def join_blocks(
    models: tuple[LinearModel, ...],
    state_names: tuple[str, ...],
    *,
    name: str,
    inputs: tuple[str, ...] = (),
    outputs: tuple[str, ...] = (),
) -> LinearModel:
    """Joins linearized blocks: connects each output to all inputs of the same name.

    All blocks have the same period. The joined model has all their states, in the order
    of ``state_names``. Its inputs are the block inputs with the names ``inputs``. Its
    outputs are the block outputs with the names ``outputs``.
    """
    import control

    heard = [signal for model in models for signal in model.input_names]
    said = [signal for model in models for signal in model.output_names]
    wires = np.zeros((len(heard), len(said)))
    for row, signal in enumerate(heard):
        if signal in said:
            wires[row, said.index(signal)] = 1.0
    feed = np.array([[float(a == b) for b in inputs] for a in heard])
    feed = feed.reshape(len(heard), len(inputs))
    read = np.array([[float(a == b) for b in said] for a in outputs])
    read = read.reshape(len(outputs), len(said))
    apart = control.append(*(model.to_control() for model in models))
    joined = control.feedback(apart, control.ss([], [], [], wires), sign=1)
    states = [state for model in models for state in model.state_names]
    order = [states.index(state) for state in state_names]
    A, B, C, D = (np.asarray(part) for part in control.ssdata(joined))
    return LinearModel(
        name=name,
        A=A[np.ix_(order, order)],
        B=B[order] @ feed,
        C=read @ C[:, order],
        D=read @ D @ feed,
        state_names=state_names,
        input_names=inputs,
        output_names=outputs,
        period_s=models[0].period_s,
    )
