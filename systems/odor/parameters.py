"""Parameters of the wind, of a source of odour and of what senses both."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
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
    """The wind; the paper prints only its range of speeds (Song 2011, 4.1)."""

    kind: Literal["uniform", "meandering", "jet"] = "meandering"
    """``uniform``: always the mean; ``meandering``: its velocity changes slowly,
    equally everywhere; ``jet``: the jet of a fan, which also meanders, widens and slows
    down."""
    speed_m_s: float = Field(default=1.0, ge=0.0, le=20.0)
    """Mean speed, of a jet at its outlet, m/s."""
    direction_deg: Angle = 0.0
    """Direction toward which it blows, deg CCW from the x axis of W."""
    meander_intensity: float = Field(default=0.12, ge=0.0, le=1.0)
    """Standard deviation of each component over the mean speed."""
    meander_time_s: float = Field(default=8.0, ge=0.1, le=3_600.0)
    """Correlation time of the meandering, s."""
    jet_origin_m: Point = (-2.2, 0.0)
    """Outlet of the jet in W, m."""
    jet_diameter_m: Length = 0.3
    """Diameter of the outlet, m."""
    jet_growth: float = Field(default=0.1, ge=0.0, le=1.0)
    """Growth of the half width, at which the speed is exp(-1/2), per meter."""


class OdorParameters(Parameters):
    """A source of odour; the paper prints nothing of it but that it smells."""

    kind: Literal["puffs", "steady"] = "puffs"
    """``puffs``: as they come; ``steady``: their mean, Song 2011, eq. 6."""
    ratio_at_2_m: float = Field(default=0.76, ge=1e-3, le=0.999)
    """Strength: mean ratio Rs/R0 of a gas sensor 2 m downwind on the axis in a wind of
    1 m/s; the sensor's power law converts it to a concentration."""
    height_m: NonNegativeLength = 0.0
    """H, above the floor, m."""
    puffs_per_s: float = Field(default=16.0, ge=1.0, le=50.0)
    """Puffs released per second, 1/s; 320 are kept, which reach 6 m at 1 m/s."""
    level_growth: float = Field(default=0.12, ge=1e-3, le=1.0)
    """Growth of a puff's horizontal spread with its travel."""
    upright_growth: float = Field(default=0.13, ge=1e-3, le=1.0)
    """Growth of a puff's vertical spread with its travel."""
    own_intensity: float = Field(default=0.1, ge=0.0, le=1.0)
    """Standard deviation of each component of a puff's own velocity over the speed of
    the wind."""
    own_time_s: float = Field(default=2.0, ge=0.01, le=3_600.0)
    """Correlation time of a puff's own velocity, s."""
    mean_intensity: float = Field(default=0.197, ge=1e-3, le=1.0)
    """gamma_1 / u of the mean. 0.197 is the value of the default puffs in the default
    wind close to the source; 2 m downwind their value is about 0.19."""
    reach_m: float = Field(default=6.0, ge=0.5, le=1_000.0)
    """Puffs farther from the source are left out, m."""
    age_s: Time = 60.0
    """Time since the beginning of the release when a run begins, s."""
    room_volume_m3: float | None = Field(default=None, ge=1.0, le=1e6)
    """Volume of a closed room, m^3, in which the odor accumulates evenly; null: an open
    room."""


GAS_SENSORS = 3

#: Time constants that differ from the paper's.
_PRESETS = {
    "song2011": {},
    # GADEN's table of the TGS2620, ethanol.
    "tgs2620": {"response_s": 2.96, "recovery_s": 15.71},
}


class GasSensorFaultParameters(Parameters):
    """A gas sensor that fails in a run, and how."""

    sensor: int = Field(default=1, ge=1, le=GAS_SENSORS)
    """R1 right front, R2 rear, R3 left front."""
    kind: Literal["dead", "stuck"] = "dead"
    """``dead``: it reads 1, clean air, without noise; ``stuck``: it repeats its last
    reading."""
    start_s: Time = 0.0
    """When that begins, s."""


class GasSensorParameters(Parameters):
    """Three TGS2620 on arms of 20 cm, 120 deg apart (Song 2011, 2.1)."""

    preset: Literal["song2011", "tgs2620"] = "song2011"
    """Time constants: those of the paper, or those of GADEN for the TGS2620."""
    positions_m: Annotated[tuple[Point, Point, Point], Strict(False)] = (
        (0.1, -0.1732),
        (-0.2, 0.0),
        (0.1, 0.1732),
    )
    """R1 right front, R2 rear, R3 left front, from the origin of B in its axes, m."""
    height_m: NonNegativeLength = 0.0
    """Above the floor, m."""
    exponent: Positive = 0.7155
    """Exponent in Rs/R0 = (1 + C/C1)^-exponent: ethanol in GADEN's table."""
    response_s: Duration = 2.5
    """Time constant where the gas grows, s: 95 % in 7.5 s (2.3.3: 5 to 10)."""
    recovery_s: Duration = 5.8
    """Time constant where the gas fades, s: 95 % in 17.4 s (2.3.3: 15 to 20)."""
    noise: float = Field(default=0.003, ge=0.0, le=1.0)
    """Standard deviation of a reading, as a share of it."""
    mismatch: float = Field(default=0.01, ge=0.0, le=0.1)
    """Mismatch of each sensor's R0, drawn once."""
    slope_mismatch: float = Field(default=0.03, ge=0.0, le=0.15)
    """Mismatch of each sensor's exponent, drawn once."""
    drift_per_h: float = Field(default=0.0, ge=-0.03, le=0.03)
    """Growth of all readings, as a share per hour, 1/h."""
    faults: Annotated[
        tuple[GasSensorFaultParameters, ...], Strict(False), Field(max_length=8)
    ] = ()
    """Sensors that fail in a run."""

    @model_validator(mode="before")
    @classmethod
    def _fill(cls, data: Any) -> Any:
        return with_preset(data, _PRESETS)

    @model_validator(mode="after")
    def _check(self) -> GasSensorParameters:
        failing = [fault.sensor for fault in self.faults]
        if len({*failing}) < len(failing):
            raise InputError(
                "faults",
                f"sensors {failing}: a sensor has two faults; keep one fault "
                "per sensor",
            )
        return self


class AirflowParameters(Parameters):
    """The two wires; unit, gain and direction pattern are not printed."""

    gain_s_m: Positive = 3.0
    """k: reading of a sensor per m/s of wind straight onto it, s/m."""
    lobe: Literal["cosine", "crosswind"] = "cosine"
    """``cosine``: each wire measures wind from a direction 45 deg to its side;
    ``crosswind``: wires along the robot's axis, next to a partition, measure the wind
    across if it comes from their side, and a fifth of the wind along them."""
    noise: float = Field(default=0.02, ge=0.0, le=1.0)
    """Standard deviation of a reading, as a share of it."""
