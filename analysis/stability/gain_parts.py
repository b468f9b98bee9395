"""Parts of the stability report: contact limits and recommended gains."""

from __future__ import annotations

import math

from analysis.linear.contact_mode import ContactLimits, contact_limits
from analysis.reporting.html_page import Cell, figure_html, number, paragraph, table
from analysis.stability.chart_plots import plot_contact_limits
from analysis.stability.law_analysis import Part
from analysis.stability.recommended_gains import (
    GainFigures,
    RecommendedGains,
    recommend_gains,
)

__all__ = ["contact_parts", "gain_parts"]


def contact_parts() -> tuple[Part, ...]:
    """Largest springs before an obstacle."""
    return (
        Part(
            "contact_mode",
            "Contact mode",
            lambda study: contact_limits(study.scenario),
            _render_contact,
        ),
    )


def _render_contact(data: ContactLimits, name: str) -> list[str]:
    headings = ["motor lag (s)", *(f"{t} ticks" for t in data.latency_ticks)]
    rows: list[list[Cell]] = [
        [lag, *(float(value) for value in row)]
        for lag, row in zip(data.motor_lags_s, data.stiffness_n_m, strict=True)
    ]
    caption = (
        "Largest slope -df/dc of a law, N/m: K_0 of the conventional law (today "
        f"{number(data.stiffness_today_n_m)}), k_ref/e\u00b2 of the active law of 2019 "
        f"(today {number(data.reference_stiffness_today_n_m / math.e**2)})"
    )
    lag, ticks = data.today
    return [
        paragraph(
            "Before an obstacle the law's spring adds to K_r, while the damping is "
            "still D_r. The largest springs that come to rest, against the motors' lag "
            f"and the age of an echo (ticks of {data.tick_s * 1e3:g} ms). "
            f"This scenario: {lag:g} s and {ticks} ticks."
        ),
        table(headings, rows, caption=caption),
        figure_html(plot_contact_limits(data), name, "Limits of the contact mode."),
    ]


def gain_parts() -> tuple[Part, ...]:
    """Gains that meet the usual thresholds, and what they cost."""
    return (
        Part(
            "recommended_gains",
            "Recommended gains",
            lambda study: recommend_gains(study.scenario),
            _render_gains,
        ),
    )


def _render_gains(data: RecommendedGains, name: str) -> list[str]:
    t, today = data.thresholds, data.today
    headings = [
        "K_r", "D_r", "damping ratio", "phase (deg)", "gain (dB)", "M_s", "disk",
        "delay (s)", "lag (m)", "to 2 % (s)", "stiffest law (N/m)",
    ]  # fmt: skip
    rows: list[list[Cell]] = [["Today"], _figures(today), ["Least D_r that meets all"]]
    rows += [
        _figures(choice.figures)
        if choice.figures
        else [choice.stiffness_n_m, "none", *([None] * 9)]
        for choice in data.choices
    ]
    return [
        paragraph(
            f"Asked for: damping ratio {t.damping_ratio:g}, phase margin "
            f"{t.phase_margin_deg:g} deg, M_s {t.sensitivity_peak:g}, disk margin "
            f"{t.disk_margin:.2f}, at sensor and actuator, and rest before an obstacle "
            f"with echoes {t.spare_ticks} tick late. The loop is the attraction's, "
            "sampled, with motor lag; margins count both ways. Lag: how far P stays "
            "behind the follow point of a source that moves as this scenario's. "
            "Stiffest law: the largest spring to obstacles that comes to rest."
        ),
        table(headings, rows),
        paragraph(data.advice),
    ]


def _figures(f: GainFigures) -> list[Cell]:
    return [
        f.stiffness_n_m, f.damping_n_s_m, f.damping_ratio, f.phase_margin_deg,
        f.gain_margin_db, f.sensitivity_peak, f.disk_margin, f.delay_margin_s,
        f.following_lag_m, f.settling_s, f.largest_law_stiffness_n_m,
    ]  # fmt: skip
