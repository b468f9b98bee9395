"""Repeats the localization experiment of the papers, with bounds and tolerances.

In tables 1 and 2 of Han 2019, a robot at rest locates a source at rest. The source is
1-4 m away at 0, 30 and 60 deg. Each position has 100 measurements. In this module, a
measurement is one frame (25 ms of audio) in the full diagram. The papers' estimator and
the project's estimators get the same sound and noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_tolerances import ArrayTolerances
from analysis.arrays.listener import Heard, Listener
from analysis.arrays.paper_tables import PAPER_CELLS, PaperCell
from analysis.arrays.sensitivity import ArrayErrors, PolarStd, predicted_std
from analysis.arrays.trial_counts import check_trials
from diagrams import Scenario, load_scenario
from systems.hearing.tdoa_estimator import TDOAEstimator
from systems.sound.array_shape import ArrayShape

#: Changes to the default scenario. No force moves the robot. The sound is continuous.
#: Every frame is therefore a measurement.
_SETTING = (
    "name=localization",
    "description=A resting source heard by a resting robot",
    "law=none",
    "obstacles=[]",
    "attraction.stiffness_n_m=0",
    "source.waypoints_m=[[2.175, 0]]",
    "sound.period_s=0.5",
)

#: Tolerances of a carefully built array. The errors within them are redrawn for every
#: measurement. The tolerance of the speed of sound corresponds to 1 deg C.
REALISTIC_TOLERANCES = ArrayTolerances(
    position_m=0.0002, delay_s=2.0e-7, sound_speed_share=0.002
)

#: Values of the field ``tdoa.method`` by name of the estimator.
ESTIMATORS = {"paper": "amdf", "fast": "gcc", "ml": "ml"}


class PaperEstimator(TDOAEstimator):
    """The papers' estimator, with delays in whole samples.

    The estimator rejects no estimate and does not suppress echoes.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(
            parameters=scenario.follower.tdoa.model_copy(
                update={"false_alarm_rate": 1.0 - 1e-12, "suppress_echoes": False}
            ),
            robot=scenario.only.robot,
            sound_speed_m_s=scenario.believed_sound_speed_m_s,
            microphones=scenario.follower.microphones,
            limited=False,
        )


@dataclass(frozen=True)
class LocalizationCell:
    """The measurements of one estimator with the source at one position."""

    paper: PaperCell
    """The position, and the paper's results at this position."""
    estimator: str
    """Name of the estimator: a key of ``ESTIMATORS``."""
    trials: int
    """Number of frames."""
    heard: Heard
    """The estimates, with their bound."""
    tolerance: PolarStd
    """Standard deviations due to the array's tolerances, predicted to first order."""

    def to_dict(self) -> dict[str, Any]:
        """Converts the cell to plain values for JSON; None if nothing was measured."""
        paper = self.paper
        heard, bound = self.heard, self.heard.bound
        bearings_deg = np.degrees(heard.bearings)
        return {
            "range_m": paper.range_m,
            "bearing_deg": paper.bearing_deg,
            "estimator": self.estimator,
            "trials": self.trials,
            "unheard": self.trials - len(heard.bearings),
            "rangeless": len(heard.bearings) - len(heard.ranges),
            **_moments("range", "m", heard.ranges, paper.range_m),
            **_moments("bearing", "deg", bearings_deg, paper.bearing_deg),
            "bound_range_m": bound.range_std,
            "bound_bearing_deg": math.degrees(bound.bearing_std),
            "tolerance_range_m": self.tolerance.range,
            "tolerance_bearing_deg": math.degrees(self.tolerance.bearing),
            "paper": {
                "range_mean_m": paper.range_mean_m,
                "range_std_m": paper.range_std_m,
                "bearing_mean_deg": paper.bearing_mean_deg,
                "bearing_std_deg": paper.bearing_std_deg,
            },
        }


def _moments(
    name: str, unit: str, values: NDArray[np.float64], truth: float
) -> dict[str, float | None]:
    """Computes mean, standard deviation and RMS error; None for too few values."""
    some, several = len(values) > 0, len(values) > 1
    rmse = float(np.sqrt(np.mean((values - truth) ** 2))) if some else None
    return {
        f"{name}_mean_{unit}": float(values.mean()) if some else None,
        f"{name}_std_{unit}": float(values.std(ddof=1)) if several else None,
        f"{name}_rmse_{unit}": rmse,
    }


@dataclass(frozen=True)
class LocalizationExperiment:
    """Settings of a localization experiment, as made by ``prepare_localization``."""

    scenario: Scenario
    """Scenario with a continuously sounding source at rest, and a robot at rest."""
    trials: int
    """Number of measurements per position and estimator."""
    tolerances: ArrayTolerances
    """Largest errors of the array and of the speed of sound."""
    estimators: tuple[str, ...] = tuple(ESTIMATORS)
    """Names of the estimators: keys of ``ESTIMATORS``."""
    places: tuple[PaperCell, ...] = PAPER_CELLS
    """Positions of the source."""

    @property
    def measurements(self) -> int:
        """Total number of measurements."""
        return self.trials * len(self.places) * len(self.estimators)

    @property
    def shape(self) -> ArrayShape:
        """Array of the microphones as stated."""
        return ArrayShape.of(self.scenario.only.robot.microphones_m)

    @property
    def array_errors(self) -> ArrayErrors:
        """Standard deviations of errors that are uniform within the tolerances."""
        part = 1.0 / math.sqrt(3.0)
        return ArrayErrors(
            position_m=part * self.tolerances.position_m,
            delay_s=part * self.tolerances.delay_s,
            sound_speed_share=part * self.tolerances.sound_speed_share,
        )

    def run(
        self, progress: Callable[[float], None] | None = None
    ) -> list[LocalizationCell]:
        """Runs the experiment: all positions of the source, with every estimator.

        The errors of the array are redrawn within their tolerances for every
        measurement. All estimators get the same errors, sound and noise. ``progress``
        is called with the number of measurements so far. The results are sorted by
        position, then by estimator.
        """
        listeners = [
            (name, Listener(_with_estimator(self.scenario, name)))
            for name in self.estimators
        ]
        cells: list[LocalizationCell] = []
        for number, place in enumerate(self.places):
            for name, listener in listeners:
                heard = listener.listen(
                    place.range_m,
                    math.radians(place.bearing_deg),
                    self.trials,
                    self.tolerances,
                    session=number,
                )
                tolerance = predicted_std(
                    self.array_errors,
                    heard.p_AS,
                    self.shape,
                    self.scenario.sound_speed_m_s,
                )
                cells.append(
                    LocalizationCell(place, name, self.trials, heard, tolerance)
                )
                if progress is not None:
                    progress(self.trials * len(cells))
        return cells


def prepare_localization(
    overrides: Iterable[str] = (), *, trials: int = 100, tolerances: bool = False
) -> LocalizationExperiment:
    """Prepares the localization experiment in the default scenario.

    If ``tolerances`` is true, the array has errors within ``REALISTIC_TOLERANCES``.
    Raises ``InputError`` if an override, or the number of trials, is wrong.
    """
    check_trials(trials)
    return LocalizationExperiment(
        scenario=load_scenario("default", [*_SETTING, *overrides]),
        trials=trials,
        tolerances=REALISTIC_TOLERANCES if tolerances else ArrayTolerances(),
    )


def _with_estimator(scenario: Scenario, name: str) -> Scenario:
    tdoa = scenario.follower.tdoa.model_copy(update={"method": ESTIMATORS[name]})
    blocks = (f"{__name__}:PaperEstimator",) if name == "paper" else ()
    return scenario.with_robot(tdoa=tdoa, blocks=blocks)
