"""The fields of a run that do not belong to one robot."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict, StringConstraints

from systems.base.carrier_parameters import SourceRobotParameters
from systems.framework.parameters import (
    Duration,
    Fraction,
    Length,
    Parameters,
    Period,
    Point,
    Size,
    SoundSpeed,
    Speed,
)
from systems.framework.signals import TICK_S
from systems.odor.parameters import OdorParameters, WindParameters
from systems.radio.parameters import RadioParameters
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.parameters import RoomParameters, SoundParameters
from systems.world.parameters import ObstacleParameters

#: The engine that simulates a run.
Engine = Literal["drake", "compiled"]

#: Number of runs from which ``auto`` selects the compiled engine.
MANY_RUNS = 100

#: Names of robots and sources, which also appear in names of files.
_Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)]
_Participants = Annotated[dict[_Name, dict[str, Any]], Field(max_length=16)]


class StopParameters(Parameters):
    """When a run ends, and what counts as following."""

    goal_margin_m: Length = 0.3
    """Margin of the goal at a source at rest, m. P is in the goal if its distance from
    the source is at most the follow distance plus this margin."""
    rest_speed_m_s: Speed = 0.05
    """Speed below which P is at rest, m/s."""
    rest_time_s: Duration = 1.0
    """Time for which P must be at rest in the goal without a break, s. Then the run
    ends as reached."""
    following_band_m: Length = 0.8
    """Greatest deviation from the follow distance, m. P follows if its distance from
    the source deviates from the follow distance by at most this value."""
    following_share: Fraction = 0.5
    """Least share of the time since the first detection in which P must follow, so that
    the run counts as completed."""
    stuck_after_s: Duration = 10.0
    """Time after which the run ends as stuck, s: P has stayed in one place (within
    ``stuck_radius_m``) outside of its goal for this time."""
    stuck_radius_m: Length = 0.1
    """Greatest distance, m, that P can move and still count as in one place."""
    lost_after_s: Duration = 20.0
    """Time without a valid target after which the run ends as lost, s."""
    diverged_range_m: Length = 20.0
    """Distance from the source or the goal beyond which the run ends as diverged, m."""
    odor_within_m: Length = 0.22
    """Greatest distance of the source from the origin of B, m, at the end of a search
    for an odor that counts as found."""
    odor_ahead_deg: float = Field(default=75.0, ge=0.0, le=180.0)
    """Greatest angle between the heading and the direction to the source, deg, at the
    end of a search for an odor that counts as found."""
    sound_within_m: Length = 0.6
    """Greatest distance of the source from the origin of B, m, at the end of a search
    for a sound that counts as found."""


class OdorSourceParameters(OdorParameters):
    """The source of odor and its position."""

    position_m: Point = (0.0, 0.0)
    """Center of the container in W, m."""
    container_m: Size = (0.08, 0.08)
    """Extents of the container along x and y of W, m. Robots can touch the
    container."""


class RunParameters(Parameters):
    """Fields of a run that do not belong to one robot, such as seed and obstacles."""

    name: str = Field(default="default", min_length=1, pattern=r"^[^\n]*$")
    """Name in the results."""
    description: str = Field(default="", pattern=r"^[^\n]*$")
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
    robots: _Participants = Field(default={})
    """Robots by name, each with the fields that differ from those of the scenario;
    empty: one robot, named ``robot``, with the fields of the scenario."""
    sources: _Participants = Field(default={})
    """Sources by name, each with the fields that differ from ``source`` and ``sound``;
    empty: one source, named ``source``. A source that no robot follows is an
    interferer."""
    source: SourceRobotParameters = SourceRobotParameters()
    sound: SoundParameters = SoundParameters()
    obstacles: Annotated[
        tuple[ObstacleParameters, ...], Strict(False), Field(max_length=100)
    ] = ()
    stop: StopParameters = StopParameters()
    sound_speed_m_s: SoundSpeed = SOUND_SPEED_M_S
    """Speed of sound, m/s (Han 2019, 2.1)."""
    room: RoomParameters | None = None
    wind: WindParameters = WindParameters()
    odor: OdorSourceParameters | None = None
    """A source of odor in the wind, for robots that search for it."""
    radio: RadioParameters = RadioParameters()
    integration_step_s: float = Field(default=0.0125, ge=1e-5, le=0.025)
    """Largest step of the Runge-Kutta integration of fifth order, s. The error of the
    path over 20 s with the default step and motor lag is at most 1 um for all
    commands."""
