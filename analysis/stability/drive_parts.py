"""Part of the stability report about the loops of the guarded law on free floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.loops.drive_families import DRIVE_LOOPS, drive_families, drive_uncertainty
from analysis.loops.linear_plots import plot_bode, plot_nyquist
from analysis.loops.loop_margins import loop_margins
from analysis.loops.margin_results import LoopMargins
from analysis.report.criterion import Criterion
from analysis.report.section import Column, Content, Figure, Table
from analysis.stability.law_analysis import Part, Study
from analysis.stability.margin_parts import margin_criteria
from analysis.stability.requirements import REQUIRED


def _loops(study: Study) -> Sequence[LoopMargins]:
    scenario = study.scenario
    nominal = {p.name: (p.nominal, p.nominal) for p in drive_uncertainty(scenario)}
    families = drive_families(scenario)(nominal)
    return [
        loop_margins(replace(family.opened.model_of(np.empty(0)), name=f"L {name}"))
        for name, family in zip(DRIVE_LOOPS, families, strict=True)
    ]


def _show(data: Sequence[LoopMargins]) -> list[Content]:
    return [
        (
            "The guarded law plans a way and decides between driving, looking and "
            "backing off. It has no linear model as a whole. While it drives on free "
            "floor, far from its limits and without weaving, it consists of these "
            "loops: the speed by the distance to the target, the yaw rate across a "
            "straight way at cruise speed, and the heading at the target. The way does "
            "not change. The loops are cut at the command of speed or yaw rate. The "
            "guard does not intervene."
        ),
        Table.of(
            data,
            {
                "loop": lambda loop: loop.name[2:],
                Column("crossover", "rad/s"): "crossover_rad_s",
                Column("phase", "deg"): "phase_margin_deg",
                Column("gain", "dB"): "gain_margin_db",
                "disk": "disk.alpha",
                "M_s": "sensitivity_peak",
                Column("delay", "s"): "delay_margin_s",
            },
            "Margins",
        ),
        Figure(lambda: plot_bode(data), "Bode diagram with margins."),
        Figure(lambda: plot_nyquist(data), "Nyquist curves."),
    ]


DRIVE = Part[Sequence[LoopMargins]](
    "drive",
    "Loops on free floor",
    _loops,
    _show,
    criteria=(
        *margin_criteria(lambda data: data),
        Criterion(
            "least delay margin", "s", "at least", REQUIRED.delay_margin_s,
            "it tolerates more added delay than the threshold",
            "less added delay than the threshold makes it oscillate",
            "set by this project; phase margin divided by crossover frequency",
            lambda data: min(loop.delay_margin_s for loop in data),
        ),
    ),
    document=lambda data: {each.name[2:]: each.document() for each in data},
)  # fmt: skip
