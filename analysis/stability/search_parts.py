"""Parts of the stability report for a robot that searches step by step."""

from __future__ import annotations

from analysis.linear.heading_loop import HeadingLoopMargins, heading_loop_margins
from analysis.reporting.criterion import Criterion
from analysis.reporting.section import Column, Content, Table, number
from analysis.stability.law_analysis import Part, Study

_MARGINS = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"


def _heading_loop(study: Study) -> HeadingLoopMargins:
    scenario = study.scenario
    return heading_loop_margins(
        scenario.searcher.motor_driver,
        scenario.only.robot,
        scenario.only.plant.motor_lag_s,
        scenario.tick_s,
    )


def _show(data: HeadingLoopMargins) -> list[Content]:
    return [
        (
            "A searching robot stops, decides on a heading, and turns to it while it "
            "drives. The loop has a compass, a PID controller, pulse widths, motors "
            "and the heading that the wheels produce; PID output and motor duties are "
            "held over a tick. The loop is cut at the deviation of the heading. It is "
            "linear for deviations within L and within all limits; with a larger "
            "deviation the robot turns on the spot, more slowly than the linear loop "
            "would. Linear models do not cover steps, phases and finds: "
            "docs/searches.md states how often each occurs."
        ),
        Table.of(
            [data],
            {
                Column("crossover", "rad/s"): "crossover_rad_s",
                Column("phase margin", "deg"): "phase_margin_deg",
                Column("delay margin", "s"): "delay_margin_s",
                Column("delay margin", "ticks"): "delay_margin_ticks",
                Column("gain margin", "dB"): "gain_margin_db",
                Column("lost by sampling", "deg"): "phase_lost_deg",
            },
            f"With a tick of {number(1e3 * data.tick_s)} ms",
        ),
    ]


HEADING_LOOP = Part[HeadingLoopMargins](
    "heading_loop",
    "The loop of the heading",
    _heading_loop,
    _show,
    criteria=(
        Criterion(
            "phase margin of the heading", "deg", "at least", 45.0,
            "it turns to its heading without swinging",
            "it swings about its heading",
            _MARGINS,
            lambda data: data.phase_margin_deg,
        ),
        Criterion(
            "gain margin of the heading", "dB", "at least", 6.0,
            "the motors may be twice as strong",
            "motors of less than twice the nominal strength make it unstable",
            _MARGINS,
            lambda data: data.gain_margin_db,
        ),
        Criterion(
            "delay margin of the heading", "ticks", "at least", 4.0,
            "it tolerates more added ticks of delay than the threshold",
            "fewer added ticks of delay than the threshold make it oscillate",
            "set by this project",
            lambda data: data.delay_margin_ticks,
        ),
    ),
)  # fmt: skip
