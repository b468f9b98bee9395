"""Summarizes a run as a JSON document, and as text that fits on one screen."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from analysis.report.plain_values import plain
from analysis.report.provenance import SCHEMA_VERSION, versions
from analysis.runs.guarded_motion import halts_of
from analysis.runs.metric_table import METRICS, run_metrics
from diagrams import RunResult
from diagrams.running.stop_rules import SUCCESSFUL
from systems.search.search_ending import fault_names


def run_document(result: RunResult) -> dict[str, Any]:
    """Returns the summary of a run as a JSON document.

    The key ``out``, the directory of the run, is None. The caller sets it later.
    """
    document = {
        "schema_version": SCHEMA_VERSION,
        "scenario": result.full_scenario.name,
        "law": result.full_scenario.law_names,
        "seed": result.full_scenario.seed,
        "engine": result.engine,
        **_outcome(result),
        "warnings": [asdict(each) for each in result.warnings],
        "metrics": run_metrics(result),
        "timing": {
            "wall_s": result.wall_s,
            "simulated_s": result.simulated_s,
            "real_time_factor": result.simulated_s / result.wall_s,
        },
        "versions": versions(),
        "out": None,
    }
    if result.several:
        document["robots"] = {
            name: {"law": own.scenario.only.law, **_outcome(own)}
            for name, own in result.several.items()
        }
    summary: dict[str, Any] = plain(document)
    return summary


def _outcome(result: RunResult) -> dict[str, Any]:
    hit = result.collision
    collision = hit and {"object": hit.object, "fault": hit.fault, "time_s": hit.time}
    halts = [asdict(halt) for halt in halts_of(result)]
    ended: dict[str, Any] = {
        "cause": result.cause,
        "collision": collision,
        "halts": halts,
    }
    if not result.several and result.scenario.only.searches is not None:
        faults = fault_names(result.columns["search_fault"][-1])
        ended |= {"reason": result.reason or None, "faults": faults}
    return ended


def run_text(result: RunResult, summary: dict[str, Any]) -> str:
    """Returns the summary of a run as text that fits on one screen."""
    return "\n".join(
        f"{name.split('.')[-1]:<21} {value}"
        for name, value in summary_rows(result, summary).items()
    )


def summary_rows(result: RunResult, summary: dict[str, Any]) -> dict[str, str]:
    """Returns the rows of a run's summary for the terminal, by name of the row.

    If there are several robots, the names of the rows about one robot begin with the
    name of this robot and a dot.
    """
    timing = summary["timing"]
    scenario = result.full_scenario
    alone = not result.several or result.cause in SUCCESSFUL
    who = "" if alone else f"{result.name}: "
    rows = {
        "scenario": f"{summary['scenario']}: {scenario.description}",
        "law": f"{summary['law']}, seed {summary['seed']}",
        "ended": f"{who}{_ended(result)}, after {timing['simulated_s']:.1f} s",
    }
    if not result.several:
        rows |= _robot_rows(result, summary["metrics"], "")
    rows["speed"] = f"{timing['real_time_factor']:.0f} times real time"
    for name, own in result.several.items():
        rows |= {f"{name}": f"{_ended(own)}, law {own.scenario.only.law}"}
        rows |= _robot_rows(own, summary["metrics"], f"{name}.")
    return rows


def _ended(result: RunResult) -> str:
    fault = f", the {result.collision.fault}'s fault" if result.collision else ""
    return f"{result.ending}{fault}"


def _robot_rows(
    result: RunResult, metrics: dict[str, Any], prefix: str
) -> dict[str, str]:
    """Returns the rows of one robot; ``prefix`` precedes names of rows and metrics."""
    robot, stop = result.scenario.only, result.scenario.stop

    def text(name: str) -> str:
        return METRICS[name].text(metrics[f"{prefix}{name}"])

    rows = {
        METRICS[name].title: text(name)
        for name in ("minimum_clearance_m", "final_distance_m", "path_length_m")
    }
    if robot.searches is not None:
        rows["steps"] = f"{text('search_steps')} in {text('search_time_s')}"
        rows[METRICS["path_efficiency"].title] = text("path_efficiency")
        if broken := fault_names(result.columns["search_fault"][-1]):
            rows["broken"] = ", ".join(broken)
    elif not result.full_scenario.drives_to_point(result.name):
        fraction = metrics[f"{prefix}following_fraction"]
        percent = "-" if fraction is None else f"{100.0 * fraction:.0f} %"
        rows |= {
            "follow distance": f"{robot.follow_distance_m:.3f} m",
            "following": f"{percent} of the time within {stop.following_band_m:.2f} m "
            "of it",
            "following error": f"{text('following_error_rms_m')} rms",
            "frames heard": f"{text('frames_with_sound_heard')} of "
            f"{text('frames_with_sound')} with sound; {text('detections_with_range')} "
            f"of {text('detections')} with a range",
            "position error": f"{text('source_error_median_m')} median, "
            f"{text('source_error_p95_m')} at 95 %",
        }
    if halts := halts_of(result):
        rows["halted by the guard"] = "; ".join(map(str, halts))
    return {f"{prefix}{name}": value for name, value in rows.items()}
