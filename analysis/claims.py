"""The papers' claims, held against the summary of a comparison.

``python -m analysis.claims docs/results/laws.json`` prints the table of
docs/claims.md.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = ["CLAIMS", "Claim", "claims_table"]

#: A collision rate up to this counts as free of collisions, a success rate above
#: its complement as success.
TOLERANCE = 0.05

STATIC, ONE, TWO = "two_static_obstacles", "one_moving_obstacle", "two_moving_obstacles"
FREE = "obstacle_free"


@dataclass(frozen=True)
class Claim:
    """What a paper says, and how our figures bear on it."""

    text: str
    source: str
    judge: Callable[[dict[str, Any]], tuple[str, str]]
    """From the summary to our figure and the verdict."""


def claims_table(summary: dict[str, Any]) -> str:
    """The table in Markdown: claim, source, our figure, verdict.

    Args:
        summary: JSON document of ``phonotaxis compare`` on the papers' four
            experiments with the laws conventional, active and active2017.
    """
    lines = ["| claim | source | our figure | verdict |", "|---|---|---|---|"]
    for claim in CLAIMS:
        figure, verdict = claim.judge(summary)
        lines.append(f"| {claim.text} | {claim.source} | {figure} | **{verdict}** |")
    return "\n".join(lines)


def _cell(summary: dict[str, Any], scenario: str, law: str) -> dict[str, Any]:
    return next(
        cell
        for cell in summary["cells"]
        if (cell["scenario"], cell["law"]) == (scenario, law)
    )


def _pair(
    summary: dict[str, Any], scenario: str, first: str, second: str
) -> dict[str, Any]:
    return next(
        pair
        for pair in summary["pairs"]
        if (pair["scenario"], pair["first"], pair["second"])
        == (scenario, first, second)
    )


def _percent(rate: dict[str, float]) -> str:
    low, high = 100.0 * rate["low"], 100.0 * rate["high"]
    return f"{100.0 * rate['estimate']:.1f} % ({low:.1f}, {high:.1f})"


def _points(rate: dict[str, Any]) -> str:
    low, high = 100.0 * rate["low"], 100.0 * rate["high"]
    return f"{100.0 * rate['difference']:+.1f} points ({low:+.1f}, {high:+.1f})"


def _shift(median: dict[str, Any], unit: str) -> str:
    return (
        f"{median['difference']:+.2f} {unit} ({median['low']:+.2f}, "
        f"{median['high']:+.2f}) in {median['pairs']} pairs"
    )


def _sign(interval: dict[str, Any]) -> int:
    """+1 or -1 where the whole interval lies on that side of zero, else 0."""
    return int(interval["low"] > 0.0) - int(interval["high"] < 0.0)


def _verdict(sign: int, *, wanted: int) -> str:
    return {wanted: "holds", -wanted: "the reverse holds", 0: "not shown"}[sign]


def _bound(rate: dict[str, float], most: float) -> str:
    """Whether a rate is at most so much."""
    if rate["high"] <= most:
        return "holds"
    return "does not hold" if rate["low"] > most else "not shown"


def _follows(summary: dict[str, Any]) -> tuple[str, str]:
    cell = _cell(summary, FREE, "active")
    error = cell["metrics"]["following_error_rms_m"]
    figure = (
        f"follows to the end in {_percent(cell['success'])}; median rms distance from "
        f"the follow point {error['median']:.2f} m"
    )
    holds = cell["success"]["low"] >= 1.0 - TOLERANCE
    return figure, "holds" if holds else "does not hold"


def _collision_free(scenario: str) -> Callable[[dict[str, Any]], tuple[str, str]]:
    def judge(summary: dict[str, Any]) -> tuple[str, str]:
        cell = _cell(summary, scenario, "active")
        figure = (
            f"collides in {_percent(cell['collision'])}, succeeds in "
            f"{_percent(cell['success'])}"
        )
        return figure, _bound(cell["collision"], TOLERANCE)

    return judge


def _avoids_more(
    scenario: str, law: str
) -> Callable[[dict[str, Any]], tuple[str, str]]:
    def judge(summary: dict[str, Any]) -> tuple[str, str]:
        pair = _pair(summary, scenario, "conventional", law)["collision"]
        rates = (
            _percent(_cell(summary, scenario, name)["collision"])
            for name in ("conventional", law)
        )
        figure = (
            f"collisions: conventional {next(rates)}, {law} {next(rates)}; "
            f"{_points(pair)}; {pair['only_first']} layouts where conventional alone "
            f"collides, {pair['only_second']} where {law} alone does"
        )
        return figure, _verdict(_sign(pair), wanted=1)

    return judge


def _smoother(scenario: str) -> Callable[[dict[str, Any]], tuple[str, str]]:
    def judge(summary: dict[str, Any]) -> tuple[str, str]:
        metrics = _pair(summary, scenario, "conventional", "active")["metrics"]
        jerk, sparc = metrics.get("jerk_rms_m_s3"), metrics.get("sparc")
        if jerk is None or sparc is None:
            return "no layout on which both succeed", "not shown"
        figure = (
            f"conventional less active: rms jerk {_shift(jerk, 'm/s^3')}; SPARC "
            f"{sparc['difference']:+.3f} ({sparc['low']:+.3f}, {sparc['high']:+.3f})"
        )
        signs = {_sign(jerk), -_sign(sparc)}
        if signs == {1, -1}:
            return figure, "jerk and SPARC disagree"
        sign = 1 if 1 in signs else -1 if -1 in signs else 0
        return figure, _verdict(sign, wanted=1)

    return judge


def _earlier(summary: dict[str, Any]) -> tuple[str, str]:
    median = _pair(summary, STATIC, "conventional", "active")["metrics"][
        "reaction_distance_m"
    ]
    figure = (
        f"first push of 0.5 N at {median['first']:.2f} m (conventional) and "
        f"{median['second']:.2f} m (active); {_shift(median, 'm')}"
    )
    return figure, _verdict(_sign(median), wanted=-1)


def _jams(summary: dict[str, Any]) -> tuple[str, str]:
    counts = {}
    for law in ("conventional", "active"):
        cell = _cell(summary, STATIC, law)
        counts[law] = 100.0 * cell["mechanisms"].get("jam", 0) / cell["runs"]
    figure = (
        f"stuck or out of time: conventional {counts['conventional']:.1f} %, active "
        f"{counts['active']:.1f} % of all layouts"
    )
    if max(counts.values()) <= 100.0 * TOLERANCE:
        return figure, "rare for both"
    more = counts["conventional"] > counts["active"]
    return figure, "holds" if more else "the reverse holds"


def _vibrates(summary: dict[str, Any]) -> tuple[str, str]:
    metrics = _pair(summary, ONE, "conventional", "active")["metrics"]
    jerk, turns = metrics["jerk_rms_m_s3"], metrics["turn_reversals_per_s"]
    figure = (
        f"conventional less active, both succeeding: rms jerk {_shift(jerk, 'm/s^3')}; "
        f"reversals of turning {_shift(turns, '1/s')}"
    )
    signs = {_sign(jerk), _sign(turns)} - {0}
    sign = signs.pop() if len(signs) == 1 else 0
    return figure, _verdict(sign, wanted=1)


def _blind(summary: dict[str, Any]) -> tuple[str, str]:
    counts = {"never heard": 0, "out of sight": 0}
    total = 0
    for scenario in (ONE, TWO):
        cell = _cell(summary, scenario, "active")
        total += round(cell["collision"]["estimate"] * cell["runs"])
        for name in counts:
            counts[name] += cell["mechanisms"].get(name, 0)
    never, out = (100.0 * counts[name] / max(total, 1) for name in counts)
    figure = (
        f"of {total} collisions of the active law with moving obstacles {never:.0f} % "
        f"were with one that was never heard, {out:.0f} % with one out of sight"
    )
    return figure, "holds" if never + out > 50.0 else "not shown"


CLAIMS = (
    Claim("The robot tracks the moving source", "Han 5.1, figure 11", _follows),
    Claim(
        "Active: collision-free among two static obstacles",
        "Han 5.2, figure 13",
        _collision_free(STATIC),
    ),
    Claim(
        "Active avoids static obstacles better than conventional",
        "Han 5.2, figure 13",
        _avoids_more(STATIC, "active"),
    ),
    Claim(
        "Active: smoother trajectory than conventional",
        "Han 5.2, figure 13",
        _smoother(STATIC),
    ),
    Claim("Active reacts earlier, to far obstacles", "Han 3.3, 5.2", _earlier),
    Claim(
        "Among several obstacles conventional jams, active does not",
        "Han 3.2, 3.3",
        _jams,
    ),
    Claim(
        "Active: follows past a moving obstacle without collision",
        "Han 5.3, figure 15",
        _collision_free(ONE),
    ),
    Claim(
        "Conventional collides with a moving obstacle where active does not",
        "Han 5.3, figure 15c",
        _avoids_more(ONE, "active"),
    ),
    Claim(
        "Active: follows past two moving obstacles without collision",
        "Han 5.3, figure 16",
        _collision_free(TWO),
    ),
    Claim(
        "Conventional collides with two moving obstacles where active does not",
        "Han 5.3, figure 16c",
        _avoids_more(TWO, "active"),
    ),
    Claim(
        "Sudden pushes of a moving obstacle make conventional vibrate",
        "Han 3.2",
        _vibrates,
    ),
    Claim(
        "The law of 2017 avoids static obstacles better than conventional",
        "Kim 5, experiment 2",
        _avoids_more(STATIC, "active2017"),
    ),
    Claim(
        "The law of 2017 avoids a moving obstacle better than conventional",
        "Kim 5",
        _avoids_more(ONE, "active2017"),
    ),
    Claim("Obstacles from all sides need more sensors", "Han 6", _blind),
)


if __name__ == "__main__":
    document = json.loads(Path(sys.argv[1]).read_text("utf-8"))
    sys.stdout.write(claims_table(document) + "\n")
