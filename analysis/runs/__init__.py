"""What a run did: metrics, pictures, replay, its files."""

from analysis.runs.collision_warning import collision_warning
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

__all__ = [
    "Proximity",
    "collision_warning",
    "jerk",
    "log_dimensionless_jerk",
    "run_metrics",
    "run_summary",
    "shortest_path_length",
    "spectral_arc_length",
    "summary_text",
    "turn_reversals",
    "write_run",
]
