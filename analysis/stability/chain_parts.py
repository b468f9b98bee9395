"""Part of the stability report about robots that follow one another on routes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from analysis.report.criterion import Criterion, Reading
from analysis.report.plain_values import pick
from analysis.report.section import Cell, Column, Content, Figure, Table, number
from analysis.routes.chain_run import (
    BrakedChain,
    ChainRun,
    brake_chain,
    shake_chain,
)
from analysis.routes.robot_chain import ROBOTS, RobotChain, robot_chain
from analysis.routes.trajectory_plots import (
    plot_braked_chains,
    plot_chain,
)
from analysis.stability.law_analysis import Part, Study


@dataclass(frozen=True)
class ChainStudy:
    """Frequency responses of a chain of robots, and simulations of the same chain."""

    chain: RobotChain
    runs: tuple[ChainRun, ...]
    braked: tuple[BrakedChain, ...]


def _chain(study: Study) -> ChainStudy:
    scenario = study.scenario
    chain = robot_chain(scenario)
    kinds = chain.peaks.items()
    return ChainStudy(
        chain,
        tuple(shake_chain(scenario, name, peak) for name, peak in kinds),
        tuple(
            brake_chain(
                scenario, name, feed_forward=peak.feed_forward, spacing_m=peak.spacing_m
            )
            for name, peak in kinds
        ),
    )


def _chain_document(data: ChainStudy) -> dict[str, Any]:
    chain = data.chain
    return {
        **pick(
            chain, "stiffness_n_m", "damping_n_s_m", "least_damping_n_s_m",
            "least_damping_in_contact_n_s_m", "most_feed_forward", "time_headway_s",
        ),
        "chains": [
            {
                "name": name,
                **pick(peak, "feed_forward", "spacing_m", "peak", "frequency_rad_s",
                       "grows", "tail"),
                **pick(run, "simulated", "predicted", "difference"),
                **pick(braked, "least_gap_m", "overshoot_m"),
            }
            for (name, peak), run, braked in zip(
                chain.peaks.items(), data.runs, data.braked, strict=True
            )
        ],
    }  # fmt: skip


def _show_chain(data: ChainStudy) -> list[Content]:
    chain = data.chain
    rows: list[list[Cell]] = [
        [
            kind,
            peak.spacing_m,
            peak.peak,
            *(peak.tail[n] for n in ROBOTS[1:]),
            run.difference,
            "grows" if peak.grows else "does not grow",
        ]
        for (kind, peak), run in zip(chain.peaks.items(), data.runs, strict=True)
    ]
    brakes: list[list[Cell]] = [
        [run.name, *(1e3 * value for value in run.overshoot_m.tolist())]
        for run in data.braked
    ]
    lengths = [f"{n} robots" for n in ROBOTS]
    pairs = range(1, len(data.braked[0].overshoot_m) + 1)
    return [
        (
            "Robots like this one drive on a line by the same law. The target of each "
            "robot is a place behind its predecessor, with feed-forward of the "
            "predecessor's velocity or without it. The object sensors are exact. In "
            "contact the zones of neighbors meet, and the neighbors push each other. "
            "The amplification is the amplitude of the last robot over the amplitude "
            "of the first robot, at the frequency where this ratio is largest. The "
            "safety filter does not intervene."
        ),
        Table(
            [
                "chain",
                Column("spacing", "m"),
                *lengths,
                "error of simulation",
                "a disturbance",
            ],
            rows,
            "Amplification from the first to the last robot",
        ),
        _of_chain(chain),
        Table(
            ["chain", *(f"robots {k} and {k + 1}" for k in pairs)],
            brakes,
            "How far each gap falls below its final value, mm, when the first robot "
            "brakes from the target's speed to rest",
        ),
        Figure(
            lambda: plot_chain(chain, data.runs),
            "Left: amplification by a pair of robots over frequency. Middle: eight "
            "robots at the frequency where their chain amplifies most, or at a "
            "robot's natural frequency if nothing grows. Right: a pair out of "
            "contact, over D.",
        ),
        Figure(
            lambda: plot_braked_chains(data.braked),
            "Gaps after the first robot has braked.",
        ),
    ]


def _of_chain(chain: RobotChain) -> str:
    growing = [name for name, peak in chain.peaks.items() if peak.grows]
    calm = [name for name in chain.peaks if name not in growing]
    text = ""
    if growing:
        text += (
            "A disturbance grows along the chain in these cases: "
            f"{'; '.join(growing)}. "
        )
    if calm:
        text += f"It does not grow in these cases: {'; '.join(calm)}. "
    text += (
        "Out of contact, with feed-forward of the predecessor's whole velocity, it "
        "grows for every D, because |G| is above 1 at low frequency. Without "
        f"feed-forward it does not grow at K = {number(chain.stiffness_n_m)} N/m if D "
        f"is at least {number(chain.least_damping_n_s_m)} N s/m (in contact at least "
        f"{number(chain.least_damping_in_contact_n_s_m)} N s/m), but then gaps grow "
        f"by D/K = {number(chain.time_headway_s)} s times the speed."
    )
    if chain.most_feed_forward >= 0.0:
        share = 100.0 * chain.most_feed_forward
        text += (
            f" Up to {number(share, 3)} % of the velocity may be fed forward without "
            "growth."
        )
    return text


def _amplification(name: str, where: str, good: str, bad: str) -> Criterion[ChainStudy]:
    def read(data: ChainStudy) -> Reading:
        peaks = data.chain.peaks
        return max(peaks[name].each) if name in peaks else "there are no contacts"

    return Criterion(
        f"chain amplification {where}", "", "at most", 1.0 + 1e-6, good, bad,
        "l2 string stability: no frequency is amplified; 1e-6 allows for rounding",
        read,
    )  # fmt: skip


ROBOT_CHAIN = Part[ChainStudy](
    "robot_chain",
    "Robots that follow one another",
    _chain,
    _show_chain,
    criteria=(
        *(
            _amplification(
                where,
                where,
                "no robot swings more than the first robot if each follows its "
                "predecessor",
                "a disturbance grows from robot to robot along the chain",
            )
            for where in ("with feed-forward", "without feed-forward")
        ),
        _amplification(
            "in contact, without feed-forward",
            "in contact",
            "where zones of neighboring robots meet, no robot swings more than the "
            "first robot",
            "where zones of neighboring robots meet, a disturbance grows along the "
            "chain",
        ),
    ),
    document=_chain_document,
)
