"""The four responses of a feedback loop: S, T, and those to load and to noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.linear.frequency_levels import frequency_grid, peak
from analysis.models.model_reduction import minimal_model
from analysis.models.open_loops import Direction, closed, cut_model
from analysis.models.operating_points import OperatingPoint

#: Points of the frequency grid besides those of modes and peaks, and its lowest
#: frequency, rad/s.
_POINTS, _LOWEST = 800, 1e-2


@dataclass(frozen=True)
class GangOfFour:
    """Closed-loop responses over frequency, one direction."""

    direction: Direction
    """Along the line to the source, or across it."""
    omega: NDArray[np.float64]
    """(n,) rad/s, up to the Nyquist frequency; the modes and the peaks are in it."""
    S: NDArray[np.complex128]
    """(n,) what is left at the sensor of an error of its estimate."""
    T: NDArray[np.complex128]
    """(n,) 1 - S."""
    PS: NDArray[np.complex128]
    """(n,) from an acceleration that disturbs P to where P is, m / (m/s^2)."""
    CS: NDArray[np.complex128]
    """(n,) from an error of the estimate to the acceleration, (m/s^2) / m."""

    @property
    def peaks(self) -> dict[str, float]:
        """Largest size of each."""
        return {
            name: float(np.abs(getattr(self, name)).max())
            for name in ("S", "T", "PS", "CS")
        }


def gang_of_four(point: OperatingPoint, direction: Direction = "along") -> GangOfFour:
    """Responses to errors that hearing makes and to pushes on the virtual mass.

    Args:
        point: The operating point.
        direction: Of both.

    Returns:
        S, T and both others over frequency, up to the Nyquist frequency.
    """
    cut = cut_model(point, "sensor", "actuator")
    whole = closed(cut, cut.input_names)
    own, push = f"sensor_{direction}", f"actuator_{direction}"
    part = minimal_model(whole.part([own, push], [own, push]))
    grid = frequency_grid(part.poles, part.period_s, lowest=_LOWEST, points=_POINTS)
    peaks = [
        peak(part.part([u], [y]), offset)[1]
        for u, y, offset in (
            (own, own, -1.0),
            (own, own, 0.0),
            (push, own, 0.0),
            (own, push, 0.0),
        )
    ]
    within = [omega for omega in peaks if 0.0 < omega <= grid[-1]]
    omega = np.union1d(grid, within)
    response = part.response(omega)
    # What arrives at a cut is T-like: the error itself comes on top.
    T = -response[0, 0]
    return GangOfFour(
        direction=direction,
        omega=omega,
        S=1.0 - T,
        T=T,
        PS=response[0, 1],
        CS=response[1, 0],
    )
