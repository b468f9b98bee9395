"""What a second robot costs: two followers of one source beside one.

    python -m benchmarks.several_robots [--runs N]

Prints figures beside their bounds; exit status 1 if one is missed. Runs of one and of
two take turns on one core, and the median of the ratios counts: a machine's speed goes
up and down within a run.
"""

from __future__ import annotations

import argparse
import sys
from statistics import median

from diagrams import build_sound_follower, load_scenario, simulate
from studies.support.figures import Figure, print_figures, stay_on_one_core


def speed_ratio(hearing: str, runs: int) -> float:
    """Real-time factor of two followers over that of one.

    Args:
        hearing: ``audio`` or ``ideal``.
        runs: Of each.

    Returns:
        Median over the runs.
    """
    two = load_scenario("two_followers", [f"hearing={hearing}"])
    one = load_scenario("two_followers", [f"hearing={hearing}", "robots={}"])
    builds = [build_sound_follower(scenario, log=True) for scenario in (one, two)]
    ratios = []
    for number in range(runs + 1):
        factors = []
        for build in builds:
            result = simulate(build.scenario, follower=build)
            factors.append(result.simulated_s / result.wall_s)
        if number:  # the first ones warm up
            ratios.append(factors[1] / factors[0])
    return median(ratios)


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=15, help="timed runs of each")
    runs = parser.parse_args().runs
    stay_on_one_core()
    return print_figures(
        [
            Figure(f"two over one, {hearing}", speed_ratio(hearing, runs), ">=", 0.5)
            for hearing in ("audio", "ideal")
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
