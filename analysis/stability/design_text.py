"""The design as tables for a terminal, and as files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from analysis.report.plain_values import plain, write_json
from analysis.report.provenance import SCHEMA_VERSION, versions
from analysis.stability.attraction_search import GainChoice
from analysis.stability.design_study import Alternative, DesignStudy
from analysis.stability.requirements import Check
from diagrams import dump_scenario


def design_text(study: DesignStudy) -> str:
    """Returns requirements, gains and checks of the design as text for a terminal."""
    lines = [
        f"kinetic energy at top speed {study.kinetic_energy_j:.3f} J",
        "",
        (
            "K_0 of the conventional law, N/m, that stops P before an obstacle with "
            "the follow point behind it:"
        ),
    ]
    lines += [
        f"  {row.meters_to_go:3.1f} m behind  {row.stiffness_n_m:5.1f}   "
        f"({row.stiffness_from_reach_n_m:.1f} without the speed limit)"
        for row in study.barriers
    ]
    limits = ", ".join(f"{limit:.1f}" for limit in study.contact_limits_n_m)
    lines += [
        (f"stable in contact with echoes 0, 1, 2, 4 ticks old: up to {limits} N/m")
    ]
    lines += ["", "Current attraction", *_alternative_lines(study.today)]
    lines += ["", "Recommended attraction", *_alternative_lines(study.recommended)]
    lines += ["", "Least D_r that meets all requirements, for several K_r"]
    lines += [_choice_text(choice) for choice in study.gains.choices]
    lines += ["", study.gains.advice]
    return "\n".join(lines)


def _alternative_lines(alternative: Alternative) -> list[str]:
    attraction = alternative.scenario.follower.attraction
    gains = (
        f"  K_r {attraction.stiffness_n_m:g} N/m, D_r {attraction.damping_n_s_m:g} "
        f"N s/m, follow distance {attraction.follow_distance_m:g} m "
        f"(at least {alternative.follow_distance_m:g} m)"
    )
    figures = (
        f"  damping ratio {alternative.figures.damping_ratio:.2f}, phase margin "
        f"{alternative.figures.phase_margin_deg:.0f} deg, lag "
        f"{alternative.figures.following_lag_m:.2f} m, overshoot "
        f"{alternative.overshoot_m:.2f} m, target {alternative.meters_to_go:.1f} m "
        "behind the obstacle"
    )
    lines = [gains, figures]
    for law, runs in zip(alternative.laws, alternative.jams, strict=True):
        lines += [f"  {law.law}"]
        lines += [f"    {name:<26}{value:8g}" for name, value in law.gains.items()]
        lines += [f"    {_check_text(check)}" for check in law.checks]
        lines += [f"    {'jams':<26}{runs.jams:8d} of {sum(runs.causes.values())} runs"]
    return lines


def _choice_text(choice: GainChoice) -> str:
    found = choice.figures
    if found is None:
        return f"  K_r {choice.stiffness_n_m:g} N/m: no D_r"
    return (
        f"  K_r {found.stiffness_n_m:g} N/m: D_r {found.damping_n_s_m:g} N s/m, "
        f"damping ratio {found.damping_ratio:.2f}, lag {found.following_lag_m:.2f} m, "
        f"delay margin {found.delay_margin_s:.2f} s"
    )


def _check_text(check: Check) -> str:
    sign = ">=" if check.at_least else "<="
    told = "" if check.met else "   not met"
    if check.acceptable and not check.met:
        told = "   just missed because gains are rounded"
    unit = "" if check.unit == "1" else f" {check.unit}"
    value = 0.0 if math.isclose(check.value, 0.0, abs_tol=5e-4) else check.value
    return f"{check.name:<26}{value:8.3f} {sign} {check.bound:.3f}{unit}{told}"


def design_document(study: DesignStudy) -> dict[str, Any]:
    """Returns the JSON document of the design.

    The key ``out`` is for the directory of the design's files. It is None in the
    result; the caller sets it after choosing a directory.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": study.today.scenario.name,
        **plain(study),
        "versions": versions(),
        "out": None,
    }


def write_design(study: DesignStudy, document: dict[str, Any], directory: Path) -> None:
    """Writes the files of a design into an existing directory.

    - ``summary.json`` is the JSON document from ``design_document``.
    - ``scenario.yaml`` is the scenario with the current attraction, and with new gains
      of the laws.
    - ``recommended.yaml`` is the scenario with the recommended attraction, and with
      gains of the laws for this attraction.
    - ``design.png`` is the figure of ``plot_design``.
    - ``law_curves.png`` shows the forces of the laws in ``scenario.yaml``, for both
      forms of the velocity term.
    """
    from analysis.loops.law_curves import law_curves, plot_law_curves
    from analysis.loops.push_and_pull import DESIGNED_LAWS
    from analysis.stability.design_plots import plot_design

    write_json(document, directory / "summary.json")
    for name, alternative in (
        ("scenario", study.today),
        ("recommended", study.recommended),
    ):
        text = dump_scenario(alternative.scenario)
        (directory / f"{name}.yaml").write_text(text, "utf-8")
    plot_design(study).savefig(directory / "design.png", dpi=150)
    curves = []
    for term in ("printed", "closing"):
        scenario = study.today.scenario
        echoes = scenario.follower.collision_vector.model_copy(
            update={"velocity_term": term}
        )
        changed = scenario.with_robot(collision_vector=echoes)
        curves += law_curves(changed, DESIGNED_LAWS)
    plot_law_curves(curves).savefig(directory / "law_curves.png", dpi=150)
