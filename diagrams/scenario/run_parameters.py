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
    Speed,
)
from systems.framework.signals import TICK_S
from systems.odor.parameters import OdorParameters, WindParameters
from systems.radio.parameters import RadioParameters
from systems.sound.acoustics import AcousticParameters
from systems.sound.parameters import RoomParameters, SoundParameters
from systems.world.parameters import ObstacleParameters

#: The engine that simulates a run.
Engine = Literal["drake", "compiled"]

#: From this number of runs on, ``auto`` compiles.
MANY_RUNS = 100

#: Names of robots and sources, which are also names of files.
_Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)]
_Participants = Annotated[dict[_Name, dict[str, Any]], Field(max_length=16)]


class StopParameters(Parameters):
    """When a run ends, and what counts as following."""

    goal_margin_m: Length = 0.3
    """Goal at a source at rest: P is within the follow distance plus this, m."""
    rest_speed_m_s: Speed = 0.05
    """At rest: P is slower than this, m/s."""
    rest_time_s: Duration = 1.0
    """Reached: P is in the goal and at rest for this time without a break, s."""
    following_band_m: Length = 0.8
    """Following: the distance from P to the source differs from the follow distance by
    at most this, m."""
    following_share: Fraction = 0.5
    """Completed: P follows in at least this share of the time since the first
    detection."""
    stuck_after_s: Duration = 10.0
    """Stuck: P stays within ``stuck_radius_m`` outside of its goal for this time, s."""
    stuck_radius_m: Length = 0.1
    """Radius for ``stuck_after_s``, m."""
    lost_after_s: Duration = 20.0
    """Lost: no valid target for this time, s."""
    diverged_range_m: Length = 20.0
    """Diverged: the source or the goal is farther away than this, m."""
    odor_within_m: Length = 0.22
    """Found: a search for an odor ends with the source within this distance of the
    origin of B, m."""
    odor_ahead_deg: float = Field(default=75.0, ge=0.0, le=180.0)
    """Found: in addition, the direction to the source differs from the heading by at
    most this, deg."""
    sound_within_m: Length = 0.6
    """Found: a search for a sound ends with the source within this distance of the
    origin of B, m."""


class OdorSourceParameters(OdorParameters):
    """The source of odor and its position."""

    position_m: Point = (0.0, 0.0)
    """Center of the container in W, m."""
    container_m: Size = (0.08, 0.08)
    """Extents of the container along x and y of W, m. Robots can touch the
    container."""


class IntegratorParameters(Parameters):
    """How Drake integrates the plant, with a fixed step."""

    scheme: Literal["runge_kutta2", "runge_kutta3", "runge_kutta5"] = "runge_kutta5"
    """Integration scheme. With the default step and motor lag, the fifth order stays
    within 1 um of the true path over 20 s for all commands; the third order deviates by
    up to 0.6 mm."""
    step_s: float = Field(default=0.0125, ge=1e-5, le=0.025)
    """Largest step, s."""


class RunParameters(Parameters):
    """Fields of a run that do not belong to one robot, such as seed and obstacles."""

    name: str = Field(default="default", min_length=1, pattern=r"^[^\n]*$")
    """Name in the results."""
    description: str = Field(default="", pattern=r"^[^\n]*$")
    """One line for the list of ``phonotaxis scenarios``."""
    engine: Literal["drake", "compiled", "auto"] = "auto"
    """``drake``: Drake's simulator; ``compiled``: one compiled loop over the same
    blocks, which agrees within 1e-9 m and takes a fraction of the time; ``auto``:
    compiled for 100 or more runs at once."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of all random numbers of the run."""
    tick_s: Period = TICK_S
    """Period of control, odometry, emitters and log, s. Hearing and range sensors have
    their own periods, which are multiples of it."""
    duration_s: float = Field(default=40.0, ge=1e-9, le=3_600.0)
    """Longest simulated time, s; at most one hour."""
    arena_m: Size = (7.0, 7.0)
    """Extents of the floor in pictures, m; the arena has no walls."""
    robots: _Participants = Field(default={})
    """Robots by name, each with the fields that differ from those of the scenario;
    empty: one robot, named ``robot``, without differences."""
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
    acoustics: AcousticParameters = AcousticParameters()
    room: RoomParameters | None = None
    wind: WindParameters = WindParameters()
    odor: OdorSourceParameters | None = None
    """A source of odor in the wind, for robots that search for it."""
    radio: RadioParameters = RadioParameters()
    integrator: IntegratorParameters = IntegratorParameters()
