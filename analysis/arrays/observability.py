"""Reports which properties of an array a calibration made better known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.calibration import Calibration

# Ratios of posterior to prior standard deviation. A quantity at or below _OBSERVABLE
# counts as observable. A quantity above _NOT counts as not observable.
_OBSERVABLE, _NOT = 0.5, 0.9

# A mode counts as a combination of the others if less than this share of the mode
# differs from them. An example is the rotation of a straight array about its own line.
_NO_MODE = 1e-6

_Verdict = Literal["observable", "in part", "not observable"]


@dataclass(frozen=True)
class CalibrationGain:
    """How well one quantity of an array is known before and after calibration."""

    name: str
    unit: str
    """Unit of the standard deviations: m, rad, s, m/s, or 1 for a share."""
    before: float
    """Standard deviation before the calibration, as stated."""
    after: float
    """Standard deviation after the calibration."""

    @property
    def ratio(self) -> float:
        """Standard deviation after over before; 1 if the quantity was exact before."""
        return self.after / self.before if self.before > 0.0 else 1.0

    @property
    def verdict(self) -> _Verdict:
        """Whether the sounds determine the quantity."""
        if self.ratio <= _OBSERVABLE:
            return "observable"
        return "in part" if self.ratio <= _NOT else "not observable"


def gain_ratios(
    calibration: Calibration,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Finds m independent directions of the unknowns, ordered by improvement.

    Returns (m,) ascending ratios of the standard deviations after and before
    calibration, and the directions as columns of an (n d + 1 + n, m) matrix. A column
    is the change of positions, speed of sound and delays for one standard deviation
    before.
    """
    seen, axes = np.linalg.eigh(calibration.information)
    ratios = 1.0 / np.sqrt(1.0 + np.maximum(seen[::-1], 0.0))
    return ratios, calibration.unknowns.scale @ axes[:, ::-1]


def gains_nothing(calibration: Calibration) -> bool:
    """Whether no direction of the unknowns became better known."""
    return bool(gain_ratios(calibration)[0][0] > _NOT)


def calibration_gains(calibration: Calibration) -> list[CalibrationGain]:
    """Lists how well each property of the array is known before and after calibration.

    The properties are the speed of sound; the microphone positions as a whole; shifts,
    rotations and size of the whole array; the remaining shape of the array; and the
    delays of the channels. Properties that were exact before are left out.
    """
    before = calibration.unknowns.prior_covariance
    after = calibration.covariance
    size = calibration.places.size
    found = []

    def add(name: str, unit: str, rows: NDArray[np.float64]) -> None:
        pair = [_rms(rows, covariance) for covariance in (before, after)]
        if len(rows) and pair[0] > 0.0:
            found.append(CalibrationGain(name, unit, *pair))

    whole = np.eye(len(before))
    add("speed of sound", "m/s", whole[size : size + 1])
    add("places of microphones", "m", whole[:size])
    modes = _modes(calibration.unknowns.places)
    columns = np.column_stack([mode for _, _, mode in modes])
    functionals = np.linalg.pinv(columns, rcond=1e-9)
    for (name, unit, _), row in zip(modes, functionals, strict=True):
        add(name, unit, row[np.newaxis] @ whole[:size])
    rest = np.linalg.svd(columns)[0][:, columns.shape[1] :].T
    add("shape of the array", "m", rest @ whole[:size])
    add("delays of channels", "s", whole[size + 1 :])
    return found


def _rms(rows: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Root mean square standard deviation of linear functions, given as rows."""
    variances = np.einsum("ij,jk,ik->i", rows, covariance, rows)
    return math.sqrt(max(float(variances.mean()), 0.0)) if len(rows) else 0.0


def _modes(
    places: NDArray[np.float64],
) -> list[tuple[str, str, NDArray[np.float64]]]:
    """Lists the independent shifts, rotations and size changes of an array.

    Each mode has a name, a unit and (n d,) displacements to first order for a shift by
    1 m, a rotation by 1 rad, or twice the size.
    """
    count, dimension = places.shape
    p = places - places.mean(axis=0)
    axes = "xyz"[:dimension]
    found = [
        (f"shift of the array along {name}", "m", np.tile(axis, (count, 1)))
        for name, axis in zip(axes, np.eye(dimension), strict=True)
    ]
    lifted = np.pad(p, ((0, 0), (0, 3 - dimension)))
    for name, axis in zip("xyz", np.eye(3), strict=True):
        if dimension == 3 or name == "z":
            turn = np.cross(axis, lifted)[:, :dimension]
            found.append((f"rotation of the array about {name}", "rad", turn))
    found.append(("size of the array", "1", p))
    kept: list[tuple[str, str, NDArray[np.float64]]] = []
    for name, unit, mode in found:
        others = [column for _, _, column in kept]
        if _is_new(mode.ravel(), others):
            kept.append((name, unit, mode.ravel()))
    return kept


def _is_new(mode: NDArray[np.float64], others: list[NDArray[np.float64]]) -> bool:
    left = mode
    if others:
        basis = np.linalg.qr(np.column_stack(others))[0]
        left = mode - basis @ (basis.T @ mode)
    whole = max(float(np.linalg.norm(mode)), 1e-12)
    return bool(np.linalg.norm(left) > _NO_MODE * whole)
