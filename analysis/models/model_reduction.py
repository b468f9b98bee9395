"""The part of a linear model that its inputs move and its outputs show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.models.linear_models import LinearModel

#: A direction shorter than this, of a unit vector's image, is rounding.
_NEGLIGIBLE = 1e-9


def minimal_model(model: LinearModel) -> LinearModel:
    """The same response with the states that can be both moved and seen.

    The closed loop has many others: where odometry believes that W lies, how
    far the wheels have turned, what the tracker knows of its own errors. They
    rest at z = 1 or 0 and make polynomials of the whole model useless.

    Args:
        model: Any model.

    Returns:
        A model in other coordinates (orthonormal combinations of states).
    """
    moved = _on(model, _span(model.A, model.B))
    return _on(moved, _span(moved.A.T, moved.C.T))


def _span(A: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, k) orthonormal basis of all that A makes of the columns of B."""
    basis = np.empty((len(A), 0))
    waiting = list(B.T)
    while waiting:
        vector = waiting.pop(0)
        size = np.linalg.norm(vector)
        if size == 0.0:
            continue
        vector = vector / size
        for _ in range(2):  # once more, against what rounding leaves
            vector = vector - basis @ (basis.T @ vector)
        size = np.linalg.norm(vector)
        if size > _NEGLIGIBLE:
            vector = vector / size
            basis = np.column_stack([basis, vector])
            waiting.append(A @ vector)
    return basis


def _on(model: LinearModel, basis: NDArray[np.float64]) -> LinearModel:
    return replace(
        model,
        A=basis.T @ model.A @ basis,
        B=basis.T @ model.B,
        C=model.C @ basis,
        state_names=tuple(f"combination_{k}" for k in range(basis.shape[1])),
    )
