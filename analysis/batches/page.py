"""Makes the HTML page of a batch: endings, rates, metrics, pairs, and commands."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from analysis.batches.batch import MOST_CELLS, REPORT, SUMMARY, Batch, Summary
from analysis.batches.cells import LEAST_BINS, by_cell, cell_label
from analysis.batches.examples import picture_files, write_examples
from analysis.batches.one_run import FAILED
from analysis.batches.plan import SweepPlan
from analysis.batches.plots import (
    COLORS,
    grid_axes,
    is_number,
    plot_cells,
    plot_heat_maps,
    plot_panels,
    split_field,
)
from analysis.batches.report import (
    counts_text,
    estimate_rows,
    pair_rows,
    robot_rows,
    run_command,
    turn_rows,
    warning_lines,
)
from analysis.report.plain_values import write_json
from analysis.report.render import heading, html, page
from analysis.report.section import (
    Cell as TableCell,
    Content,
    Definitions,
    Figure,
    Files,
    Note,
    Picture,
    Section,
    Table,
)
from analysis.runs.metric_table import METRICS
from diagrams.running.stop_rules import SUCCESSFUL

#: Limits that keep a page readable.
#: MOST_MAPS: greatest number of heat maps.
#: MOST_ERRORS: greatest number of commands for runs that raised an error.
#: MOST_OTHERS: greatest number of commands for each other cause of failure and cell.
MOST_MAPS, MOST_ERRORS, MOST_OTHERS = 12, 200, 3


def write_batch(batch: Batch, document: dict[str, Any]) -> None:
    """Writes the JSON document, the page and the examples to the batch's directory."""
    write_json(document, batch.out / SUMMARY)
    write_examples(batch)
    (batch.out / REPORT).write_text(batch_page(batch, document), "utf-8")


def batch_page(batch: Batch, document: dict[str, Any]) -> str:
    """Makes the HTML page of a batch.

    The page of a single sweep has a section for each kind of result. The page of a
    comparison has a section for each scenario. The page shows the pictures and replays
    that exist in the directory of the batch.
    """
    parts: dict[str, Sequence[Content]] = {"Summary": _about(batch, document)}
    for k, (name, each) in enumerate(batch.summaries.items()):
        own = _scenario(batch, each, document, f"s{k}")
        if len(batch.summaries) == 1:
            parts |= own
        else:
            parts[name] = [
                *_warnings(each),
                Definitions(_plan_rows(each.plan, each.rows)),
                *(x for title, inner in own.items() for x in (heading(title), *inner)),
            ]
    if batch.pooled and len(batch.summaries) > 1:
        parts["All together"] = [_table(pair_rows(batch.pooled), _PAIRS)]
    anchors = {title: f"part{k}" for k, title in enumerate(parts)}
    return page(
        batch.title,
        [(anchors[title], title) for title in parts],
        [
            html(Section(anchors[title], title, inner), anchors[title])
            for title, inner in parts.items()
        ],
    )


#: Metrics on the page whose averages include only successful runs.
_OF_SUCCESSES = [
    metric.title
    for metric in METRICS.values()
    if metric.shown and metric.of == "successes"
]
_PAIRS = "Pairs of runs on the same layouts; differences, first less second"


def _scenario(
    batch: Batch, summary: Summary, document: dict[str, Any], prefix: str
) -> dict[str, list[Content]]:
    """Returns the parts of the page about one scenario, by title.

    Empty parts are omitted. The names of the figures begin with ``prefix``, because
    they must be unique on the page.
    """
    plan, rows = summary.plan, summary.rows
    few = plan.cell_count <= MOST_CELLS
    cells = {"How the runs ended": _endings(summary)}
    parts: dict[str, list[Content]] = {
        **(cells if few else {}),
        "Over the grid": _maps(plan, rows, prefix),
        "In pairs": [_table(pair_rows(summary.pairs), _PAIRS)] if summary.pairs else [],
        "Example runs": [
            *_examples(batch, summary, document),
            *_commands(batch, summary),
        ],
        # With several scenarios, the page would become too long.
        "Over the draws": _marginals(plan, rows) if len(batch.summaries) == 1 else [],
        **({} if few else cells),
    }
    return {title: inner for title, inner in parts.items() if inner}


def _about(batch: Batch, document: dict[str, Any]) -> list[Content]:
    plan = next(iter(batch.summaries.values())).plan
    draws = "all cells have equal" if plan.pair else "each cell has its own"
    count = sum(len(each.cells) for each in batch.summaries.values())
    rows = [
        ("Scenario", ", ".join(batch.summaries)),
        ("Runs", f"{document['runs']}: {plan.runs} in each of {count} cells"),
        ("Seed", f"{plan.seed}; {draws} draws"),
    ]
    parts: list[Content] = []
    if len(batch.summaries) == 1:
        (only,) = batch.summaries.values()
        rows += _plan_rows(only.plan, only.rows)
        parts += _warnings(only)
    hours = document["timing"]["simulated_s"] / 3600.0
    versions = document["versions"].items()
    rows += [
        ("Simulated", f"{hours:.2f} h"),
        ("Versions", ", ".join(f"{name} {version}" for name, version in versions)),
    ]
    return [
        *parts,
        Definitions(rows),
        (
            "Brackets and bars are 95 % intervals: Wilson's for rates, order "
            "statistics for medians. A run that raised an error counts as a run "
            "without success and without collision. The averages of "
            f"{', '.join(_OF_SUCCESSES[:-1])} and {_OF_SUCCESSES[-1]} include only "
            "successful runs; those of the "
            "other metrics include all runs without an error. "
            "`phonotaxis columns --metrics` describes each metric."
        ),
        Files([("summary.json", "the numbers of this page, for programs")]),
    ]


def _plan_rows(plan: SweepPlan, rows: pd.DataFrame) -> list[tuple[str, str]]:
    causes = rows["cause"].value_counts()
    draws = {key: _few(d.model_dump(exclude_none=True)) for key, d in plan.draw.items()}
    return [
        ("Ended", ", ".join(f"{count} {cause}" for cause, count in causes.items())),
        ("Set", _listed(plan.set)),
        ("Grid", _listed({key: list(v) for key, v in plan.grid.items()})),
        ("Draw", _listed(draws)),
        ("Drawn again", f"{int((rows['redraws'] > 0).sum())} runs"),
    ]


def _few(draw: dict[str, Any]) -> dict[str, Any]:
    """Shortens a long list of values that occur in turn."""
    values = draw.get("in_turn", ())
    if len(values) < 6:
        return draw
    return draw | {"in_turn": [values[0], f"{len(values) - 2} more", values[-1]]}


def _warnings(summary: Summary) -> list[Content]:
    return [Note(text) for text in warning_lines(summary)]


def _listed(fields: dict[str, Any]) -> str:
    pairs = [f"`{key}`: {json.dumps(value)}" for key, value in fields.items()]
    return "; ".join(pairs) or "nothing"


def _table(rows: Sequence[Sequence[str]], caption: str) -> Table:
    """Makes a table of texts, with true minus signs. Intervals stay on one line."""

    def whole(text: str) -> str:
        text = re.sub(r"(^|[ (e])-(?=\d)", "\\1\u2212", text)
        return text.replace(", ", ",\u00a0")

    body = [[row[0], *map(whole, row[1:])] for row in rows[1:]]
    return Table(rows[0], body, caption)


def _endings(summary: Summary) -> list[Content]:
    order = summary.rows["cause"].value_counts().index
    good = [cause for cause in SUCCESSFUL if cause in order]
    causes = [*good, *(cause for cause in order if cause not in good)]
    warned = ["with warnings"] if any(c.warnings for c in summary.cells) else []
    rows: list[list[TableCell]] = []
    for cell, runs in zip(
        summary.cells, by_cell(summary.plan, summary.rows), strict=True
    ):
        counts = [int((runs["cause"] == cause).sum()) for cause in causes]
        counts += [int((runs["warnings"] != "[]").sum()) for _ in warned]
        rows.append([cell.label, cell.runs, *counts])
    parts: list[Content] = [
        Table(["cell", "runs", *causes, *warned], rows, "Runs by cause"),
        _table(estimate_rows(summary), "Rates and metrics with 95 % intervals"),
    ]
    if robots := robot_rows(summary):
        parts.append(_table(robots, "Metrics of each robot with 95 % intervals"))
    if any(cell.mechanisms for cell in summary.cells):
        why = [
            (
                cell.label,
                counts_text(
                    {n: k for n, k in cell.causes.items() if n.startswith("collision")}
                )
                or "-",
                counts_text(cell.mechanisms) or "-",
            )
            for cell in summary.cells
        ]
        head = ["cell", "collisions, by fault", "why runs failed"]
        parts.append(Table(head, why, "Failures"))
    return parts


def _figure(figure: Drawing, name: str, caption: str, *, scale: bool = False) -> Markup:
    """Converts a figure to HTML. The name must be unique on the page."""
    return html(Figure(lambda: figure, caption, scale), name)


def _maps(plan: SweepPlan, results: pd.DataFrame, prefix: str) -> list[Content]:
    axes = grid_axes(plan)
    if not axes:
        return []
    if len(axes) == 1 and len(plan.grid) == 1:
        if any(isinstance(value, str) for value in plan.grid[axes[0]]):
            caption = f"Every metric for each `{axes[0]}`."
            return [_figure(plot_cells(plan, results), f"{prefix}cells", caption)]
        caption = f"Every metric over `{axes[0]}`."
        return [_figure(plot_panels(plan, results, axes[0]), f"{prefix}line", caption)]
    (x, y), others = _map_axes(plan)
    cases = [
        dict(zip(others, values, strict=True))
        for values in product(*(plan.grid[path] for path in others))
    ]
    for over, by in ((x, y), (y, x)):
        if is_number(plan, over) and len(plan.grid[by]) <= len(COLORS) and not others:
            figure = plot_panels(plan, results, over, by)
            caption = f"Every metric over `{over}`, with one curve per `{by}`."
            return [_figure(figure, f"{prefix}curves", caption)]
    maps: list[Content] = [
        _figure(
            plot_heat_maps(plan, results, x, y, rest),
            f"{prefix}map{k}",
            f"Every metric over `{x}` and `{y}`; lighter means more: "
            f"{cell_label(rest)}.",
            scale=True,
        )
        for k, rest in enumerate(cases[:MOST_MAPS])
    ]
    if len(cases) > MOST_MAPS:
        maps.append(f"{len(cases) - MOST_MAPS} further maps are left out.")
    return maps


def _map_axes(plan: SweepPlan) -> tuple[list[str], list[str]]:
    """Returns the two fields of the grid with the most values, and the other fields."""
    by_size = sorted(plan.grid, key=lambda path: -len(plan.grid[path]))
    chosen = [path for path in plan.grid if path in by_size[:2]]
    return chosen, [path for path in plan.grid if path not in chosen]


def _marginals(plan: SweepPlan, results: pd.DataFrame) -> list[Content]:
    return [
        _table(turn_rows(plan, results, key), f"Endings of the runs by `{key}`")
        if drawn.in_turn is not None
        else _figure(
            plot_panels(
                plan, results, key.partition(",")[0].strip(), split_field(plan)
            ),
            f"marginal{k}",
            f"Every metric over `{key}`, in bins with equal numbers of runs.",
        )
        for k, (key, drawn) in enumerate(plan.draw.items())
        # Lists of boxes are not numbers, and no list is drawn twice. Therefore the runs
        # cannot be sorted by them. Bins of a single run would show no dependence.
        if drawn.boxes is None
        if drawn.in_turn is not None or len(results) >= 2 * LEAST_BINS
    ]


def _examples(
    batch: Batch, summary: Summary, document: dict[str, Any]
) -> list[Content]:
    """Returns picture, commands, and existing replays of the examples of a scenario."""
    file = picture_files(batch)[summary.name]
    cells = [
        (cell, own)
        for cell, own in zip(
            summary.cells,
            (x for x in document["cells"] if x["scenario"] == summary.name),
            strict=True,
        )
        if own["examples"]
    ]
    if not cells:
        return []
    caption = "Worst, typical and best run of every cell, from above, in W."
    lines, replays = [], []
    for cell, own in cells:
        for example in own["examples"]:
            who = f"{cell.label}, {example['kind']}"
            lines.append((who, f"{example['cause']}: `{example['command']}`"))
            replay = str(Path(example["scenario_file"]).with_suffix(".html"))
            if (batch.out / replay).is_file():
                replays.append((replay, f"{who}, to watch"))
    shown = [Picture(file, caption)] if (batch.out / file).is_file() else []
    links = [Files(replays)] if replays else []
    return [*shown, Definitions(lines), *links]


def _commands(batch: Batch, summary: Summary) -> list[Content]:
    """Returns commands that repeat failed runs of each cause and cell.

    A failure is of more interest the fewer failures its cell has. In a cell, failures
    by the robot's own fault come first.
    """
    parts: list[Content] = ["Each command repeats one run and makes its replay."]
    cells = [
        (cell.label, runs)
        for cell, runs in zip(
            summary.cells, by_cell(summary.plan, summary.rows), strict=True
        )
    ]
    found = summary.rows["cause"].value_counts().index
    causes = [cause for cause in found if cause not in SUCCESSFUL]
    for cause in sorted(causes, key=lambda cause: cause != FAILED):
        failures = [(label, runs[runs["cause"] == cause]) for label, runs in cells]
        failures = [(label, runs) for label, runs in failures if len(runs)]
        most = MOST_ERRORS if cause == FAILED else MOST_OTHERS
        for label, runs in sorted(failures, key=lambda each: len(each[1])):
            shown = f"{most} of " if len(runs) > most else ""
            noun = "run" if len(runs) == 1 else "runs"
            where = f", {label}" if label else ""
            caption = f"{cause}{where}: {shown}{len(runs)} {noun}"
            chosen = runs.sort_values(
                "collision_fault", key=lambda fault: fault != "robot", kind="stable"
            )
            lines = [
                (
                    f"Run {row['index']}",
                    f"{_remark(row)}`{run_command(batch, summary.name, row)}`",
                )
                for row in chosen.head(most).to_dict("records")
            ]
            parts += [heading(caption), Definitions(lines)]
    return parts if causes else []


def _remark(row: dict[str, Any]) -> str:
    if row["cause"] == FAILED:
        return f"{row['error']}: "
    if row["cause"] == "collision":
        return f"{row['collision_object']}, fault of the {row['collision_fault']}: "
    return ""
