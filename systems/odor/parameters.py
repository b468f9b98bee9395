"""Parameters of the wind, the odor source, the gas sensors and the airflow sensors."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from systems.framework.parameters import (
    Angle,
    Duration,
    Length,
    NonNegativeLength,
    Parameters,
    Point,
    Positive,
    Time,
    with_preset,
)


class WindParameters(Parameters):
    """The wind. The paper prints only the range of its speed (Song 2011, 4.1)."""

    kind: Literal["uniform", "meandering", "jet"] = "meandering"
    """``uniform``: constant wind. ``meandering``: the velocity changes slowly, in the
    same way everywhere. ``jet``: the jet of a fan, which also meanders, and becomes
    wider and slower along its axis."""
    speed_m_s: float = Field(default=1.0, ge=0.0, le=20.0)
    """Mean speed, m/s. For a jet: mean speed at its outlet."""
    direction_deg: Angle = 0.0
    """Direction toward which the wind blows, CCW from the x axis of W, deg."""
    meander_intensity: float = Field(default=0.12, ge=0.0, le=1.0)
    """Standard deviation of each velocity component, divided by the mean speed."""
    meander_time_s: float = Field(default=8.0, ge=0.1, le=3_600.0)
    """Correlation time of the meandering, s."""
    jet_origin_m: Point = (-2.2, 0.0)
    """Position of the outlet of the jet in W, m."""
    jet_diameter_m: Length = 0.3
    """Diameter of the outlet of the jet, m."""
    jet_growth: float = Field(default=0.1, ge=0.0, le=1.0)
    """Growth of the half width of the jet per meter along its axis. At the half width,
    the speed is exp(-1/2) of the speed on the axis."""


class OdorParameters(Parameters):
    """The odor source. The paper prints no properties of it."""

    kind: Literal["puffs", "steady"] = "puffs"
    """``puffs``: single puffs. ``steady``: their mean (Song 2011, eq. 6)."""
    ratio_at_2_m: float = Field(default=0.76, ge=1e-3, le=0.999)
    """Strength of the source: mean ratio Rs/R0 of a gas sensor on the axis, 2 m
    downwind, in a wind of 1 m/s. The power law of the default sensor converts it to a
    concentration."""
    height_m: NonNegativeLength = 0.0
    """H, height of the source above the floor, m."""
    puffs_per_s: float = Field(default=16.0, ge=1.0, le=50.0)
    """Number of puffs released per second, 1/s. The model stores 320 puffs. Even at 50
    puffs per second, these puffs reach 6 m in a wind of 1 m/s."""
    level_growth: float = Field(default=0.12, ge=1e-3, le=1.0)
    """Growth of the horizontal spread of a puff per distance traveled."""
    upright_growth: float = Field(default=0.13, ge=1e-3, le=1.0)
    """Growth of the vertical spread of a puff per distance traveled. Also gamma_2 / u
    of the steady plume."""
    own_intensity: float = Field(default=0.1, ge=0.0, le=1.0)
    """Standard deviation of each component of a puff's own velocity, divided by the
    wind speed."""
    own_time_s: float = Field(default=2.0, ge=0.01, le=3_600.0)
    """Correlation time of a puff's own velocity, s."""
    mean_intensity: float = Field(default=0.197, ge=1e-3, le=1.0)
    """gamma_1 / u, growth of the horizontal spread of the steady plume. The default is
    the value of the default puffs in the default wind near the source. The value of the
    puffs 2 m downwind is about 0.19."""
    reach_m: float = Field(default=6.0, ge=0.5, le=1_000.0)
    """Distance from the source beyond which puffs are removed, m."""
    age_s: Time = 60.0
    """Time from the beginning of the release to the start of a run, s."""
    room_volume_m3: float | None = Field(default=None, ge=1.0, le=1e6)
    """Volume of a closed room, m^3. In a closed room, the odor also accumulates as a
    uniform background. null: an open room."""


GAS_SENSORS = 3

#: Time constants that replace those of the paper.
_PRESETS = {
    "song2011": {},
    # Values for the TGS2620 and ethanol in the table of GADEN.
    "tgs2620": {"response_s": 2.96, "recovery_s": 15.71},
}


class GasSensorParameters(Parameters):
    """Three TGS2620 sensors on arms of 20 cm, 120 deg apart (Song 2011, 2.1)."""

    preset: Literal["song2011", "tgs2620"] = "song2011"
    """Time constants of the paper, or of GADEN for the TGS2620."""
    positions_m: Annotated[tuple[Point, Point, Point], Strict(False)] = (
        (0.1, -0.1732),
        (-0.2, 0.0),
        (0.1, 0.1732),
    )
    """Positions of R1 (right front), R2 (rear) and R3 (left front) in B, m."""
    height_m: NonNegativeLength = 0.0
    """Height of the sensors above the floor, m."""
    exponent: Positive = 0.7155
    """Exponent in Rs/R0 = (1 + C/C1)^-exponent. The default is the value for ethanol in
    the table of GADEN."""
    response_s: Duration = 2.5
    """Time constant while the concentration grows, s. With the default, a reading
    reaches 95 % of its change in 7.5 s (2.3.3 prints 5 to 10 s)."""
    recovery_s: Duration = 5.8
    """Time constant while the concentration falls, s. With the default, a reading
    reaches 95 % of its change in 17.4 s (2.3.3 prints 15 to 20 s)."""
    noise: float = Field(default=0.003, ge=0.0, le=1.0)
    """Standard deviation of a reading, divided by the reading."""
    mismatch: float = Field(default=0.01, ge=0.0, le=0.1)
    """Relative standard deviation of R0 between sensors. Each sensor has a constant
    value."""
    slope_mismatch: float = Field(default=0.03, ge=0.0, le=0.15)
    """Relative standard deviation of the exponent between sensors. Each sensor has a
    constant value."""
    drift_per_h: float = Field(default=0.0, ge=-0.03, le=0.03)
    """Relative growth of all readings per hour, 1/h."""

    @model_validator(mode="before")
    @classmethod
    def _fill(cls, data: Any) -> Any:
        return with_preset(data, _PRESETS)


class AirflowParameters(Parameters):
    """The two hot wires. The paper prints no unit, no gain and no lobe."""

    gain_s_m: Positive = 3.0
    """k, reading of a sensor per m/s of wind from its most sensitive direction, s/m."""
    lobe: Literal["cosine", "crosswind"] = "cosine"
    """Directional sensitivity. ``cosine``: the wires are most sensitive to wind from 45
    deg to the left and to the right. ``crosswind``: the wires are parallel to the axis
    of the robot, next to a partition. Each wire measures the crosswind if it comes from
    the side of this wire, and a fifth of the wind along the axis."""
    noise: float = Field(default=0.02, ge=0.0, le=1.0)
    """Standard deviation of a reading, divided by the reading."""
