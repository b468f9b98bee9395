"""Parameters of the radio."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import Fraction, Parameters, Time


class RadioParameters(Parameters):
    """Latency, losses and levels; the paper prints none of them."""

    latency_s: Time = 0.05
    """Time from sending to reception, s; at least one tick."""
    loss: Fraction = 0.0
    """Share of the frames that do not arrive."""
    byte_error: Fraction = 0.0
    """Share of the bytes that arrive with a wrong value."""
    level_at_1_m_dbm: float = Field(default=-42.4, ge=-150.0, le=50.0)
    """-A of eq. 8, dBm (an example of the CC2431's data sheet)."""
    path_loss_exponent: float = Field(default=2.5, ge=1.0, le=10.0)
    """n of eq. 8."""
    fading_db: float = Field(default=4.0, ge=0.0, le=30.0)
    """Standard deviation of a level, dB."""
