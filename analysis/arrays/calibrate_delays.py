"""Calibrates an array by delays that a user measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.calibrate import (
    CalibrationRun,
    calibration_run,
    require_free_air,
)
from analysis.arrays.calibration import Calibration
from analysis.arrays.calibration_sounds import MeasuredSound
from analysis.arrays.given_delays import GivenSound, given_sounds
from systems.framework.input_error import InputError

# Most calibrations until the estimated errors of the delays settle, and the change of
# their logarithm that counts as settled.
_ROUNDS, _SETTLED = 8, 0.003

# A sound has larger errors than the others if chance exceeds its chi-square with less
# than this probability in any of the sounds.
_CHANCE = 1e-3

# Factor of errors from which a sound is named, and the most sounds to name.
_WORSE, _MOST_NAMED = 2.0, 8

# Least standard deviation of an arrival time, s.
_LEAST_S = 1e-10


def calibrate_by_delays(
    delays: ArrayLike,
    geometry: ArrayGeometry,
    covariance: ArrayLike | None,
    positions_m: ArrayLike | None,
    position_std_m: float,
) -> CalibrationRun:
    """Calibrates an array; see ``phonotaxis.calibrate_delays``."""
    require_free_air(geometry)
    given = given_sounds(delays, covariance, geometry.known)
    places = _positions(positions_m, len(given), len(geometry.microphones[0]))
    remarks = [_left_out(k, sound) for k, sound in enumerate(given) if sound.left_out]
    used = [k for k, sound in enumerate(given) if sound.usable]
    if not used:
        raise InputError(
            "delays",
            "are longer than sound can travel between the microphones; give delays in "
            "s and positions in m, in the same order",
        )

    def calibrated(scales: NDArray[np.float64]) -> CalibrationRun:
        sounds = [
            MeasuredSound(
                given[k].tau,
                given[k].covariance(float(scale)),
                None if places is None else places[k],
                position_std_m,
                f"sound {k + 1}",
                len(given[k].left_out),
            )
            for k, scale in zip(used, scales, strict=True)
        ]
        return calibration_run(sounds, geometry)

    if covariance is not None:
        return replace(calibrated(np.ones(len(used))), remarks=remarks)
    count = len(geometry.microphones)
    own = 0 if places is not None else len(geometry.microphones[0])
    freedom = np.array([count - 1 - own - len(given[k].left_out) for k in used])
    if freedom.max() < 1:
        raise InputError(
            "covariance",
            f"is needed: {count} microphones have too few delays to show their errors; "
            "give for example 'std**2 * (np.eye(n - 1) + 1)' with the standard "
            "deviation of an arrival time in s",
        )
    budget = geometry.known.budget
    start = math.hypot(budget.position_std / geometry.c, budget.delay_std)
    scales = np.full(len(used), max(start, 1e-6))
    for _ in range(_ROUNDS):
        run = calibrated(scales)
        last, scales = scales, _scales(scales, _chi_squares(run.calibration), freedom)
        if np.abs(np.log(scales / last)).max() < _SETTLED:
            break
    factors = last / last.min()
    worse = [k for k in np.argsort(-factors) if factors[k] > _WORSE]
    if worse:
        listed = ", ".join(str(used[k] + 1) for k in worse[:_MOST_NAMED])
        listed += " and others" if len(worse) > _MOST_NAMED else ""
        remarks.append(
            f"sounds {listed}: the delays fit badly, and their errors are taken to be "
            f"up to {factors.max():.1f} times as large as those of the other sounds"
        )
    remarks.append(f"arrival times: standard deviation {1e6 * last.min():.2f} us")
    return replace(run, remarks=remarks)


def _scales(
    scales: NDArray[np.float64],
    misfit: NDArray[np.float64],
    freedom: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Estimates the standard deviation of the arrival times of each sound.

    It is the same for all sounds, except for sounds that fit much worse than the
    others.
    """
    known = freedom > 0
    free = np.maximum(freedom, 1)
    variances = scales**2 * misfit / free
    limits = chi2.isf(_CHANCE / len(free), free) / free
    middle = float(np.median((variances / (chi2.median(free) / free))[known]))
    usual = np.minimum(variances, middle * limits)[known]
    common = float(np.average(usual, weights=free[known]))
    most = np.maximum(common * limits, _LEAST_S**2)
    raised = np.where(known, np.maximum(variances / most, 1.0), 1.0)
    # With these errors, chi-square equals its degrees of freedom.
    common = float(np.average((variances / raised)[known], weights=free[known]))
    return np.sqrt(np.maximum(common, _LEAST_S**2) * raised)


def _chi_squares(calibration: Calibration) -> NDArray[np.float64]:
    return np.array(
        [
            fit.residual @ fit.residual + fit.place.weights @ fit.place.off**2
            for fit in calibration.fits
        ]
    )


def _left_out(k: int, sound: GivenSound) -> str:
    if not sound.usable:
        return f"sound {k + 1}: its delays are impossible, and it is left out"
    return f"sound {k + 1}: {_names(sound.left_out)} missing or impossible, left out"


def _names(channels: Sequence[int]) -> str:
    word = "delay of microphone" if len(channels) == 1 else "delays of microphones"
    return f"{word} {', '.join(str(k + 1) for k in channels)}"


def _positions(
    positions: ArrayLike | None, count: int, dimension: int
) -> NDArray[np.float64] | None:
    if positions is None:
        return None
    try:
        places = np.atleast_2d(np.array(positions, dtype=np.float64))
    except (TypeError, ValueError):
        places = np.empty((0, 0))
    if places.shape != (count, dimension) or not np.isfinite(places).all():
        raise InputError(
            "positions_m",
            f"have the shape {places.shape}; give one position with {dimension} "
            f"finite coordinates for each of {count} sounds, m",
        )
    return places
