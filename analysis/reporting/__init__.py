"""What reports share: HTML, tables, plain values, intervals, result directories."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
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
else:
    __getattr__, __dir__ = lazy_exports(__name__)

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
