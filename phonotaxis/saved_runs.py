"""Loads the result of a run from its result directory."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from analysis.report.provenance import SCHEMA_VERSION
from analysis.runs.recorded_run import RecordedRun
from diagrams.running.stop_rules import Collision
from diagrams.scenario.bodies import RecordedPath
from phonotaxis.runs import RunResult
from systems.framework.input_error import InputError
from systems.search.search_ending import SEARCH_REASONS

__all__ = ["load_run"]

_SUMMARY = "summary.json"
#: Beginning of the names of columns that the sink (the operator's computer) received.
_SINK = "sink_"


def load_run(directory: str | Path) -> RunResult:
    """Loads a finished run from its result directory, without running it again.

    Example: ``load_run("results/latest").plot()``.

    Args:
        directory: Result directory of ``phonotaxis simulate`` with one law, or of the
            method ``save`` of a run.

    Returns:
        Result of the run. The document, the table, and the pictures are those of the
        original result.

    Raises:
        InputError: The directory has no run, or its files do not belong together.
    """
    recorded, summary = RecordedRun.load(directory), _summary(Path(directory))
    scenario, columns = recorded.scenario, dict(recorded.robots)
    paths = {
        name: RecordedPath(
            own["t"],
            np.column_stack([own[key] for key in ("p_WB_x", "p_WB_y", "theta_WB")]),
        )
        for name, own in columns.items()
    }
    world = {
        f"{name}.{key.removeprefix(_SINK)}": values
        for name, own in columns.items()
        for key, values in own.items()
        if key.startswith(_SINK)
    }
    if world:
        world["t"] = recorded.time
    common: dict[str, Any] = {
        "wall_s": summary["timing"]["wall_s"],
        "engine": summary["engine"],
        "world": world,
    }
    robots = {}
    for name, own in columns.items():
        alone = scenario.of_robot(name)
        robots[name] = RunResult(
            scenario=alone,
            columns=dict(own),
            name=name,
            others=scenario.surroundings(name, paths),
            whole=None if alone is scenario else scenario,
            **_outcome(summary["robots"][name] if len(columns) > 1 else summary),
            **common,
        )
    if len(robots) == 1:
        return next(iter(robots.values()))
    ended = _outcome(summary)
    # The result of all robots has the name of the robot that ended the run.
    name = next(
        name
        for name, each in robots.items()
        if (each.cause, each.collision) == (ended["cause"], ended["collision"])
    )
    table = recorded.table
    return RunResult(
        scenario=scenario,
        columns={str(key): table[key].to_numpy() for key in table},
        name=name,
        several=robots,
        **ended,
        **common,
    )


def _summary(folder: Path) -> dict[str, Any]:
    """Reads the JSON document of a run."""
    file = folder / _SUMMARY
    try:
        summary: dict[str, Any] = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            "directory", f"{str(file)!r} cannot be read ({error}); run again"
        ) from None
    if summary.get("schema_version") != SCHEMA_VERSION or "cause" not in summary:
        raise InputError(
            "directory",
            f"{str(file)!r} is not the summary of a run by this version; run again",
        )
    return summary


def _outcome(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of the result about the end of the run, for one robot or the whole run."""
    hit = summary["collision"]
    reasons = {reason: float(number) for number, reason in SEARCH_REASONS.items()}
    return {
        "cause": summary["cause"],
        "collision": hit and Collision(hit["object"], hit["fault"], hit["time_s"]),
        "ended": reasons.get(summary.get("reason") or "", 0.0),
    }
