"""Writes a run's result directory and its one-screen summary."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from analysis.reporting.plain_values import plain
from analysis.reporting.provenance import SCHEMA_VERSION, versions
from analysis.runs.metrics import run_metrics
from analysis.runs.proximity import Proximity
from diagrams import RunResult, build_sound_follower, dump_scenario

__all__ = ["run_summary", "summary_text", "write_run"]


def run_summary(result: RunResult, out: Path | None) -> dict[str, Any]:
    """The JSON document of a run."""
    collision = result.collision
    document = {
        "schema_version": SCHEMA_VERSION,
        "scenario": result.scenario.name,
        "law": result.scenario.law,
        "seed": result.scenario.seed,
        "cause": result.cause,
        "collision": collision
        and {
            "object": collision.object,
            "fault": collision.fault,
            "time_s": collision.time,
        },
        "metrics": run_metrics(result),
        "timing": {
            "wall_s": result.wall_s,
            "simulated_s": result.simulated_s,
            "real_time_factor": result.simulated_s / result.wall_s,
        },
        "versions": versions(),
        "out": str(out) if out is not None else None,
    }
    summary: dict[str, Any] = plain(document)
    return summary


def write_run(result: RunResult, summary: dict[str, Any], directory: Path) -> None:
    """Writes everything about a run into a directory that exists.

    ``scenario.yaml`` (effective, can be run again), ``summary.json``,
    ``trajectory.parquet``, ``trajectory.png``, ``time_series.png``,
    ``diagram.svg`` and ``replay.html``.
    """
    from analysis.runs.block_diagram import write_block_diagram
    from analysis.runs.replay import write_replay
    from analysis.runs.run_plots import plot_time_series, plot_trajectory

    (directory / "scenario.yaml").write_text(dump_scenario(result.scenario), "utf-8")
    (directory / "summary.json").write_text(
        json.dumps(summary, indent=2, allow_nan=False) + "\n"
    )
    result.trajectory.to_parquet(directory / "trajectory.parquet", index=False)
    plot_trajectory(result).savefig(directory / "trajectory.png", dpi=150)
    plot_time_series(result, Proximity(result).clearance).savefig(
        directory / "time_series.png", dpi=150
    )
    diagram = build_sound_follower(result.scenario).diagram
    write_block_diagram(diagram, directory / "diagram.svg")
    write_replay(result, directory / "replay.html")


def summary_text(result: RunResult, summary: dict[str, Any]) -> str:
    """The run on one screen."""
    metrics, timing = summary["metrics"], summary["timing"]
    hit = summary["collision"]
    by = f" with {hit['object']}, the {hit['fault']}'s fault" if hit else ""
    attraction, stop = result.scenario.attraction, result.scenario.stop
    rows = {
        "scenario": f"{summary['scenario']}: {result.scenario.description}",
        "law": f"{summary['law']}, seed {summary['seed']}",
        "ended": f"{summary['cause']}{by}, after {timing['simulated_s']:.1f} s",
        "least clearance": _metres(metrics["minimum_clearance_m"]),
        "distance at the end": _metres(metrics["final_distance_m"]),
        "follow distance": _metres(attraction.follow_distance_m),
        "following": _percent(metrics["following_fraction"])
        + f" of the time within {stop.following_band_m:.2f} m of it",
        "following error": _metres(metrics["following_error_rms_m"]) + " rms",
        "frames heard": f"{metrics['frames_with_sound_heard']} of "
        f"{metrics['frames_with_sound']} with sound; "
        f"{metrics['detections_with_range']} of {metrics['detections']} with a range",
        "position error": _metres(metrics["source_error_median_m"])
        + " median, "
        + _metres(metrics["source_error_p95_m"])
        + " at 95 %",
        "path length": _metres(metrics["path_length_m"]),
        "speed": f"{timing['real_time_factor']:.0f} times real time",
    }
    return "\n".join(f"{name:<21} {value}" for name, value in rows.items())


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} m"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.0f} %"
