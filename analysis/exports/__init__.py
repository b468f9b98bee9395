"""Runs for other programs: what columns mean, CSV, and MCAP of ROS 2 messages."""

from analysis.exports.columns import COLUMNS, Column, column_of, columns
from analysis.exports.mcap_file import require_mcap, write_mcap
from analysis.exports.recorded_run import RecordedRun

__all__ = [
    "COLUMNS",
    "Column",
    "RecordedRun",
    "column_of",
    "columns",
    "require_mcap",
    "write_mcap",
]
