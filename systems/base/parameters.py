"""Parameters of motors, tires and wheel encoders."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from systems.framework.parameters import Duration, Parameters

_Slip = Annotated[float, Field(gt=-1.0, lt=1.0)]


class PlantParameters(Parameters):
    """Motors, encoders, and contact of the wheels with the floor."""

    motor_lag_s: Duration = 0.05
    """Time constant of each wheel's speed loop, s (not printed, our choice)."""
    slip: Annotated[tuple[_Slip, _Slip], Strict(False)] = (0.0, 0.0)
    """Shares of the rim speed that the left and the right wheel lose by slip. The
    encoders do not measure this loss. A negative share describes a wheel whose radius
    is larger than ``wheel_radius_m`` by this share."""
    friction: Annotated[float, Field(ge=1e-3, le=100.0)] | None = None
    """Coefficient of friction between tires and floor. If the motion needs more force
    than this share of the weight, the wheels slip. None: the wheels never slip."""
    pulses_per_revolution: Annotated[int, Field(gt=0, le=10_000_000)] | None = 2600
    """Pulses of each wheel's encoder per revolution (Han 2019, 4.1). The measured angle
    of a wheel is rounded to whole pulses. null: the measured angle is exact, which a
    linearization requires."""
