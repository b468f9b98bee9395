"""What a run did: metrics, pictures, replay, its files."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.runs.collision_warning import collision_warning
    from analysis.runs.guarded_motion import GuardedMotion, guarded_motion
    from analysis.runs.known_space import KnownSpace, known_space
    from analysis.runs.metrics import run_metrics
    from analysis.runs.proximity import Proximity
    from analysis.runs.run_report import run_summary, summary_text, write_run
    from analysis.runs.shortest_path import shortest_path_length
    from analysis.runs.smoothness import (
        jerk,
        log_dimensionless_jerk,
        spectral_arc_length,
        turn_reversals,
    )
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "GuardedMotion",
    "KnownSpace",
    "Proximity",
    "collision_warning",
    "guarded_motion",
    "jerk",
    "known_space",
    "log_dimensionless_jerk",
    "run_metrics",
    "run_summary",
    "shortest_path_length",
    "spectral_arc_length",
    "summary_text",
    "turn_reversals",
    "write_run",
]
