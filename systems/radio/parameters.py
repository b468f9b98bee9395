"""Parameters of the radio."""

from __future__ import annotations

from pydantic import Field

from systems.framework.parameters import Fraction, Parameters, Time


class RadioParameters(Parameters):
    """Latency, losses and levels. The paper prints none of them."""

    latency_s: Time = 0.05
    """Time from sending to reception, s. It is rounded to ticks, at least one tick."""
    loss: Fraction = 0.0
    """Probability that a frame is lost."""
    byte_error: Fraction = 0.0
    """Probability that a byte arrives with a wrong value."""
    level_at_1_m_dbm: float = Field(default=-42.4, ge=-150.0, le=50.0)
    """-A in eq. 8, level at a distance of 1 m, dBm. The default is an example in the
    data sheet of the CC2431."""
    path_loss_exponent: float = Field(default=2.5, ge=1.0, le=10.0)
    """n in eq. 8, exponent of the path loss."""
    fading_db: float = Field(default=4.0, ge=0.0, le=30.0)
    """Standard deviation of a measured level, dB."""
