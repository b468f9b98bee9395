"""Runs for other programs: what columns mean, CSV, and MCAP of ROS 2 messages."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.exports.columns import COLUMNS, Column, column_of, columns
    from analysis.exports.mcap_file import require_mcap, write_mcap
    from analysis.exports.recorded_run import RecordedRun
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "COLUMNS",
    "Column",
    "RecordedRun",
    "column_of",
    "columns",
    "require_mcap",
    "write_mcap",
]
