"""Formats the results of falsification as JSON documents and as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from analysis.reporting.provenance import SCHEMA_VERSION, versions
from analysis.safety.driver_trials import Outcome, Row, Trial
from analysis.safety.falsification import Found, largest_rate
from analysis.safety.guard_cost import TickCost
from analysis.safety.long_runs import LongRun, summary_table
from systems.framework.signals import TICK_S

_KINDS = ("layout", "driver", "setting")


def falsification_summary(found: Sequence[Found], seed: int) -> dict[str, Any]:
    """Builds the JSON document of short runs.

    Args:
        found: Results of the runs.
        seed: Seed of all random numbers.

    Returns:
        Plain values: numbers of collisions by group, the nearest runs, and all
        collisions. Clearances are in m.
    """
    groups = {
        kind: {
            name: _counts([each for each in found if each.kinds[place] == name])
            for name in sorted({each.kinds[place] for each in found})
        }
        for place, kind in enumerate(_KINDS)
    }
    return {
        **_head(seed),
        **_counts(found),
        "groups": groups,
        "nearest": {
            "body": min(found, key=lambda each: each.clearance_m)._asdict(),
            "disc": min(found, key=lambda each: each.disc_m)._asdict(),
        },
        "collided": [each._asdict() for each in found if each.collided],
    }


def _head(seed: int) -> dict[str, Any]:
    return {"schema_version": SCHEMA_VERSION, "versions": versions(), "seed": seed}


def _counts(found: Sequence[Found]) -> dict[str, Any]:
    hits = sum(each.collided for each in found)
    return {
        "runs": len(found),
        "collisions": hits,
        "largest_rate": largest_rate(hits, len(found)),
        "clearance_m": min(each.clearance_m for each in found),
        "disc_m": min(each.disc_m for each in found),
    }


def falsification_text(summary: dict[str, Any]) -> str:
    """Formats the document of short runs for a terminal."""
    lines = []
    for kind, groups in summary["groups"].items():
        lines.append(f"by {kind}:")
        lines += [_line(name, counts) for name, counts in groups.items()]
    lines.append(_line("all", summary))
    for what, each in summary["nearest"].items():
        lines.append(f"least clearance of the {what}: {_run_text(each)}")
    lines += [f"collision: {_run_text(each)}" for each in summary["collided"]]
    return "\n".join(lines)


def _line(name: str, counts: dict[str, Any]) -> str:
    return (
        f"{name:<24} {counts['runs']:>7} runs, {counts['collisions']} collisions "
        f"(below {100.0 * counts['largest_rate']:.2g} %), least clearance of the body "
        f"{1e3 * counts['clearance_m']:.1f} mm, of the disc "
        f"{1e3 * counts['disc_m']:.1f} mm"
    )


def _run_text(run: dict[str, Any]) -> str:
    return (
        f"run {run['number']} ({', '.join(run['kinds'])}), clearance of the body "
        f"{1e3 * run['clearance_m']:.1f} mm, of the disc {1e3 * run['disc_m']:.1f} mm"
    )


def trial_summary(trial: Trial, outcome: Outcome, seed: int) -> dict[str, Any]:
    """Builds the JSON document of one trial.

    Args:
        trial: The repeated trial.
        outcome: Result of the trial.
        seed: Seed of all trials.

    Returns:
        Plain values. Clearances are in m, and commands have the fields of ``Row``.
    """
    tick_s = trial.fields.get("tick_s", TICK_S)
    rows = [Row(*row) for row in trial.table.reshape(-1, len(Row._fields)).tolist()]
    return {
        **_head(seed),
        "layout": trial.layout,
        "driver": trial.driver,
        "setting": trial.variant,
        "fields": trial.fields,
        "commands": [
            row._replace(end_s=row.end_s * tick_s, rate=row.rate / tick_s)._asdict()
            for row in rows
        ],
        **outcome._asdict(),
    }


def trial_text(summary: dict[str, Any]) -> str:
    """Formats the document of one trial for a terminal."""
    rows = [
        "  " + ", ".join(f"{name} {value:g}" for name, value in row.items())
        for row in summary["commands"]
    ]
    kinds = ", ".join(summary[kind] for kind in _KINDS)
    hit = "collision" if summary["collided"] else "no collision"
    end = (
        f"{hit}, clearance of the body {1e3 * summary['clearance_m']:.1f} mm, of the "
        f"disc {1e3 * summary['disc_m']:.1f} mm"
    )
    return "\n".join([kinds, f"fields {summary['fields']}", "commands:", *rows, end])


def long_summary(found: Mapping[int, Sequence[LongRun]], seed: int) -> dict[str, Any]:
    """Builds the JSON document of long runs.

    Args:
        found: Results of the runs by number of their job.
        seed: Seed of all random numbers and searches.

    Returns:
        Plain values: the number of contacts, and the fields of ``LongRun`` with the
        number of the job.
    """

    def told(job: int, run: LongRun) -> dict[str, Any]:
        swing = run.swing._asdict() if run.swing is not None else None
        contact_s = run.contact_s if math.isfinite(run.contact_s) else None
        own = {**run._asdict(), "swing": swing, "contact_s": contact_s}
        return {"job": job, **own}

    runs = [told(job, run) for job, own in found.items() for run in own]
    contacts = sum(run["contact_s"] is not None for run in runs)
    return {**_head(seed), "contacts": contacts, "runs": runs}


def long_text(found: Mapping[int, Sequence[LongRun]]) -> str:
    """Formats tables by driver and setting, and one line per contact."""
    runs = [run for own in found.values() for run in own]
    by = (("driver", "setting"), ("driver",), ("setting",))
    tables = [f"{summary_table(runs, names)}\n" for names in by]
    contacts = [
        f"contact in job {job}: {run}"
        for job, own in found.items()
        for run in own
        if math.isfinite(run.contact_s)
    ]
    return "\n".join([*tables, *contacts]).rstrip()


def cost_summary(costs: Sequence[TickCost]) -> dict[str, Any]:
    """Builds the JSON document of computing times per control period."""
    return {
        "schema_version": SCHEMA_VERSION,
        "versions": versions(),
        "costs": [each._asdict() for each in costs],
    }


def cost_text(costs: Sequence[TickCost]) -> str:
    """Formats computing times for a terminal, one line each."""
    lines = []
    for what, mean, p99, worst in costs:
        rest = "" if p99 is None else f", 99 % below {p99:.1f} ms, worst {worst:.1f} ms"
        time = f"{1e3 * mean:.0f} us" if p99 is None else f"{mean:.2f} ms"
        lines.append(f"{what}: {time} per tick{rest}")
    return "\n".join(lines)
