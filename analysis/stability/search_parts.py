"""Parts of the stability report for a robot that searches step by step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from analysis.linear.heading_loop import HeadingLoopMargins, heading_loop_margins
from analysis.reporting.html_page import bullets, number, paragraph, table
from analysis.stability.law_analysis import Part, Study
from analysis.stability.verdict_readings import Reading
from analysis.stability.verdicts import Criterion

_MARGINS = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"


def search_parts(left_out: Sequence[str]) -> tuple[Part, ...]:
    """Returns the part about the heading loop, and a list of parts that do not apply.

    Args:
        left_out: Titles of the parts for a robot that follows a sound. They do not
            apply to a search.

    Returns:
        Two parts, in the order of the report.
    """
    titles = tuple(left_out)
    return (
        Part("heading_loop", "The loop of the heading", _heading_loop, _render),
        Part("left_out", "Parts that do not apply", lambda _: titles, _render_left),
    )


def _heading_loop(study: Study) -> HeadingLoopMargins:
    scenario = study.scenario
    return heading_loop_margins(
        scenario.searcher.motor_driver,
        scenario.only.robot,
        scenario.only.plant.motor_lag_s,
        scenario.tick_s,
    )


def _render(data: HeadingLoopMargins, name: str) -> list[str]:
    return [
        paragraph(
            "A searching robot stops, decides on a heading, and turns to it while it "
            "drives. The loop has a compass, a PID controller, pulse widths, motors "
            "and the heading that the wheels produce; PID output and motor duties are "
            "held over a tick. The loop is cut at the deviation of the heading. It is "
            "linear for deviations within L and within all limits; with a larger "
            "deviation the robot turns on the spot, more slowly than the linear loop "
            "would. Linear models do not cover steps, phases and finds: "
            "docs/searches.md states how often each occurs."
        ),
        table(
            ["crossover (rad/s)", "phase margin (deg)", "delay margin (s)",
             "delay margin (ticks)", "gain margin (dB)", "lost by sampling (deg)"],
            [[data.crossover_rad_s, data.phase_margin_deg, data.delay_margin_s,
              data.delay_margin_ticks, data.gain_margin_db, data.phase_lost_deg]],
            caption=f"With a tick of {number(1e3 * data.tick_s)} ms",
        ),
    ]  # fmt: skip


def _render_left(data: Sequence[str], name: str) -> list[str]:
    return [
        paragraph(
            "A search has no virtual mass, no springs and no equilibrium: the "
            "following parts, which are about robots that follow a sound, do not "
            "apply."
        ),
        bullets(list(data)),
    ]


def _of(name: str) -> Callable[[Study], Reading]:
    def read(study: Study) -> Reading:
        data = study.found.get("heading_loop")
        return (
            float(getattr(data, name))
            if data
            else ("the heading loop was not computed")
        )

    return read


#: Criteria for the heading loop, each with the function that reads its number.
SEARCH_CRITERIA: Mapping[Criterion, Callable[[Study], Reading]] = {
    Criterion(
        "phase margin of the heading", "deg", "at least", 45.0,
        "it turns to its heading without swinging",
        "it swings about its heading",
        _MARGINS,
    ): _of("phase_margin_deg"),
    Criterion(
        "gain margin of the heading", "dB", "at least", 6.0,
        "the motors may be twice as strong",
        "motors of less than twice the nominal strength make it unstable",
        _MARGINS,
    ): _of("gain_margin_db"),
    Criterion(
        "delay margin of the heading", "ticks", "at least", 4.0,
        "four more ticks of delay do no harm",
        "fewer than four more ticks of delay make it oscillate",
        "set by this project: four ticks",
    ): _of("delay_margin_ticks"),
}  # fmt: skip
