"""Compares the derivatives of a block with finite differences."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd

from analysis.loops.diagram_ports import carries_numbers, ports_of
from diagrams.scenario.suggestions import did_you_mean
from phonotaxis.testing.bench import Bench
from systems.framework.differences import EPSILON, STEP, Slopes, slopes_at
from systems.framework.finite import block_name
from systems.framework.input_error import InputError

# Factor between the estimated error of a difference and the tolerance.
_SAFETY = 10.0
# Largest relative tolerance. A larger error shows that the block is not smooth.
_COARSEST = 1e-3


def assert_linearization(
    block: Any,
    /,
    *,
    time_s: float = 0.0,
    state: Any = None,
    outputs: Iterable[str] | None = None,
    hold: Collection[str] = (),
    model: Any = None,
    step: float = STEP,
    tolerance: float | None = None,
    **inputs: Any,
) -> None:
    """Asserts that the derivatives of a block agree with central finite differences.

    The function compares the derivatives of all outputs, of the time derivatives of the
    continuous state and of the next discrete state, with respect to all given inputs
    and to the state. The derivatives come from Drake's automatic differentiation
    (AutoDiffXd) or from a linear model. It also compares the values of the AutoDiffXd
    block with those of the block.

    The tolerance of each derivative follows from the step: it is ten times the
    estimated error of the difference. The estimate is the change of the difference if
    the step is doubled, plus the rounding error of the values.

    Args:
        block: A block or a diagram that converts to AutoDiffXd; with ``model``, any
            Drake system.
        time_s: Time, s.
        state: State, see ``evaluate``. None: the initial state.
        outputs: Names of the output ports to compare. None: all that carry numbers.
        hold: Inputs and states that are not varied, for example because they are flags:
            ``features`` for a whole port, ``features[0]`` for an element, ``state`` for
            the whole state, and ``state[0]`` or the name of the state for an element.
        model: Linear model with the matrices ``A``, ``B``, ``C`` and ``D``, for example
            a ``control.StateSpace``. Its states are those of the block, continuous
            states first. Its inputs are the given inputs, in the order of the keywords.
            Its outputs are the compared outputs. None: automatic differentiation.
        step: Step of the differences, relative to the size of the varied number, and
            absolute for numbers below 1.
        tolerance: Tolerance relative to the size of the derivative, and absolute for
            derivatives below 1. None: from the step.
        **inputs: Values of the input ports by name.

    Raises:
        AssertionError: A derivative differs, or the block is not smooth at this point.
            The message names the output, the input and both numbers.
        InputError: The block does not convert to AutoDiffXd, the shape of the model
            does not fit, or see ``evaluate``.
    """
    numbers = [p.get_name() for p in ports_of(block, "output") if carries_numbers(p)]
    bench = Bench(block, time_s=time_s, state=state, **inputs)
    point = _Point(
        bench,
        bench.state if isinstance(bench.state, np.ndarray) else np.empty(0),
        {name: np.atleast_1d(np.asarray(v, float)) for name, v in inputs.items()},
        [*outputs] if outputs is not None else numbers,
    )
    varied = point.varied(hold)
    if model is None:
        source, derivatives = "automatic differentiation", _automatic(point, varied)
    else:
        source, derivatives = "the linear model", _matrix(point, model)[:, varied]
    labels = [point.labels()[k] for k in varied]
    for column, k in enumerate(varied):
        difference = _Difference.at(point, k, step)
        allowed = difference.tolerance(tolerance)
        wrong = ~(np.abs(derivatives[:, column] - difference.central) <= allowed)
        rough = difference.is_rough() & (tolerance is None)
        for row in np.flatnonzero(wrong | rough):
            what = f"d {point.response_labels()[row]} / d {labels[column]}"
            raise AssertionError(
                f"{block_name(block)}: {what} is {derivatives[row, column]:.9g} by "
                f"{source}, and {difference.central[row]:.9g} by central differences "
                f"(step {difference.step:.2g}, tolerance {allowed[row]:.2g})"
                f"{difference.remark(int(row))}"
            )


@dataclass(frozen=True)
class _Point:
    """A block at an operating point, as a function of a vector of numbers.

    The vector has the state of the block, and then its inputs.
    """

    bench: Bench
    state: NDArray[np.float64]
    """State of numbers; empty if the state is a named tuple."""
    inputs: dict[str, NDArray[np.float64]]
    outputs: list[str]

    @cached_property
    def vector(self) -> NDArray[np.float64]:
        """The state, followed by the inputs."""
        return np.concatenate([self.state, *self.inputs.values()])

    @cached_property
    def here(self) -> NDArray[np.float64]:
        """The response of the block at the operating point."""
        found: NDArray[np.float64] = self.respond(self.bench, self.vector)
        return found

    def labels(self) -> list[str]:
        """Returns the names of the elements of the vector."""
        return self._state_labels() + [
            f"{name}[{k}]"
            for name, values in self.inputs.items()
            for k in range(len(values))
        ]

    def _state_labels(self) -> list[str]:
        count = len(self.state)
        names = tuple(getattr(self.bench.block, "states", ()))
        return (
            [*names] if len(names) == count else [f"state[{k}]" for k in range(count)]
        )

    def varied(self, hold: Collection[str]) -> list[int]:
        """Returns the indices of the elements that are not held."""
        count = len(self.state)
        aliases = [{f"state[{k}]", "state"} for k in range(count)] + [
            {name} for name, values in self.inputs.items() for _ in values
        ]
        for label, names in zip(self.labels(), aliases, strict=True):
            names.add(label)
        held = {hold} if isinstance(hold, str) else set(hold)
        known = set().union(*aliases)
        for name in sorted(held - known):
            raise InputError(
                "hold",
                f"{name!r} is no given input and no state of "
                f"{block_name(self.bench.block)}{did_you_mean(name, known)}",
            )
        return [k for k, names in enumerate(aliases) if not names & held]

    def response_labels(self) -> list[str]:
        """Returns the names of the elements of the response."""
        states, found = self._state_labels(), list[str]()
        context = self.bench.context
        continuous = context.num_continuous_states()
        found += [f"rate of {name}" for name in states[:continuous]]
        found += [f"next {name}" for name in states[continuous:]]
        for name in self.outputs:
            size = self.bench.block.GetOutputPort(name).size()
            found += [f"{name}[{k}]" for k in range(size)]
        return found

    def respond(self, bench: Bench, vector: Any) -> Any:
        """Evaluates the rates, the next state and the outputs at a vector."""
        count = len(self.state)
        if count:
            bench.state = vector[:count]
        begin = count
        for name, values in self.inputs.items():
            bench.set(**{name: vector[begin : begin + len(values)]})
            begin += len(values)
        found = [bench.output(name) for name in self.outputs]
        if count and bench.context.num_discrete_state_groups():
            found.insert(0, bench.next_state())
        if count and bench.context.num_continuous_states():
            found.insert(0, bench.rates())
        return np.concatenate([np.empty(0), *found])


def _automatic(point: _Point, varied: list[int]) -> NDArray[np.float64]:
    """Returns the derivatives by the varied elements, by automatic differentiation."""
    block = point.bench.block
    try:
        converted = block.ToAutoDiffXd()
    except Exception as error:
        raise InputError(
            block_name(block),
            "does not convert to AutoDiffXd; define it with define_for_scalars, or "
            "compare a linear model: assert_linearization(block, model=...)",
        ) from error
    x = point.vector
    vector = np.array([AutoDiffXd(value) for value in x], dtype=object)
    for column, k in enumerate(varied):
        vector[k] = AutoDiffXd(x[k], np.eye(len(varied))[column])
    dual = point.respond(Bench(converted, time_s=point.bench.time_s), vector)
    for label, ours, theirs in zip(
        point.response_labels(), dual, point.here, strict=True
    ):
        scale = max(1.0, abs(theirs))
        if not abs(ours.value() - theirs) <= 1e-12 * scale:
            raise AssertionError(
                f"{block_name(block)}: {label} is {ours.value():.15g} with AutoDiffXd, "
                f"and {theirs:.15g} with floats"
            )
    return np.array([_derivatives(y, len(varied)) for y in dual]).reshape(
        len(dual), len(varied)
    )


def _derivatives(value: AutoDiffXd, count: int) -> NDArray[np.float64]:
    found = np.asarray(value.derivatives(), dtype=float)
    return found if found.size else np.zeros(count)


def _matrix(point: _Point, model: Any) -> NDArray[np.float64]:
    """Returns the derivatives of a linear model, in the order of ``_Point``."""
    matrices = [getattr(model, name) for name in "ABCD"]
    A, B, C, D = (
        np.atleast_2d(np.asarray(m() if callable(m) else m)) for m in matrices
    )
    rows, columns = len(point.response_labels()), len(point.vector)
    states = len(point.state)
    shapes = [
        (states, states),
        (states, columns - states),
        (rows - states, states),
        (rows - states, columns - states),
    ]
    for name, matrix, shape in zip("ABCD", (A, B, C, D), shapes, strict=True):
        if 0 not in shape and matrix.shape != shape:
            raise InputError(
                f"model.{name}", f"has the shape {matrix.shape}; it needs {shape}"
            )
    A, B, C, D = (
        matrix.reshape(shape)
        for matrix, shape in zip((A, B, C, D), shapes, strict=True)
    )
    return np.block([[A, B], [C, D]])


@dataclass(frozen=True)
class _Difference:
    """Finite differences of the response by one element of the vector."""

    slopes: Slopes
    size: NDArray[np.float64]
    """Magnitudes of the values from which the differences follow."""

    @property
    def step(self) -> float:
        """Step of the element."""
        return self.slopes.step

    @property
    def central(self) -> NDArray[np.float64]:
        """Central differences with this step."""
        return self.slopes.near

    @property
    def change(self) -> NDArray[np.float64]:
        """Changes of the central differences if the step is doubled."""
        return np.abs(self.slopes.far - self.slopes.near)

    @classmethod
    def at(cls, point: _Point, k: int, step: float) -> _Difference:
        """Computes the differences by element ``k``."""
        x, here = point.vector, point.here
        found = slopes_at(
            lambda moved: point.respond(point.bench, moved), x, here, k, step
        )
        size = np.maximum(np.abs(here), max(1.0, float(np.abs(x).max())))
        return cls(found, size)

    def tolerance(self, tolerance: float | None) -> NDArray[np.float64]:
        """Returns the tolerance of each derivative."""
        if tolerance is not None:
            return tolerance * np.maximum(1.0, np.abs(self.central))
        rounding = 4.0 * EPSILON * self.size / self.step
        return _SAFETY * (self.change + rounding)

    def is_rough(self) -> NDArray[np.bool_]:
        """Whether each difference depends so much on the step that it says nothing."""
        scale = np.maximum(1.0, np.abs(self.central))
        return _SAFETY * self.change > _COARSEST * scale

    def remark(self, row: int) -> str:
        """Returns a remark about a corner or a jump at the operating point."""
        ahead, behind = float(self.slopes.ahead[row]), float(self.slopes.behind[row])
        apart = abs(ahead - behind) > _COARSEST * max(1.0, abs(ahead))
        if not apart and not self.is_rough()[row]:
            return ""
        return (
            f"; the output is not smooth here, the differences to both sides are "
            f"{behind:.6g} and {ahead:.6g}: choose another point, or hold this input "
            "with hold=[...]"
        )
