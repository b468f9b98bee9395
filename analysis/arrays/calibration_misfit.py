"""Checks whether sounds and geometry agree, and finds the likeliest fault if not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from analysis.arrays.calibration import Calibration, Fit, place_weight
from analysis.arrays.wave_fronts import wave_front

# The fit is rejected if chance exceeds its chi-square with less than this probability.
_CHANCE = 1e-3

# Eigenvalues below this share of a matrix's largest eigenvalue count as 0.
_ROUNDING = 1e-9

_Kind = Literal["sound", "microphone", "channel"]


@dataclass(frozen=True)
class CalibrationMisfit:
    """The likeliest fault of a calibration that does not fit."""

    kind: _Kind
    """What is at fault: a sound, a microphone's position or a channel's delay."""
    index: int
    """Index of the faulty sound, microphone or channel, from 0."""
    chi_square: float
    """Chi-square of the fit without the faulty part."""
    freedom: int
    """Degrees of freedom of the fit without the faulty part."""

    @property
    def explains(self) -> bool:
        """Whether the rest fits without the faulty part."""
        return bool(chi2.sf(self.chi_square, max(self.freedom, 1)) > _CHANCE)


def calibration_misfit(calibration: Calibration) -> CalibrationMisfit | None:
    """Finds the likeliest fault if measured sounds and stated geometry disagree.

    The function compares three kinds of candidates: one sound is left out, the position
    of one microphone is free, or the delay of one channel is free. The change of
    chi-square is computed to first order about the solution. Returns None if everything
    fits without a change.
    """
    whole, freedom = calibration.chi_square, calibration.freedom
    if freedom < 1 or chi2.sf(whole, freedom) > _CHANCE:
        return None
    precision = np.eye(len(calibration.information)) + calibration.information
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    found = [
        CalibrationMisfit("sound", j, max(whole - drop, 0.0), freedom - rank)
        for j, (drop, rank) in enumerate(
            _without_sound(fit, covariance) for fit in calibration.fits
        )
    ]
    found += _by_channel(calibration, covariance)
    telling = [m for m in found if m.freedom > 0] or found
    return max(telling, key=lambda m: chi2.logsf(m.chi_square, max(m.freedom, 1)))


def _by_channel(
    calibration: Calibration, covariance: NDArray[np.float64]
) -> list[CalibrationMisfit]:
    """Frees the position of each microphone, and the delay of each channel, in turn."""
    fits, (count, dimension) = calibration.fits, calibration.places.shape
    about = calibration.places - calibration.unknowns.origin
    fronts = [wave_front(about, calibration.c, f.place.h, f.place.w) for f in fits]
    moves = [f.root @ front.by_places for f, front in zip(fits, fronts, strict=True)]
    late = np.eye(count)[1:] - np.eye(count)[0]
    found = []
    for k in range(count):
        own = slice(k * dimension, (k + 1) * dimension)
        free: dict[_Kind, list[NDArray[np.float64]]] = {
            "microphone": [move[:, own] for move in moves],
            "channel": [fit.root @ late[:, k : k + 1] for fit in fits],
        }
        for kind, columns in free.items():
            left = calibration.chi_square - _drop_of(fits, columns, covariance)
            freedom = calibration.freedom - columns[0].shape[1]
            found.append(CalibrationMisfit(kind, k, max(left, 0.0), freedom))
    return found


def _left(fit: Fit) -> NDArray[np.float64]:
    """(n - 1,) residual about the expected source position, in standard deviations."""
    return fit.residual + fit.by_place @ (fit.place.weights * fit.place.off)


def _without_sound(fit: Fit, covariance: NDArray[np.float64]) -> tuple[float, int]:
    """Computes how much chi-square and its degrees of freedom fall without a sound."""
    rank = len(fit.residual) - (0 if fit.place.stated else fit.place.h.size)
    if rank <= 0:
        return 0.0, 0
    weights, axes = np.linalg.eigh(place_weight(fit))
    root = axes[:, -rank:] * np.sqrt(np.maximum(weights[-rank:], _ROUNDING))
    value, slopes = root.T @ _left(fit), root.T @ fit.by_array
    spread = np.eye(rank) - slopes @ covariance @ slopes.T
    own, axes = np.linalg.eigh((spread + spread.T) / 2.0)
    return float(np.sum((axes.T @ value) ** 2 / np.maximum(own, _ROUNDING))), rank


def _drop_of(
    fits: Sequence[Fit],
    columns: Sequence[NDArray[np.float64]],
    covariance: NDArray[np.float64],
) -> float:
    """Computes how much chi-square falls if f more parameters are free.

    ``columns`` has (n - 1, f) slopes of each sound's delays along the parameters.
    """
    free = columns[0].shape[1]
    pull, own = np.zeros(free), np.zeros((free, free))
    shared = np.zeros((free, len(covariance)))
    for fit, column in zip(fits, columns, strict=True):
        weighted = column.T @ place_weight(fit)
        pull += weighted @ _left(fit)
        own += weighted @ column
        shared += weighted @ fit.by_array
    information = own - shared @ covariance @ shared.T
    floor = _ROUNDING * max(float(np.abs(own).max()), 1e-30)
    known, axes = np.linalg.eigh((information + information.T) / 2.0)
    told = known > floor
    return float(np.sum((axes.T @ pull)[told] ** 2 / known[told]))
