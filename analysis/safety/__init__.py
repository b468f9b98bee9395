"""What a guard promises in a scenario, and by how much its assumptions hold."""

from analysis.safety.guarantees import (
    Assumption,
    Guarantees,
    clear_way,
    guarantees,
    seen_angle_deg,
)

__all__ = ["Assumption", "Guarantees", "clear_way", "guarantees", "seen_angle_deg"]
