"""Tables of a comparison for a terminal, and the formats of their numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from analysis.comparison.cells import LawCell, Mean
from analysis.comparison.laws_in_pairs import Comparison, Pair
from analysis.comparison.paired_statistics import PairedMedian, PairedRate
from analysis.reporting.intervals import with_interval


class MedianColumn(NamedTuple):
    """A column of the printed table that shows a median."""

    heading: str
    metric: str
    factor: float
    """Factor from the unit of the metric to the unit of the heading."""
    form: str
    """Format of the number."""


_COLUMNS = (
    MedianColumn("clearance cm", "minimum_obstacle_clearance_m", 100.0, ".1f"),
    MedianColumn("jerk m/s^3", "jerk_rms_m_s3", 1.0, ".2f"),
    MedianColumn("SPARC", "sparc", 1.0, ".2f"),
    MedianColumn("reacts m", "reaction_distance_m", 1.0, ".2f"),
    MedianColumn("error m", "following_error_rms_m", 1.0, ".2f"),
    MedianColumn("off the path m", "route_deviation_max_m", 1.0, ".2f"),
    MedianColumn("ripple rad/s", "yaw_ripple_rad_s", 1.0, ".3f"),
)
#: Metrics whose paired differences are printed.
PAIRED = ("minimum_obstacle_clearance_m", "jerk_rms_m_s3", "sparc")


def compare_text(
    summary: dict[str, Any], comparisons: dict[str, Comparison], pooled: Sequence[Pair]
) -> str:
    """Makes the tables of a comparison for a terminal.

    Args:
        summary: JSON document from ``compare_summary``.
        comparisons: Results of each scenario, by the scenario's name.
        pooled: Comparisons of each pair of control laws over all scenarios together.

    Returns:
        Lines of text, without a newline after the last line.
    """
    lines = [
        f"{summary['layouts']} layouts per scenario, seed {summary['seed']}",
        "Brackets are 95 % intervals.",
        (
            "Medians of clearance, reaction, path and ripple are of all runs, others "
            "of successes."
        ),
    ]
    for name, comparison in comparisons.items():
        lines += ["", name, *_cell_lines(comparison.cells)]
        lines += ["", *(line for pair in comparison.pairs for line in _pair_line(pair))]
    if len(comparisons) > 1:
        lines += ["", "all together", *(line for p in pooled for line in _pair_line(p))]
    lines += ["", "Example runs:"]
    for cell in summary["cells"]:
        lines += [
            f"  {example['command']}   ({example['cause']})"
            for example in cell["examples"]
        ]
    return "\n".join(lines)


def _cell_lines(cells: list[LawCell]) -> Iterator[str]:
    width = max(len("law"), *(len(cell.label) for cell in cells))
    columns = median_columns(cells)
    headings = "".join(f"{column.heading:>21}" for column in columns)
    yield f"{'law':<{width}}{'success %':>17}{'collision %':>17}{headings}"
    for cell in cells:
        row = f"{cell.label:<{width}}{rate_text(cell.success):>17}"
        row += f"{rate_text(cell.collision):>17}"
        for column in columns:
            row += f"{median_text(cell, column):>21}"
        yield row
    for cell in cells:
        yield f"  {cell.label}: {counts_text(cell.causes)}"
        if cell.mechanisms:
            yield f"      failures: {counts_text(cell.mechanisms)}"
    yield from warning_texts(cells)


def warning_texts(cells: Sequence[LawCell]) -> list[str]:
    """Lists the warnings of a scenario's runs.

    Args:
        cells: Summary of the runs of each control law.

    Returns:
        One line for each field with warnings. The line states the number of affected
        runs of each law, and the text of the first warning.
    """
    counts, messages = dict[str, list[str]](), dict[str, str]()
    for cell in cells:
        for each in cell.warnings:
            told = f"{each.runs} of {cell.runs} runs of {cell.label}"
            counts.setdefault(each.field, []).append(told)
            messages.setdefault(each.field, each.message)
    return [
        f"Warning in {', '.join(told)}: {field}: {messages[field]}"
        for field, told in counts.items()
    ]


def median_columns(cells: Sequence[LawCell]) -> list[MedianColumn]:
    """Columns of the medians that at least one law has."""
    return [
        column for column in _COLUMNS if any(column.metric in c.metrics for c in cells)
    ]


def counts_text(counts: Mapping[str, int]) -> str:
    """Names, each with its count."""
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def rate_text(rate: Mean) -> str:
    """A rate in percent, with its confidence interval."""
    return with_interval(rate.estimate, rate.low, rate.high, ".0f", factor=100.0)


def median_text(cell: LawCell, column: MedianColumn) -> str:
    """Writes a median of a control law with its confidence interval.

    Args:
        cell: Summary of the runs of the law.
        column: Metric of the median, and format of the numbers.

    Returns:
        The text; a dash if the law has no such median.
    """
    median, factor = cell.metrics.get(column.metric), column.factor
    if median is None:
        return "-"
    figures = median.median, median.low, median.high
    return with_interval(*figures, column.form, factor=factor)


def points_text(rate: PairedRate) -> str:
    """A difference of rates in percentage points, with its confidence interval."""
    figures = rate.difference, rate.low, rate.high
    return with_interval(*figures, "+.0f", factor=100.0)


def difference_text(median: PairedMedian | None) -> str:
    """The median of paired differences with its interval; a dash if there is none."""
    if median is None or median.difference is None:
        return "-"
    return f"{median.difference:+z.3f} ({median.low:+z.3f}, {median.high:+z.3f})"


def _pair_line(pair: Pair) -> Iterator[str]:
    """Differences, first minus second: of rates in points, then of paired metrics."""
    common = "".join(f", {value}" for value in pair.fields.values())
    text = f"{pair.first} less {pair.second}{common}:"
    for name, rate in (("success", pair.success), ("collision", pair.collision)):
        text += f" {name} {points_text(rate)} p {rate.p_value:.2g};"
    yield text
    parts = []
    for metric in PAIRED:
        median = pair.metrics.get(metric)
        if median is not None and median.difference is not None:
            parts.append(
                f"{metric} {difference_text(median)} p {median.p_value:.2g}, "
                f"{median.pairs} pairs"
            )
    if parts:
        yield "    " + "; ".join(parts)
