"""Bearings from cross powers as Song 2011 prints them, and without steering."""

from __future__ import annotations

import math

import numpy as np

from diagrams import Scenario
from systems.hearing.cross_power_estimator import (
    LEAST_FRAMES,
    ArrayListener,
    CrossPowerEstimator,
    Direction,
)
from systems.hearing.cross_powers import CrossPowers, cross_correlations, signal_powers
from systems.hearing.source_fix import RANGED, range_status
from systems.hearing.spherical_interpolation import (
    interpolate_sphere,
    plane_wave_bearing,
)


class PlaneListener(ArrayListener):
    """Takes the bearing from the delays of all pairs.

    It is that of a position if the position is credible, and otherwise that of a plane
    wave.
    """

    def bearing_of(self, steered: float, interpolated: float) -> float:
        """Returns the interpolated bearing, rad."""
        return interpolated


class PrintedListener(ArrayListener):
    """The method printed in Song 2011.

    It uses delays in whole samples, pairs with the middle microphone, and spherical
    interpolation.
    """

    def direction(self, sound: CrossPowers, noise: CrossPowers) -> Direction | None:
        """As ``ArrayListener.direction``; None if a microphone is silent."""
        facts = self.facts
        if sound.frames < LEAST_FRAMES or self.lost(sound):
            return None
        mean, occupied = signal_powers(facts, sound, noise, self.band_hz)
        if not occupied.any():
            return None
        white = mean / np.maximum(np.abs(mean), 1e-300)
        white = np.where(facts.frequencies_hz >= self.band_hz[0], white, 0.0)
        correlations = cross_correlations(facts, white, 1)
        most = math.ceil(
            np.linalg.norm(self.p_RM, axis=1).max() / self.c * facts.rate_hz
        )
        lags = np.arange(-most, most + 1)
        d = []
        for k, (i, _) in enumerate(facts.pairs):
            if i == 0:
                best = lags[int(correlations[k][lags].argmax())]
                d.append(self.c * best / facts.rate_hz)
        place, distance = interpolate_sphere(self.p_RM[1:], d)
        status = range_status(1.0 / distance if distance > 0.0 else math.nan)
        if not math.isfinite(distance):
            return Direction(plane_wave_bearing(self.p_RM[1:], d), status)
        bearing = math.atan2(place[1], place[0])
        return Direction(bearing, status, place if status == RANGED else None)


class _Estimator(CrossPowerEstimator):
    def __init__(self, scenario: Scenario) -> None:
        super().__init__(
            robot=scenario.only.robot,
            sound_speed_m_s=scenario.believed_sound_speed_m_s,
            microphones=scenario.follower.microphones,
        )


class PlaneEstimator(_Estimator):
    """Replaces ``CrossPowerEstimator`` in a robot, with a ``PlaneListener``."""

    listener = PlaneListener


class PrintedEstimator(_Estimator):
    """Replaces ``CrossPowerEstimator`` in a robot, with a ``PrintedListener``."""

    listener = PrintedListener
