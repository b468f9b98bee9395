"""Simulates a robot at rest that locates a source at rest, in the full diagram."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_tolerances import ArrayTolerances, draw_errors
from analysis.arrays.cramer_rao import LocalizationBound, SlopeEnergy, position_bound
from diagrams import Scenario, build_sound_follower, make_simulator
from diagrams.building.robot import block_seed
from systems import MicArray
from systems.base.robot import microphones_B
from systems.framework.noise import tick_generator
from systems.framework.signals import SAMPLE_RATE_HZ
from systems.sound.array_shape import ArrayShape
from systems.sound.sound_emitter import emitted_samples
from systems.sound.waveforms import make_waveform

# Number of frames before the first frame that counts. In this time, sound arrives from
# up to 8 m, and every block fills its memory of earlier frames.
_LEAD = 2


@dataclass(frozen=True)
class Heard:
    """The estimates from all frames of one session, with their bound."""

    p_AS: NDArray[np.float64]
    """(2,) true position of the source from the microphones' centroid, in B axes, m."""
    bearings: NDArray[np.float64]
    """(k,) bearings from the frames with detected sound, rad."""
    ranges: NDArray[np.float64]
    """(l,) ranges from the frames with a valid range, m."""
    positions: NDArray[np.float64]
    """(l, 2) positions like p_AS, estimated from the frames with a valid range, m."""
    bound: LocalizationBound
    """Bound due to noise and rounding, averaged over all frames."""


class Listener:
    """Measures a source at any number of positions relative to a robot, in one diagram.

    Drake never frees blocks that are written in Python. One diagram therefore serves
    all measurements. For each relative position, the robot is moved, and the source
    stays. The source of the scenario sounds continuously at rest, and no force moves
    the robot.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._frame_s = scenario.follower.microphones.frame_s
        self._follower = build_sound_follower(scenario)
        seed = block_seed(scenario.seed, "sound_emitter")
        self._waveform = make_waveform(scenario.source.sound, seed)
        #: Array of the microphones as stated.
        self.shape = ArrayShape.of(scenario.only.robot.microphones_m)

    def listen(
        self,
        distance: float,
        bearing: float,
        trials: int,
        tolerances: ArrayTolerances = ArrayTolerances(),
        *,
        session: int = 0,
    ) -> Heard:
        """Takes one measurement from each of ``trials`` frames (25 ms of audio).

        The source is at a distance in m and a bearing in rad from the microphones'
        centroid. The errors of the array and of the speed of sound are redrawn within
        their tolerances for every frame. Sessions run at different times. Each session
        therefore has its own noise and errors.
        """
        p_AS = distance * np.array([math.cos(bearing), math.sin(bearing)])
        start = session * (trials + 4 * _LEAD)
        simulator = make_simulator(self._follower)
        root = simulator.get_mutable_context()
        root.SetTime(start * self._frame_s)
        self._place_robot(root, p_AS)
        simulator.Initialize()
        rows = []
        for frame in range(start, start + _LEAD + trials):
            self._redraw_errors(root, frame, tolerances)
            # AdvanceTo ends with the update at this time, which processes the frame.
            simulator.AdvanceTo((frame + 1) * self._frame_s)
            rows.append(self._read(root))
        heard, ranged, bearings, ranges = np.asarray(rows[_LEAD:]).T
        heard, ranged = heard > 0.5, ranged > 0.5
        directions = np.stack((np.cos(bearings), np.sin(bearings)), axis=1)
        frames = start + _LEAD + np.arange(trials, dtype=float)
        return Heard(
            p_AS=p_AS,
            bearings=bearings[heard],
            ranges=ranges[ranged],
            positions=(ranges[:, None] * directions)[ranged],
            bound=self._bound(p_AS, frames * self._frame_s),
        )

    def _place_robot(self, root: Any, p_AS: NDArray[np.float64]) -> None:
        """Places the robot facing along x so that the source is at p_AS."""
        p_WS = self._scenario.source.path().pose(0.0)[:2]
        p_BA = microphones_B(self._scenario.only.robot).mean(axis=0)
        p_WB = p_WS - p_AS - p_BA
        plant = self._follower.blocks["plant"].GetMyMutableContextFromRoot(root)
        at_rest = np.zeros(plant.num_continuous_states() - len(p_WB))
        plant.SetContinuousState([*p_WB, *at_rest])

    def _redraw_errors(
        self, root: Any, frame: int, tolerances: ArrayTolerances
    ) -> None:
        scenario = self._scenario
        rng = tick_generator(block_seed(scenario.seed, "array_errors"), frame)
        errors, speed = draw_errors(tolerances, self.shape.count, rng)
        microphones = self._follower.blocks["microphones"]
        context = microphones.GetMyMutableContextFromRoot(root)
        for index, values in (
            (MicArray.POSITION_ERRORS, errors.position_errors.ravel()),
            (MicArray.CHANNEL_DELAYS, errors.channel_delays),
            (MicArray.GAINS, errors.gains),
            (MicArray.SOUND_SPEED, [scenario.sound_speed_m_s * speed]),
        ):
            context.get_mutable_numeric_parameter(index).SetFromVector(values)

    def _read(self, root: Any) -> tuple[float, ...]:
        """Reads (detected, range_valid, bearing, range) of the last frame."""
        block = self._follower.blocks["hearing"]
        context = block.GetMyContextFromRoot(root)
        names = ("detected", "range_valid", "source_bearing", "source_range")
        return tuple(
            float(block.GetOutputPort(name).Eval(context)[0]) for name in names
        )

    def _bound(
        self, p_AS: NDArray[np.float64], ends: NDArray[np.float64]
    ) -> LocalizationBound:
        """Averages the bounds of the frames that end at ``ends`` in s."""
        scenario = self._scenario
        microphones = scenario.follower.microphones
        first = round((ends[0] - 3 * self._frame_s) * SAMPLE_RATE_HZ)
        count = round(ends[-1] * SAMPLE_RATE_HZ) - first
        samples = emitted_samples(self._waveform, scenario.source.sound, first, count)
        assert samples is not None
        energy = SlopeEnergy.of(samples, SAMPLE_RATE_HZ, first / SAMPLE_RATE_HZ)
        noise_pa = scenario.source.sound.level_pa * 10.0 ** (
            -microphones.snr_db_at_1m / 20.0
        )
        rounding_pa = 1.0 / microphones.counts_per_pa / math.sqrt(12.0)
        bounds = [
            position_bound(
                energy,
                end - self._frame_s,
                end,
                p_AS,
                self.shape.p_AM,
                math.hypot(noise_pa, rounding_pa),
                sample_rate_hz=microphones.sample_rate_hz,
                c=scenario.sound_speed_m_s,
            )
            for end in ends
        ]
        return LocalizationBound.mean(bounds)
