"""Formats a calibration as text and as a JSON document, and writes its files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.calibrate import CalibrationRun, calibrated_fields
from analysis.arrays.observability import (
    CalibrationGain,
    gain_ratios,
    gains_nothing,
)
from analysis.report.plain_values import plain, write_json
from analysis.report.provenance import SCHEMA_VERSION
from diagrams.scenario.yaml_text import dump_yaml

# Most independent directions that a document lists.
_MOST_DIRECTIONS = 32

_UNITS = {
    "m": (1e3, "mm"),
    "rad": (180.0 / math.pi, "deg"),
    "s": (1e6, "us"),
    "1": (1e2, "%"),
}

_NOTHING = (
    "no gain: the array is not known better than before. A sound at an unknown place "
    "has {delays} delays for {unknowns} unknowns of its own; give position_m of "
    "sounds at known places"
)
_NOTHING_KNOWN = (
    "no gain: the array is not known better than before. The positions and delays of "
    "the sounds are less certain than the array; measure them better"
)


def calibration_text(run: CalibrationRun) -> str:
    """Formats the report of a calibration for a terminal."""
    calibration = run.calibration
    count, dimension = calibration.places.shape
    known = sum(sound.position is not None for sound in calibration.sounds)
    heard = f"{len(calibration.sounds)} sounds, {known} of them at stated positions"
    lines = [f"{heard}, and {count} microphones"]
    nothing = gains_nothing(calibration)
    if nothing:
        text = _NOTHING_KNOWN if known else _NOTHING
        lines.append(text.format(delays=count - 1, unknowns=dimension))
    for verdict in ("observable", "in part", "not observable"):
        told = [gain for gain in run.gains if gain.verdict == verdict]
        lines += [f"{verdict}: {_gain_text(run, gain)}" for gain in told]
    lines.append(_fit_text(run))
    if not calibration.settled and not nothing:
        lines.append("the search did not converge: do not rely on these numbers")
    if not nothing:
        lines += ["", f"speed of sound {calibration.c:.2f} m/s", *_places(run)]
    return "\n".join([*lines, "", *_sounds(run)])


def calibration_document(run: CalibrationRun) -> dict[str, Any]:
    """Builds the JSON document of ``phonotaxis calibrate``."""
    calibration = run.calibration
    ratios, directions = gain_ratios(calibration)
    told = min(len(ratios), _MOST_DIRECTIONS)
    misfit = run.misfit
    return {
        "schema_version": SCHEMA_VERSION,
        "geometry": plain(calibrated_fields(calibration, run.geometry)),
        "stated": plain(run.geometry),
        "gains_nothing": gains_nothing(calibration),
        "gains": [
            {**plain(gain), "ratio": gain.ratio, "verdict": gain.verdict}
            for gain in run.gains
        ],
        "directions": [
            {"ratio": float(ratio), "change": column.tolist()}
            for ratio, column in zip(ratios[:told], directions.T[:told], strict=True)
        ],
        "channel_delays_s": calibration.channel_delays.tolist(),
        "covariance": calibration.covariance.tolist(),
        "chi_square": calibration.chi_square,
        "freedom": calibration.freedom,
        "fits": misfit is None,
        "most_to_blame": None if misfit is None else plain(misfit),
        "settled": calibration.settled,
        "sounds": [_sound(run, j) for j in range(len(calibration.sounds))],
        "remarks": run.remarks,
    }


def write_calibration(document: dict[str, Any], folder: Path) -> None:
    """Writes ``calibration.json``, and ``array.yaml`` for ``load_geometry``."""
    write_json(document, folder / "calibration.json")
    text = dump_yaml(document["geometry"])
    (folder / "array.yaml").write_text(text, encoding="utf-8")


def _gain_text(run: CalibrationRun, gain: CalibrationGain) -> str:
    if gain.unit == "m/s":
        share = 100.0 / run.calibration.unknowns.c
        return f"{gain.name}: {gain.before * share:.2g} % -> {gain.after * share:.2g} %"
    factor, unit = _UNITS[gain.unit]
    return (
        f"{gain.name}: {gain.before * factor:.3g} {unit} -> "
        f"{gain.after * factor:.3g} {unit}"
    )


def _fit_text(run: CalibrationRun) -> str:
    calibration, misfit = run.calibration, run.misfit
    text = f"chi-square {calibration.chi_square:.0f} of {calibration.freedom}"
    if misfit is None:
        return f"{text}: sounds and geometry agree"
    name = f"{misfit.kind} {misfit.index + 1}"
    remedy = {
        "sound": "check its position_m, and that its recording has no other sound",
        "microphone": "check its place, or state a larger position_std_m for it",
        "channel": "check that all channels are sampled at once, or raise delay_std_s",
    }[misfit.kind]
    if misfit.kind == "sound":
        name = calibration.sounds[misfit.index].name or name
    without = f"{misfit.chi_square:.0f} of {misfit.freedom}"
    if not misfit.explains:
        return (
            f"{text}: sounds and geometry DO NOT AGREE; {name} fits worst, but "
            f"without it {without} remains: {remedy}, the order of channels, and all "
            "standard deviations"
        )
    return (
        f"{text}: sounds and geometry DO NOT AGREE; without {name} they agree, "
        f"{without}: {remedy}"
    )


def _places(run: CalibrationRun) -> list[str]:
    calibration = run.calibration
    dimension = calibration.places.shape[1]
    moved = calibration.places - calibration.unknowns.places
    stds = np.sqrt(np.diag(calibration.of_places)).reshape(moved.shape)
    head = "".join(f"  {axis + '/m':>9}" for axis in "xyz"[:dimension])
    lines = [f"microphone{head}  moved/mm  std/mm  late/us"]
    for k, place in enumerate(calibration.places):
        row = "".join(f"  {value:9.4f}" for value in place)
        lines.append(
            f"{k + 1:10d}{row}  {1e3 * np.linalg.norm(moved[k]):8.1f}"
            f"  {1e3 * math.sqrt(float(np.mean(stds[k] ** 2))):6.2f}"
            f"  {1e6 * calibration.channel_delays[k]:7.2f}"
        )
    return lines


def _sounds(run: CalibrationRun) -> list[str]:
    lines = ["sound  stretches  position    left/us  recording"]
    for j, sound in enumerate(run.calibration.sounds):
        heard = run.heard[j] if run.heard else None
        stretches = "-" if heard is None else f"{heard.used} of {heard.stretches}"
        known = "unknown" if sound.position is None else "stated"
        left = 1e6 * math.sqrt(float(np.mean(_residual(run, j) ** 2)))
        lines.append(
            f"{j + 1:5d}  {stretches:>9}  {known:8}  {left:9.2f}  {sound.name}"
        )
    return lines


def _sound(run: CalibrationRun, j: int) -> dict[str, Any]:
    calibration = run.calibration
    sound = calibration.sounds[j]
    return {
        "name": sound.name,
        "stretches": run.heard[j].stretches if run.heard else None,
        "used": run.heard[j].used if run.heard else None,
        "delays_s": sound.tau.tolist(),
        "delay_std_s": np.sqrt(np.diag(sound.covariance)).tolist(),
        "residual_s": _residual(run, j).tolist(),
        "position_m": plain(sound.position),
        "position_std_m": None if sound.position is None else sound.position_std,
        "position_found_m": plain(calibration.source_positions[j]),
    }


def _residual(run: CalibrationRun, j: int) -> NDArray[np.float64]:
    """(n - 1,) measured minus expected delays, s."""
    fit = run.calibration.fits[j]
    return np.asarray(np.linalg.solve(fit.root, fit.residual), dtype=np.float64)
