"""Reduction of a linear model to its controllable and observable part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.models.linear_models import LinearModel

#: A new direction of a unit vector counts as rounding error if its length is below.
_NEGLIGIBLE = 1e-9


def minimal_model(model: LinearModel) -> LinearModel:
    """Returns the controllable and observable part of a model.

    The frequency response stays the same. The closed loop has many states outside this
    part: the error of odometry, the angles of the wheels, and the covariances of the
    tracker. Their poles are at z = 1 or z = 0. With these states, transfer polynomials
    of the model would be useless. The remaining states are orthonormal combinations of
    those of ``model``.
    """
    moved = _on(model, _span(model.A, model.B))
    return _on(moved, _span(moved.A.T, moved.C.T))


def _span(A: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, k) orthonormal basis of the controllable subspace of A and B."""
    basis = np.empty((len(A), 0))
    waiting = list(B.T)
    while waiting:
        vector = waiting.pop(0)
        size = np.linalg.norm(vector)
        if size == 0.0:
            continue
        vector = vector / size
        for _ in range(2):  # twice, to remove rounding errors of the first time
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
