"""Tables of a comparison for a terminal, and the formats of their numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from analysis.comparison.cells import LawCell, Mean
from analysis.comparison.laws_in_pairs import Comparison, Pair
from analysis.comparison.paired_statistics import PairedMedian, PairedRate
from analysis.reporting.intervals import with_interval
from analysis.runs.metric_table import METRICS, Metric

#: Metrics whose paired differences are printed.
PAIRED = [name for name, metric in METRICS.items() if metric.paired and metric.shown]


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
    widths = [max(21, len(metric.label) + 2) for metric in columns]
    headings = "".join(
        f"{metric.label:>{wide}}" for metric, wide in zip(columns, widths, strict=True)
    )
    yield f"{'law':<{width}}{'success %':>17}{'collision %':>17}{headings}"
    for cell in cells:
        row = f"{cell.label:<{width}}{rate_text(cell.success):>17}"
        row += f"{rate_text(cell.collision):>17}"
        for metric, wide in zip(columns, widths, strict=True):
            row += f"{median_text(cell, metric):>{wide}}"
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


def median_columns(cells: Sequence[LawCell]) -> list[Metric]:
    """Metrics to show that at least one law has."""
    return [
        metric
        for name, metric in METRICS.items()
        if metric.shown and any(name in cell.metrics for cell in cells)
    ]


def counts_text(counts: Mapping[str, int]) -> str:
    """Names, each with its count."""
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def rate_text(rate: Mean) -> str:
    """A rate in percent, with its confidence interval."""
    return with_interval(rate.estimate, rate.low, rate.high, ".0f", factor=100.0)


def median_text(cell: LawCell, metric: Metric) -> str:
    """A median of a law with its interval; a dash if there is none."""
    median = cell.metrics.get(metric.name)
    if median is None:
        return "-"
    return with_interval(median.median, median.low, median.high, f".{metric.digits}f")


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
