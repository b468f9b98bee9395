"""One block on a bench: fixed inputs, a set state, and its outputs read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from pydrake.autodiffutils import (
    AutoDiffXd,
    ExtractGradient,
    ExtractValue,
    InitializeAutoDiff,
)
from pydrake.systems.framework import LeafSystem_


class Bench:
    """A block with its inputs fixed, float or AutoDiffXd."""

    def __init__(
        self, block: Any, *, time: float = 0.0, state: Any = None, **inputs: Any
    ) -> None:
        self.block = block
        self.context = block.CreateDefaultContext()
        self.context.SetTime(time)
        if state is not None and self.context.num_continuous_states():
            self.context.SetContinuousState(self._vector(state))
        elif state is not None:
            self._set_discrete_state(self._vector(state))
        for name, value in inputs.items():
            port = block.GetInputPort(name)
            port.FixValue(self.context, self._vector(value))

    def _vector(self, values: Any) -> Any:
        if isinstance(self.block, LeafSystem_[AutoDiffXd]):
            return np.array(
                [v if isinstance(v, AutoDiffXd) else AutoDiffXd(v) for v in values]
            )
        return np.asarray(values, dtype=float)

    def _set_discrete_state(self, values: Any) -> None:
        begin = 0
        for k in range(self.context.num_discrete_state_groups()):
            end = begin + self.context.get_discrete_state(k).size()
            self.context.SetDiscreteState(k, values[begin:end])
            begin = end

    def output(self, name: str) -> Any:
        """Value of an output port."""
        return self.block.GetOutputPort(name).Eval(self.context)

    def updated(self) -> Any:
        """Discrete state after the periodic update, one group after the other."""
        update = self.block.EvalUniquePeriodicDiscreteUpdate(self.context)
        groups = range(update.num_groups())
        return np.concatenate([update.get_vector(k).CopyToVector() for k in groups])

    def tick(self) -> Bench:
        """Takes the periodic update over into the state, 25 ms later."""
        self._set_discrete_state(self.updated())
        self.context.SetTime(self.context.get_time() + 0.025)
        return self


def _check_gradient(
    block: Any,
    respond: Callable[[Any, Any], Any],
    point: ArrayLike,
    *,
    step: float = 1e-6,
    tolerance: float = 1e-6,
) -> None:
    """AutoDiffXd against the float block: its values, and central differences.

    ``respond(block, x)`` gives a vector for a block of either scalar type.
    """
    x: Any = np.asarray(point, dtype=float)
    converted = block.ToAutoDiffXd()
    variables = InitializeAutoDiff(x).ravel()
    # An element that depends on nothing has no derivatives: give it zeros.
    nothing = 0.0 * AutoDiffXd(0.0, x.size, 0)
    dual = np.array([[y + nothing] for y in respond(converted, variables)])
    value = np.asarray(respond(block, x), dtype=float)
    np.testing.assert_allclose(ExtractValue(dual).ravel(), value, rtol=1e-12)
    gradient = ExtractGradient(dual)
    differences = np.empty_like(gradient)
    for k in range(x.size):
        shift: NDArray[np.float64] = np.zeros(x.size)
        shift[k] = step
        high = np.asarray(respond(block, x + shift), dtype=float)
        low = np.asarray(respond(block, x - shift), dtype=float)
        differences[:, k] = (high - low) / (2.0 * step)
    np.testing.assert_allclose(gradient, differences, rtol=tolerance, atol=tolerance)


@pytest.fixture(scope="session")
def bench() -> type[Bench]:
    """The class, to be called with a block and its inputs."""
    return Bench


@pytest.fixture
def check_gradient() -> Callable[..., None]:
    """Compares a block's AutoDiffXd gradient with central differences."""
    return _check_gradient


def _controller_bench(
    block: Any, x: Any, *, feature: float = 2.0, valid: float = 1.0
) -> Bench:
    """A controller's inputs from 8 numbers.

    Target, collision vector, heading, v_WP, and the x of B; the last tick saw
    feature 2 at (0.81, 0.02).
    """
    return Bench(
        block,
        state=[2.0, 0.81, 0.02, 0, 0, 0, 0, 0, 0],
        p_WS_estimated=x[0:2],
        target_valid=[valid],
        collision_vectors_B=[x[2], x[3], 0, 0, 0, 0],
        features=[feature, 0, 0],
        pose_WB_estimated=[x[7], 0.1, x[4]],
        v_WP=x[5:7],
    )


@pytest.fixture
def controller_bench() -> Callable[..., Bench]:
    """A controller that follows a target beside one obstacle."""
    return _controller_bench
