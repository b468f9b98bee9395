"""Parameters of the radio."""

from __future__ import annotations

from systems.framework.parameters import Fraction, Parameters, Time


class RadioParameters(Parameters):
    """Latency and losses. The paper prints none of them."""

    latency_s: Time = 0.05
    """Time from sending to reception, s. It is rounded to ticks, at least one tick."""
    loss: Fraction = 0.0
    """Probability that a frame is lost."""
