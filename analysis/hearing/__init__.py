"""How well sounds are located: bounds, trials, tables, and recordings."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.hearing.cramer_rao import LocalizationBound, position_bound
    from analysis.hearing.detection import detection_curve, false_alarms
    from analysis.hearing.estimation_errors import consistency
    from analysis.hearing.free_field import run_cell
    from analysis.hearing.localization import (
        LocalizationExperiment,
        prepare_localization,
    )
    from analysis.hearing.room_trials import draw_layouts, locate_bursts
    from analysis.hearing.sensitivity import predicted_std
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "LocalizationBound",
    "LocalizationExperiment",
    "consistency",
    "detection_curve",
    "draw_layouts",
    "false_alarms",
    "locate_bursts",
    "position_bound",
    "predicted_std",
    "prepare_localization",
    "run_cell",
]
