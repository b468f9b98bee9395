"""Writes the localization experiment as a JSON document, as tables and as files."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from analysis.arrays.localization import LocalizationCell, LocalizationExperiment
from analysis.arrays.sensitivity import sensitivity_table
from analysis.arrays.single_frames import frame_estimator
from analysis.report.plain_values import write_json
from analysis.report.provenance import SCHEMA_VERSION, versions
from diagrams import write_scenario

_ERROR_NAMES = {
    "position_m": "1 mm",
    "delay_s": "1 us",
    "sound_speed_share": "1 % of c",
    "gain_db": "1 dB",
}


def localization_document(
    experiment: LocalizationExperiment,
    cells: Sequence[LocalizationCell],
) -> dict[str, Any]:
    """Builds the JSON document of the localization experiment.

    ``out`` is None until the files have a directory.
    """
    scenario, shape = experiment.scenario, experiment.shape
    microphones, c = scenario.follower.microphones, scenario.sound_speed_m_s
    # Without limits, the table also shows large range errors due to array errors.
    estimate = frame_estimator(scenario.follower.tdoa, shape, c, limited=False)
    return {
        "schema_version": SCHEMA_VERSION,
        "seed": scenario.seed,
        "sound": scenario.source.sound.kind,
        "snr_db_at_1m": microphones.snr_db_at_1m,
        "tolerances": experiment.tolerances._asdict(),
        "cells": [cell.to_dict() for cell in cells],
        "sensitivity": sensitivity_table(
            experiment.places,
            shape,
            c,
            estimate,
            trials=experiment.trials,
            seed=scenario.seed,
        ),
        "versions": versions(),
        "out": None,
    }


def write_localization(
    experiment: LocalizationExperiment,
    cells: Sequence[LocalizationCell],
    summary: dict[str, Any],
    directory: Path,
) -> None:
    """Writes ``scenario.yaml``, ``summary.json`` and ``localization.png``."""
    from analysis.arrays.localization_plots import plot_localization

    write_scenario(experiment.scenario, directory)
    write_json(summary, directory / "summary.json")
    plot_localization(cells).savefig(directory / "localization.png", dpi=150)


def localization_text(summary: dict[str, Any]) -> str:
    """Formats the tables for a terminal."""
    tolerances = summary["tolerances"]
    drawn = any(tolerances.values())
    cells = summary["cells"]
    lines = [
        f"{cells[0]['trials']} frames per cell, {summary['sound']}, "
        f"{summary['snr_db_at_1m']:g} dB over the noise at 1 m, "
        + (_tolerances_text(tolerances) if drawn else "no errors of the array"),
        "Han 2019: on hardware; paper: its estimator here; (n): frames without result",
    ]
    for name, unit in (("range", "m"), ("bearing", "deg")):
        lines += ["", *_table(cells, name, unit)]
    lines += ["", *_sensitivity_lines(summary["sensitivity"])]
    return "\n".join(lines)


def _tolerances_text(tolerances: dict[str, float]) -> str:
    return (
        f"every frame with errors within {1e3 * tolerances['position_m']:g} mm, "
        f"{1e6 * tolerances['delay_s']:g} us and "
        f"{100.0 * tolerances['sound_speed_share']:g} % of c"
    )


def _table(cells: list[dict[str, Any]], name: str, unit: str) -> list[str]:
    """Formats mean and standard deviation by position, in one column per estimator."""
    places = _by_place(cells)
    titles = "".join(f"{cell['estimator']:>18}" for cell in places[0])
    heading = f"{name} in {unit}"
    lines = [
        f"{heading:<18}{'Han 2019':>13}{titles}{'bound':>9}{'tolerance':>11}",
        f"{'':<18}{'mean std':>13}" + f"{'mean std':>18}" * len(places[0]),
    ]
    for group in places:
        first = group[0]
        mean, std = (first["paper"][f"{name}_{x}_{unit}"] for x in ("mean", "std"))
        row = f"{_place(first)}{f'{mean:.2f} {std:.2f}':>13}"
        for cell in group:
            lost = cell["unheard"] + (cell["rangeless"] if name == "range" else 0)
            mean, std = (cell[f"{name}_{x}_{unit}"] for x in ("mean", "std"))
            row += f"{_pair(mean, std, lost):>18}"
        bound, tolerance = (first[f"{x}_{name}_{unit}"] for x in ("bound", "tolerance"))
        lines.append(f"{row}{bound:9.4f}{tolerance:11.4f}")
    return lines


def _by_place(rows: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """Groups rows by the position of the source."""
    groups = groupby(rows, lambda row: (row["range_m"], row["bearing_deg"]))
    return [list(group) for _, group in groups]


def _place(row: dict[str, Any]) -> str:
    return f"{row['range_m']:4.0f} m {row['bearing_deg']:5.0f} deg  "


def _pair(mean: float | None, std: float | None, lost: int) -> str:
    """Formats mean and standard deviation, with the lost frames' number in brackets."""
    missing = f" ({lost})" if lost else ""
    if mean is None:
        return f"none{missing}"
    spread = "-" if std is None else f"{std:.4f}"
    return f"{mean:z.3f} {spread}{missing}"


def _sensitivity_lines(rows: list[dict[str, Any]]) -> list[str]:
    """Formats the effect of each unit error: predicted, with measured in brackets."""
    places = _by_place(rows)
    lines = ["What errors of the array cost: predicted (measured)"]
    for name, unit in (("range", "m"), ("bearing", "deg")):
        heading = f"{name} in {unit}"
        titles = "".join(f"{_ERROR_NAMES[row['error']]:>17}" for row in places[0])
        lines += ["", f"{heading:<18}{titles}"]
        for group in places:
            costs = (_cost(row, name, unit) for row in group)
            lines.append(_place(group[0]) + "".join(f"{cost:>17}" for cost in costs))
    return lines


def _cost(row: dict[str, Any], name: str, unit: str) -> str:
    measured = row[f"measured_{name}_{unit}"]
    told = "infinite" if measured is None else f"{measured:.3f}"
    return f"{row[f'predicted_{name}_{unit}']:.3f} ({told})"
