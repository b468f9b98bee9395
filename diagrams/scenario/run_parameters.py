"""The fields of a run that do not belong to one robot."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict

from diagrams.scenario.map_parameters import MapParameters
from systems.framework.parameters import (
    Duration,
    Length,
    Line,
    Parameters,
    Period,
    Size,
    SoundSpeed,
    Time,
)
from systems.framework.signals import TICK_S
from systems.odor.parameters import OdorParameters, WindParameters
from systems.radio.parameters import RadioParameters
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.parameters import RoomParameters
from systems.world.parameters import ObstacleParameters

#: The engine that simulates a run.
Engine = Literal["drake", "compiled"]

#: Number of runs from which ``auto`` selects the compiled engine.
MANY_RUNS = 100

#: Value of ``stop.diverged_range_m`` for targets within this distance, m.
_DIVERGED_RANGE_M = 20.0


class StopParameters(Parameters):
    """Conditions that end a run, and limits within which a robot follows."""

    goal_margin_m: Length = 0.3
    """Margin of the goal at a source at rest, m. P is in the goal if its distance from
    the source is at most the follow distance plus this margin."""
    rest_time_s: Time = 1.0
    """Time for which P must be at rest in the goal without a break, s. After this time,
    the run ends as reached. With 0, the run ends as soon as P is in the goal, at any
    speed."""
    following_band_m: Length = 0.8
    """Greatest deviation from the follow distance, m. P follows if its distance from
    the source deviates from the follow distance by at most this value."""
    stuck_after_s: Duration = 10.0
    """Time after which the run ends as stuck, s. The run ends if P stays in one place
    (within 0.1 m) outside of its goal for this time."""
    lost_after_s: Duration = 20.0
    """Time without a valid target after which the run ends as lost, s."""
    diverged_range_m: Length | None = None
    """Distance from the source or the goal beyond which the run ends as diverged, m.
    null: 20 m, or twice the distance at the start if the robot starts farther away than
    20 m."""
    sound_within_m: Length = 0.6
    """Greatest distance of the source from the origin of B, m. If a search for a sound
    ends within this distance, the run counts as found."""

    def for_start(self, distance_m: float) -> StopParameters:
        """Returns a copy with a number for ``diverged_range_m``.

        ``distance_m`` is the distance between P and the target at the start, m.
        """
        if self.diverged_range_m is not None:
            return self
        far = distance_m > _DIVERGED_RANGE_M
        range_m = 2.0 * distance_m if far else _DIVERGED_RANGE_M
        return self.model_copy(update={"diverged_range_m": range_m})


class RunParameters(Parameters):
    """Fields of a run that do not belong to one robot, such as seed and obstacles."""

    name: Line = Field(default="default", min_length=1)
    """Name in the results."""
    description: Line = ""
    """One line for the list of ``phonotaxis scenarios``."""
    engine: Literal["drake", "compiled", "auto"] = "auto"
    """``drake``: Drake's simulator; ``compiled``: one compiled loop over the same
    blocks, which is faster and agrees with Drake within 1e-9 m; ``auto``: ``compiled``
    for 100 or more runs at once, otherwise ``drake``."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of all random numbers of the run."""
    tick_s: Period = TICK_S
    """Period of control, odometry, emitters and log, s. Hearing and range sensors have
    their own periods, which are multiples of the tick."""
    duration_s: float = Field(default=40.0, ge=1e-9, le=3_600.0)
    """Longest simulated time, s; at most one hour."""
    arena_m: Size = (7.0, 7.0)
    """Extents of the floor in pictures, m; the arena has no walls."""
    world: Line = ""
    """World from a set of worlds: the name of a world that comes with phonotaxis, or
    ``PATH:NAME`` (``phonotaxis worlds`` lists them). When the scenario is loaded, the
    world becomes obstacles, start, goal, and ``reference_path_m``. Fields beside it
    override those of the world."""
    obstacles: Annotated[
        tuple[ObstacleParameters, ...], Strict(False), Field(max_length=1_000)
    ] = ()
    map: MapParameters | None = None
    """Walls from a map file. null: there is no map."""
    stop: StopParameters = StopParameters()
    reference_path_m: Length | None = None
    """Length of a reference path from start to goal, m, for the metrics ``score`` and
    ``score_4``. null: there are no scores."""
    sound_speed_m_s: SoundSpeed = SOUND_SPEED_M_S
    """Speed of sound, m/s (Han 2019, 2.1)."""
    room: RoomParameters | None = None
    wind: WindParameters = WindParameters()
    odor: OdorParameters | None = None
    """A source of odor in the wind, for robots that search for it."""
    radio: RadioParameters = RadioParameters()
    integration_step_s: float = Field(default=0.0125, ge=1e-5, le=0.025)
    """Largest step of the Runge-Kutta integration of fifth order, s. The error of the
    path over 20 s with the default step and motor lag is at most 1 um for all
    commands."""
