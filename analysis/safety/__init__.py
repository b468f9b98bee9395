"""What a guard promises in a scenario, and by how much its assumptions hold."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.safety.guarantees import (
        Assumption,
        Guarantees,
        clear_way,
        guarantees,
        seen_angle_deg,
    )
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = ["Assumption", "Guarantees", "clear_way", "guarantees", "seen_angle_deg"]
