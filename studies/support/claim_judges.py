"""How our figures bear on a claim: from a comparison's summary to a verdict."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from analysis.report.intervals import Estimate, estimate_rate

#: From a summary to our figure and the verdict.
Judge = Callable[[dict[str, Any]], tuple[str, str]]

#: A collision rate up to this counts as free of collisions, a success rate above
#: its complement as success.
TOLERANCE = 0.05

STATIC, ONE, TWO = "two_static_obstacles", "one_moving_obstacle", "two_moving_obstacles"
FREE = "obstacle_free"

#: Field of the runs in which wheels can slip.
FRICTION = "plant.friction"
#: Slip of less than this is none, m: twice what steps of 25 ms are off by.
LEAST_SLIP_M = 0.005


def _cell(summary: dict[str, Any], scenario: str, law: str) -> dict[str, Any]:
    return next(
        cell
        for cell in summary["cells"]
        if (cell["scenario"], cell["fields"]) == (scenario, {"law": law})
    )


def _pair(
    summary: dict[str, Any], scenario: str, first: str, second: str
) -> dict[str, Any]:
    return next(
        pair
        for pair in summary["pairs"]
        if (pair["scenario"], pair["first"], pair["second"], pair["fields"])
        == (scenario, first, second, {})
    )


def _percent(rate: dict[str, Any]) -> str:
    return _shown(Estimate(**rate))


def _shown(rate: Estimate) -> str:
    return rate.text(".1f", unit=" %", factor=100.0)


def _difference(
    pair: dict[str, Any], form: str, unit: str = "", factor: float = 1.0
) -> str:
    return Estimate(**pair["difference"]).text(form, unit=unit, factor=factor)


def _both(median: dict[str, Any], name: str, unit: str) -> str:
    return (
        f"{name} {median['first']:.2f} {unit} (conventional) and "
        f"{median['second']:.2f} {unit} (active); "
        f"{_difference(median, '+.2f', f' {unit}')} in "
        f"{median['difference']['n']} pairs"
    )


def _sign(pair: dict[str, Any]) -> int:
    """+1 or -1 where the whole interval lies on that side of zero, else 0."""
    interval = pair["difference"]
    return int(interval["low"] > 0.0) - int(interval["high"] < 0.0)


def _verdict(sign: int, *, wanted: int) -> str:
    return {wanted: "holds", -wanted: "the reverse holds", 0: "not shown"}[sign]


def _agreed(signs: set[int]) -> str:
    """The verdict where all figures have one sign; +1 is wanted."""
    return _verdict(*signs, wanted=1) if len(signs) == 1 else "not shown"


def _bound(rate: dict[str, float], most: float) -> str:
    """Whether a rate is at most so much."""
    if rate["high"] <= most:
        return "holds"
    return "does not hold" if rate["low"] > most else "not shown"


def follows(summary: dict[str, Any]) -> tuple[str, str]:
    """Active follows the source in free space to the end."""
    cell = _cell(summary, FREE, "active")
    error = cell["metrics"]["following_error_rms_m"]
    figure = (
        f"follows to the end in {_percent(cell['success'])}; median rms distance from "
        f"the follow point {error['value']:.2f} m"
    )
    holds = cell["success"]["low"] >= 1.0 - TOLERANCE
    return figure, "holds" if holds else "does not hold"


def collision_free(scenario: str) -> Judge:
    """Active collides in at most 5 % of the layouts."""

    def judge(summary: dict[str, Any]) -> tuple[str, str]:
        cell = _cell(summary, scenario, "active")
        figure = (
            f"collides in {_percent(cell['collision'])}, succeeds in "
            f"{_percent(cell['success'])}"
        )
        return figure, _bound(cell["collision"], TOLERANCE)

    return judge


def avoids_more(scenario: str, law: str, baseline: str = "conventional") -> Judge:
    """A law collides on fewer layouts than the one that its paper compares it with.

    Args:
        scenario: Of the comparison.
        law: That collides less, as the paper says.
        baseline: The law that it is compared with.

    Returns:
        From a comparison's summary to our figure and a verdict, both as text.
    """

    def judge(summary: dict[str, Any]) -> tuple[str, str]:
        pair = _pair(summary, scenario, baseline, law)["collision"]
        rates = (
            _percent(_cell(summary, scenario, name)["collision"])
            for name in (baseline, law)
        )
        figure = (
            f"collisions: {baseline} {next(rates)}, {law} {next(rates)}; "
            f"{_difference(pair, '+.1f', ' points', 100.0)}; "
            f"{pair['only_first']} layouts where {baseline} alone collides, "
            f"{pair['only_second']} where {law} alone does"
        )
        return figure, _verdict(_sign(pair), wanted=1)

    return judge


def smoother(scenario: str) -> Judge:
    """Active has less jerk and more SPARC where both push and succeed."""

    def judge(summary: dict[str, Any]) -> tuple[str, str]:
        metrics = _pair(summary, scenario, "conventional", "active")["encounters"]
        jerk, sparc = metrics.get("jerk_rms_m_s3"), metrics.get("sparc")
        if jerk is None or sparc is None:
            return "no layout on which both push and succeed", "not shown"
        both = _both(jerk, "rms jerk", "m/s^3")
        figure = f"{both}; SPARC {_difference(sparc, '+.3f')}"
        signs = {_sign(jerk), -_sign(sparc)} - {0}
        return figure, "jerk and SPARC disagree" if len(signs) > 1 else _agreed(signs)

    return judge


def slips_less(summary: dict[str, Any]) -> tuple[str, str]:
    """Active slips less on every floor on which wheels slip."""
    return _on_floors(summary, ("slip_way_m",), "the wheels slip")


def accurate(summary: dict[str, Any]) -> tuple[str, str]:
    """Active's odometry is nearer to the truth there, at the end and on the way."""
    names = ("odometry_error_final_m", "odometry_error_rms_m")
    return _on_floors(summary, names, "odometry is off at the end by")


def _on_floors(
    summary: dict[str, Any], names: tuple[str, ...], text: str
) -> tuple[str, str]:
    """Active has less of some lengths where both laws push and succeed.

    Args:
        summary: With ``--grid plant.friction``.
        names: Metrics in m that are judged; the first is reported.
        text: What it is of.
    """
    figures, signs = [], set()
    for pair in summary["pairs"]:
        friction, metrics = pair["fields"].get(FRICTION), pair["encounters"]
        laws = (pair["scenario"], pair["first"], pair["second"])
        if laws != (STATIC, "conventional", "active") or friction is None:
            continue
        floor, slip = f"friction {friction:g}:", metrics.get("slip_way_m")
        if slip is None:
            figures.append(f"{floor} no layout on which both push and succeed")
            continue
        if max(slip["first"], slip["second"]) < LEAST_SLIP_M:
            figures.append(f"{floor} no slip")
            continue
        first, *_ = medians = [metrics[name] for name in names]
        difference = dict(first["difference"])
        difference |= {x: 100.0 * difference[x] for x in ("value", "low", "high")}
        cm = {x: 100.0 * first[x] for x in ("first", "second")}
        cm |= {"difference": difference}
        figures.append(_both(cm, floor, "cm"))
        signs |= {_sign(median) for median in medians}
    figure = f"{text}: {'; '.join(figures)}"
    if {1, -1} <= signs:
        return figure, "depends on the floor"
    return figure, _agreed(signs)


def earlier(summary: dict[str, Any]) -> tuple[str, str]:
    """Active pushes first from farther away."""
    median = _pair(summary, STATIC, "conventional", "active")["metrics"][
        "reaction_distance_m"
    ]
    figure = _both(median, "first push of 0.5 N at", "m")
    return figure, _verdict(_sign(median), wanted=-1)


def jams(summary: dict[str, Any]) -> tuple[str, str]:
    """Conventional jams among two static obstacles, active does less.

    What has come into the goal has passed the obstacles, and is in no jam.
    """
    rates = {}
    for law in ("conventional", "active"):
        cell = _cell(summary, STATIC, law)
        count, runs = cell["mechanisms"].get("jam", 0), cell["runs"]
        rates[law] = estimate_rate(count, runs)
    conventional, active = rates.values()
    figure = (
        "stuck, or out of time before the goal: conventional "
        f"{_shown(conventional)}, active {_shown(active)} of all layouts"
    )
    if conventional.low > active.high:
        return figure, "holds"
    reverse = active.low > conventional.high
    return figure, "the reverse holds" if reverse else "not shown"


def vibrates(summary: dict[str, Any]) -> tuple[str, str]:
    """Conventional moves less smoothly than active past a moving obstacle."""
    metrics = _pair(summary, ONE, "conventional", "active")["encounters"]
    jerk, turns = metrics["jerk_rms_m_s3"], metrics["turn_reversals_per_s"]
    reversals = _difference(turns, "+.3f", " 1/s")
    figure = f"{_both(jerk, 'rms jerk', 'm/s^3')}; reversals of turning {reversals}"
    return figure, _agreed({_sign(jerk), _sign(turns)} - {0})


def blind(summary: dict[str, Any]) -> tuple[str, str]:
    """Most collisions with moving obstacles are with what no cone sees."""
    counts = {"no echo": 0, "out of sight": 0}
    total = 0
    for scenario in (ONE, TWO):
        cell = _cell(summary, scenario, "active")
        total += round(cell["collision"]["value"] * cell["runs"])
        for name in counts:
            counts[name] += cell["mechanisms"].get(name, 0)
    never, out = (100.0 * counts[name] / max(total, 1) for name in counts)
    figure = (
        f"of {total} collisions of the active law with moving obstacles {never:.0f} % "
        f"were with one that gave no echo, {out:.0f} % with one out of sight"
    )
    return figure, "holds" if never + out > 50.0 else "not shown"
