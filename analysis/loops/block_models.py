"""Closed loop joined from blocks that are linearized alone.

The joined blocks give the matrix of one control period. AutoDiff through the whole
diagram gives the same matrix in another way. Both ways use the same blocks. Wiring,
order of updates, and integration of the joined system are independent, so that each way
checks the other.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import DiscreteTimeApproximation

from analysis.loops.autodiff import seed, value_and_gradient
from analysis.loops.diagram_state import set_discrete_state
from analysis.loops.ideal_loop import IdealLoop
from analysis.loops.linear_models import LinearModel
from diagrams.running.simulation import simulator_config

#: Suffix of a signal's name for its value after the control update.
AFTER = "_after"


def sampled_blocks(
    loop: IdealLoop, state: NDArray[np.float64], time_s: float = 0.0
) -> tuple[LinearModel, ...]:
    """Linearizes every block that has inputs, each block alone, over one period.

    At the control update that begins a period, sampled blocks read each other's outputs
    before the update. Continuous blocks read outputs after the update, because these
    are held over the period. A block that feeds a continuous block therefore has some
    outputs twice: before and after the update. ``state`` is the (n,) operating point
    just before the update.
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
        for port in _ports(loop.block(role), "input")
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


def _ports(block: Any, kind: str) -> list[Any]:
    if kind == "input":
        return [block.get_input_port(k) for k in range(block.num_input_ports())]
    return [block.get_output_port(k) for k in range(block.num_output_ports())]


def _input_values(
    loop: IdealLoop, role: str, state: NDArray[np.float64], time_s: float
) -> list[NDArray[np.float64]]:
    """Values at the input ports of a block, in the diagram at a given state."""
    block = loop.block(role)
    own = block.GetMyContextFromRoot(loop.context(state, time_s))
    return [port.Eval(own).copy() for port in _ports(block, "input")]


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
    """Linearizes one sampled block, given as LeafSystem_[AutoDiffXd], over one period.

    Inputs and outputs have the names ``port[element]``, with the names of the ports of
    ``ports``, which is ``twin`` by default. ``state`` (n,) is that just before the
    update, and ``values`` are those at the input ports. Continuous blocks read the
    output ports ``held`` after the update. ``read_after`` says whether this block reads
    its inputs after the update of other blocks.
    """
    ports = ports or twin
    count = len(state)
    seeded = seed(np.concatenate([state, *values]))
    context = _context(twin, time_s, seeded[:count])
    start = count
    for port, value in zip(_ports(twin, "input"), values, strict=True):
        port.FixValue(context, seeded[start : start + len(value)])
        start += len(value)
    outputs = [port.Eval(context) for port in _ports(twin, "output")]
    names = [name for port in _ports(ports, "output") for name in _elements(port)]
    updated = np.empty(0)
    if count:
        changed = twin.EvalUniquePeriodicDiscreteUpdate(context)
        groups = range(changed.num_groups())
        updated = np.concatenate([changed.get_vector(k).CopyToVector() for k in groups])
    later = _context(twin, time_s, updated)
    for index, port in enumerate(_ports(ports, "output")):
        if port.get_name() in held:
            outputs.append(twin.get_output_port(index).Eval(later))
            names += [f"{name}{AFTER}" for name in _elements(port)]
    suffix = AFTER if read_after else ""
    heard = [name for port in _ports(ports, "input") for name in _elements(port)]
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
    """Returns a continuous block as an AutoDiffXd block, discrete over a period."""
    if role not in loop.sampled_twins:
        config = simulator_config(loop.scenario)
        sampled = DiscreteTimeApproximation(loop.block(role), loop.tick_s, config)
        loop.sampled_twins[role] = sampled.ToAutoDiffXd()
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

    The blocks have the same period. The result has all their states in the order of
    ``state_names``. The signals ``inputs`` are fed from outside, and the signals
    ``outputs`` are returned.
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
