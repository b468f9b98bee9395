"""What reports share: HTML, tables, plain values, intervals, result directories."""

from analysis.reporting.intervals import (
    Interval,
    bootstrap_interval,
    median_interval,
    wilson_interval,
)
from analysis.reporting.palette import COLOURS
from analysis.reporting.plain_values import plain
from analysis.reporting.provenance import versions
from analysis.reporting.result_directory import ResultDirectory

__all__ = [
    "COLOURS",
    "Interval",
    "ResultDirectory",
    "bootstrap_interval",
    "median_interval",
    "plain",
    "versions",
    "wilson_interval",
]
