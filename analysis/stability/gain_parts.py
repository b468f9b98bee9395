"""Part of the stability report that recommends gains and states what they cost."""

from __future__ import annotations

from analysis.design.attraction_search import (
    GainFigures,
    RecommendedGains,
    recommend_gains,
)
from analysis.reporting.section import Cell, Column, Content, Table
from analysis.stability.law_analysis import Part


def _show(data: RecommendedGains) -> list[Content]:
    t, today = data.requirements, data.today
    columns: list[Column | str] = [
        "K_r", "D_r", "damping ratio", Column("phase", "deg"), Column("gain", "dB"),
        "M_s", "disk", Column("delay", "s"), Column("lag", "m"), Column("to 2 %", "s"),
        Column("stiffest law", "N/m"),
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        ["Current gains"],
        _figures(today),
        ["Least D_r that meets all requirements"],
    ]
    rows += [
        _figures(choice.figures)
        if choice.figures
        else [choice.stiffness_n_m, "none", *([None] * 9)]
        for choice in data.choices
    ]
    return [
        (
            f"The requirements are a damping ratio of {t.damping_ratio:g}, a phase "
            f"margin of {t.phase_margin_deg:g} deg, a gain margin of "
            f"{t.gain_margin_db:g} dB, M_s of {t.sensitivity_peak:g}, a disk margin of "
            f"{t.disk_margin:.2f}, a delay margin of {t.delay_margin_s:g} s, at sensor "
            "and actuator, and rest before an obstacle with echoes that are "
            f"{t.spare_latency_ticks} tick late. The loop is the sampled loop of the "
            "attraction with motor lag; margins are the least in both directions. The "
            "lag is the distance of P behind the follow point of a source that moves "
            "like the source of this scenario. The stiffest law is the largest spring "
            "to obstacles with which P comes to rest."
        ),
        Table(columns, rows),
        data.advice,
    ]


def _figures(f: GainFigures) -> list[Cell]:
    return [
        f.stiffness_n_m, f.damping_n_s_m, f.damping_ratio, f.phase_margin_deg,
        f.gain_margin_db, f.sensitivity_peak, f.disk_margin, f.delay_margin_s,
        f.following_lag_m, f.settling_s, f.largest_law_stiffness_n_m,
    ]  # fmt: skip


RECOMMENDED_GAINS = Part[RecommendedGains](
    "recommended_gains",
    "Recommended gains",
    lambda study: recommend_gains(study.scenario),
    _show,
)
