"""The state space of the paper, to which tests compare the force of the law."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def state_matrices(
    mass: float,
    target: tuple[float, float],
    contacts: list[tuple[float, float]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[NDArray[np.float64]]]:
    """Computes A, B1, and B2j of eq. 11 to 14 for one axis with restored signs.

    The state is (p, v). The inputs are u_d = (p_d, v_d) and X_j = (x_e, v_e) of each
    object j. x_e is the envelope point at the distance S from the object, and v_e is
    the velocity of this point.

    Args:
        mass: Virtual mass M, kg.
        target: Stiffness K, N/m, and damping D, N s/m, to the target.
        contacts: Stiffness K_e, N/m, and damping D_e, N s/m, of each object.

    Returns:
        A and B1, (2, 2) each, and the list of all B2j, (2, 2) each.
    """
    sums = np.sum([target, *contacts], axis=0)
    a = np.array([[0.0, 1.0], [-sums[0] / mass, -sums[1] / mass]])
    inputs = [np.array([[0.0, 0.0], [k / mass, d / mass]]) for k, d in contacts]
    return a, np.array([[0.0, 0.0], [target[0] / mass, target[1] / mass]]), inputs
