"""Parameters of the wind, the odor source, the gas sensors and the airflow sensors."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict

from systems.framework.parameters import (
    Angle,
    Length,
    Parameters,
    Point,
    Positive,
    Time,
)

GAS_SENSORS = 3
#: Exponent in Rs/R0 = (1 + C/C1)^-exponent, for ethanol (table of GADEN).
GAS_EXPONENT = 0.7155
#: Extents of the container of the odor along x and y of W, m. Robots can touch it.
CONTAINER_M = (0.08, 0.08)


class WindParameters(Parameters):
    """The wind. The paper prints only the range of its speed (Song 2011, 4.1)."""

    kind: Literal["uniform", "meandering", "jet"] = "meandering"
    """``uniform``: constant wind. ``meandering``: the velocity changes slowly, in the
    same way everywhere. ``jet``: the jet of a fan at (-2.2, 0) m in the world frame W.
    The jet also meanders. It becomes wider and slower along its axis.
    """
    speed_m_s: float = Field(default=1.0, ge=0.0, le=20.0)
    """Mean speed, m/s. For a jet: mean speed at its outlet."""
    direction_deg: Angle = 0.0
    """Direction toward which the wind blows, CCW from the x axis of W, deg."""
    meander_intensity: float = Field(default=0.12, ge=0.0, le=1.0)
    """Standard deviation of each velocity component, divided by the mean speed."""
    jet_diameter_m: Length = 0.3
    """Diameter of the outlet of the jet, m."""


class OdorParameters(Parameters):
    """The odor source. The paper prints no properties of it."""

    position_m: Point = (0.0, 0.0)
    """Center of the container in W, m."""
    kind: Literal["puffs", "steady"] = "puffs"
    """``puffs``: single puffs. ``steady``: their mean (Song 2011, eq. 6)."""
    ratio_at_2_m: float = Field(default=0.76, ge=1e-3, le=0.999)
    """Strength of the source: mean ratio Rs/R0 of a gas sensor on the axis, 2 m
    downwind, in a wind of 1 m/s. The power law of the sensor converts it to a
    concentration.
    """
    age_s: Time = 60.0
    """Time from the beginning of the release to the start of a run, s."""
    room_volume_m3: float | None = Field(default=None, ge=1.0, le=1e6)
    """Volume of a closed room, m^3, in which the odor also accumulates as a uniform
    background. null: an open room.
    """


class GasSensorParameters(Parameters):
    """Three TGS2620 sensors on arms of 20 cm, 120 deg apart (Song 2011, 2.1)."""

    preset: Literal["song2011", "tgs2620"] = "song2011"
    """Time constants of the readings while the concentration grows and while it falls.
    ``song2011``: 2.5 s and 5.8 s. A reading then reaches 95 % of its change in 7.5 s
    and in 17.4 s (2.3.3 prints 5 to 10 s and 15 to 20 s). ``tgs2620``: 2.96 s and
    15.71 s, for the TGS2620 and ethanol in the table of GADEN."""
    positions_m: Annotated[tuple[Point, Point, Point], Strict(False)] = (
        (0.1, -0.1732),
        (-0.2, 0.0),
        (0.1, 0.1732),
    )
    """Positions of R1 (right front), R2 (rear) and R3 (left front) in B, m."""
    noise: float = Field(default=0.003, ge=0.0, le=1.0)
    """Standard deviation of a reading, divided by the reading."""
    mismatch: float = Field(default=0.01, ge=0.0, le=0.05)
    """Relative standard deviation of R0 between sensors. The relative standard
    deviation of the power law's exponent is three times as large. Each sensor has
    constant values."""


class AirflowParameters(Parameters):
    """The two hot wires. The paper prints no unit, no gain and no lobe."""

    gain_s_m: Positive = 3.0
    """k, reading of a sensor per m/s of wind from its most sensitive direction, s/m."""
    lobe: Literal["cosine", "crosswind"] = "cosine"
    """Directional sensitivity. ``cosine``: the two hot wires are most sensitive to wind
    from 45 deg to the left and from 45 deg to the right. ``crosswind``: the wires are
    parallel to the axis of the robot, next to a partition. Each wire measures the
    crosswind from its own side, and a fifth of the wind along the axis.
    """
