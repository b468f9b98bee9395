"""The linear model of a Drake diagram, with its accuracy and what it leaves out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.linear_models import LinearModel
from systems.framework.input_error import InputError

#: Largest number of elements of ``undifferentiated`` in a text.
_MOST_LINES = 5


@dataclass(frozen=True)
class Undifferentiated:
    """Something in the diagram that the linear model does not describe."""

    where: str
    """Block, with the element of its state or the port."""
    why: str
    """Reason, in words."""


@dataclass(frozen=True)
class LinearizedDiagram:
    """Linear model of a Drake diagram at one context."""

    model: LinearModel
    """Matrices and names of the signals. If the diagram has discrete states, the model
    is sampled with the common period of all updates. Otherwise it is continuous."""
    method: str
    """``AutoDiffXd`` or ``differences``."""
    difference: float
    """Largest absolute difference of an element of A, B, C or D between the two
    methods. With ``differences`` alone, the estimated error of the differences."""
    drift: NDArray[np.float64]
    """(n,) change of the state over one period, or its time derivative in a continuous
    model. It is zero at an equilibrium. Otherwise the model describes deviations from
    the moving state of the diagram."""
    undifferentiated: tuple[Undifferentiated, ...]
    """Switches, abstract states and blocks that do not convert to AutoDiffXd."""

    def state_space(self) -> Any:
        """Returns the model as a ``control.StateSpace``."""
        return self.model.to_control()

    def sampled(self, period_s: float) -> LinearModel:
        """Samples a continuous model; the inputs are held over a period.

        Args:
            period_s: Sample period, s.

        Returns:
            The sampled model.

        Raises:
            InputError: The model is sampled already.
        """
        if self.model.period_s is not None:
            raise InputError(
                "period_s",
                f"the model is sampled already, with {self.model.period_s:g} s; use "
                "model",
            )
        from scipy.signal import cont2discrete

        A, B, *_ = cont2discrete(
            (self.model.A, self.model.B, self.model.C, self.model.D), period_s
        )
        return replace(self.model, A=A, B=B, period_s=period_s)

    def __str__(self) -> str:
        model = self.model
        kind = (
            "continuous" if model.period_s is None else f"sampled, {model.period_s:g} s"
        )
        inputs, outputs = (
            ", ".join(names) or "none"
            for names in (model.input_names, model.output_names)
        )
        accuracy = (
            f"differs from differences by at most {self.difference:.1e}"
            if self.method == "AutoDiffXd"
            else f"estimated error {self.difference:.1e}"
        )
        lines = [
            f"{model.name}: {len(model.A)} states, {kind}",
            f"inputs: {inputs}; outputs: {outputs}",
            f"by {self.method}; {accuracy}",
        ]
        if np.abs(self.drift).max(initial=0.0) > 1e-9:
            k = int(np.abs(self.drift).argmax())
            lines.append(
                f"not at an equilibrium: {model.state_names[k]} changes by "
                f"{self.drift[k]:.3g} per {'s' if model.period_s is None else 'period'}"
            )
        left_out = self.undifferentiated
        first = left_out[:_MOST_LINES]
        lines += [f"not described: {u.where}: {u.why}" for u in first]
        if len(left_out) > _MOST_LINES:
            lines.append(
                f"... and {len(left_out) - _MOST_LINES} more: undifferentiated"
            )
        return "\n".join(lines)
