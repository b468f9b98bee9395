"""What the laws do before obstacles at rest, by formulas and by simulation.

Tables of docs/results_stability.md: what the velocity terms give and take, which
gaps and points hold the robot, and what is proved where source or obstacles move.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from pathlib import Path

from analysis.energy.velocity_passivity import (
    energy_balance,
    velocity_term_passivity,
)
from analysis.loops.point_mass import point_mass
from analysis.loops.radial_law import radial_law
from diagrams import Scenario, load_scenario
from studies.nonlinear.contact_oscillation import contact_oscillation
from studies.nonlinear.equilibrium_maps import gap_map, offset_map
from studies.nonlinear.phase_portrait import phase_portrait
from studies.nonlinear.stiffness_ratio import stiffness_ratio_map
from studies.nonlinear.velocity_terms import velocity_term_analysis
from studies.proofs.disturbance_bounds import disturbance_bounds, source_bound
from studies.support.trap_stiffness import trap_stiffness
from studies.tables import Table

SEED = 1
#: Laws by the names that the page gives them.
NAMES = {
    "conventional": "conventional",
    "active 2019": "active",
    "active 2017": "active2017",
}
_GAPS_M = tuple(round(0.1 * k, 1) for k in range(2, 16))
_RATIOS = (1.2, 1.5, 2.0, 3.0, 4.0, 8.0, 16.0, 64.0)
_TERMS = {"printed": "printed", "closing": "`closing`"}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--pictures", type=Path, help="directory to draw into")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The tables; draws the pictures where they are asked for."""
    yield from (
        velocity_terms(),
        energies(),
        one_sided_damping(),
        oscillations(),
        gaps(),
        offsets(),
        stiffness_ratios(),
        stiffness_across(),
        moving_source(),
        obstacle_that_comes(),
        reach_and_ratio(),
    )
    if options.pictures is not None:
        draw(options.pictures)


def scenario_of(law: str) -> Scenario:
    """Of a law by the page's name; the robot's own top speed, not experiment 2's."""
    words = ["robot.top_speed_m_s=0.72", f"law={NAMES[law]}"]
    return load_scenario("two_static_obstacles", words)


def velocity_terms() -> Table:
    """The steepest chord of each velocity term on the side that does harm."""

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            found = {
                term: velocity_term_passivity(scenario_of(law), term) for term in _TERMS
            }
            given = [found[term].largest_injection_n_s_m for term in _TERMS]
            damping = found["printed"].attraction_damping_n_s_m
            yield [law, *(f"{g:.2f} N s/m" for g in given), f"{damping:g} N s/m"]

    head = ("law", "gives at most, printed", "`closing`", "$D_r$")
    return Table("velocity terms", head, rows())


def energies() -> Table:
    """What the printed term gives and takes in one run."""

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            balance = energy_balance(scenario_of(law))
            work = balance.to_dict()
            yield [
                law,
                f"{balance.energies_j[0]:.1f} J",
                f"{work['injected_j']:.2f} J",
                f"{work['absorbed_j']:.2f} J",
            ]

    return Table("energies", ("law", "at the start", "given", "taken"), rows())


def one_sided_damping() -> Table:
    """The two linear models of each velocity term at rest."""

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            variants = velocity_term_analysis(scenario_of(law)).variants
            for term, shown in _TERMS.items():
                sides = (variants[term].approaching, variants[term].receding)
                yield [
                    law,
                    shown,
                    *(f"{side.damping_n_s_m:.2f} N s/m" for side in sides),
                    ", ".join(f"{side.damping_ratio:.3f}" for side in sides),
                    f"{variants[term].amplitude_ratio:.3f}",
                ]

    head = (
        "law",
        "term",
        "approaching",
        "receding",
        "damping ratios",
        "amplitude after a cycle",
    )
    return Table("one-sided damping", head, rows())


def oscillations() -> Table:
    """Describing functions beside the simulated build, half way down."""

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            found = contact_oscillation(scenario_of(law))
            for term, shown in _TERMS.items():
                run, predicted = found.runs[term], found.predictions[term]
                middle = len(run.amplitudes_m) // 2
                amplitude = float(run.amplitudes_m[middle])
                center, growth, frequency = predicted.at(amplitude)
                simulated = run.frequencies_rad_s.mean()
                yield [
                    law,
                    shown,
                    f"{1e3 * amplitude:.0f} mm",
                    f"{center:.4f}, {run.centers_m[middle]:.4f} m",
                    f"{growth:.4f}, {run.growth_per_s[middle]:.4f} 1/s",
                    f"{frequency:.3f}, {simulated:.3f} rad/s",
                ]

    head = (
        "law",
        "term",
        "amplitude",
        "center: predicted, simulated",
        "growth: predicted, simulated",
        "frequency",
    )
    return Table("oscillation", head, rows())


def gaps() -> Table:
    """Widths of a gap between two boxes at which the robot stops before it.

    With cones a box is hit at the least gaps; the runs are those of the diagram.
    """

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            cells = []
            for sensing in ("exact nearest", "exact sum"):
                held = gap_map(scenario_of(law), _GAPS_M, sensing=sensing).jams
                cells.append(_stretch(held))
            hit = gap_map(scenario_of(law), _GAPS_M, sensing="cones").collisions
            yield [law, *cells, f"hits one at {_stretch(hit)}"]

    head = ("held at gaps of", "exact nearest point", "sum of all bodies", "cones")
    return Table("gaps", head, rows())


def _stretch(held: tuple[float, ...], digits: int = 1) -> str:
    if not held:
        return "none"
    ends = sorted({min(held), max(held)})
    return "-".join(f"{end:.{digits}f}" for end in ends) + " m"


def offsets() -> Table:
    """Offsets of one box from the line to the source at which the robot stops or hits.

    The offset is that of the center of a box 0.1 m wide.
    """

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            held = offset_map(scenario_of(law), sensing="exact nearest").jams
            cones = offset_map(scenario_of(law), sensing="cones")
            stretches = (held, cones.jams, cones.collisions)
            yield [law, *(_stretch(each, digits=2) for each in stretches)]

    head = ("held at offsets of", "exact nearest point", "cones", "cones: hits it at")
    return Table("offsets", head, rows())


def stiffness_ratios() -> Table:
    """Distances of the head-on equilibria of the active law of 2019 over k_ref/K_0."""
    found = stiffness_ratio_map(scenario_of("active 2019"), _RATIOS)
    rows = [
        [f"{ratio:g}", *("none" if math.isnan(c) else f"{c:.3f} m" for c in places)]
        for ratio, *places in zip(
            found.ratios, found.outer_m, found.inner_m, strict=True
        )
    ]
    head = ("k_ref/K_0", "the robot stops at c", "and no longer below c")
    return Table("stiffness ratio", head, rows)


def stiffness_across() -> Table:
    """Stiffness across the line to one obstacle on it."""

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            cases = (("exact", "point"), ("exact", "face"), ("cones", "point"))
            found = [trap_stiffness(scenario_of(law), *case) for case in cases]
            yield [law, *(f"{each.across_n_m:+.1f} N/m" for each in found)]

    head = ("law", "a point, exact", "a face 0.1 m wide, exact", "a point, cones")
    return Table("stiffness across", head, rows())


def moving_source() -> Table:
    """Stretch of the loop behind a source that moves off, and through corners."""
    model = point_mass(scenario_of("conventional"))

    def rows() -> Iterator[list[str]]:
        for speed in (0.1, 0.3, 0.5):
            found = source_bound(model, speed)
            stretches = (found.bound_m, found.linear_peak_m, found.simulated_m)
            cells = [f"{stretch:.3f} m" for stretch in stretches]
            yield [f"{speed} m/s", *cells, f"{found.steady_m:.2f} m"]
        # Turns with a radius of 0.3 m.
        corner = source_bound(model, 0.3, 0.3**2 / 0.3, simulate=False)
        yield ["corners of 0.3 m at 0.3 m/s", f"{corner.bound_m:.1f} m", "", "", ""]

    head = (
        "speed",
        "proved: stretch at most",
        "largest of the linear loop",
        "simulated",
        "steady",
    )
    return Table("moving source", head, rows())


def obstacle_that_comes() -> Table:
    """For how long a robot at rest is safe from an obstacle that comes at it."""

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            found = disturbance_bounds(scenario_of(law), runs=2).obstacle
            bounds = {bound.speed_m_s: bound for bound in found}
            whole = [f"{b.speed_m_s} m/s" for b in found if b.certified]
            yield [
                law,
                f"{bounds[0.3].certified_s:.1f} s",
                f"{bounds[0.3].encounter_s:.1f} s",
                ", ".join(whole) or "none",
            ]

    head = (
        "law",
        "safe at 0.3 m/s for",
        "to cross its reach takes",
        "whole encounter certified at",
    )
    return Table("obstacle that comes", head, rows())


def reach_and_ratio() -> Table:
    """How far behind an obstacle the goal may lie, and what is certified near it.

    The greatest L with K_r (L + c) = f(c, 0) for some c.
    """

    def rows() -> Iterator[list[str]]:
        for law in NAMES:
            scenario = scenario_of(law)
            force = radial_law(scenario)
            stiffness = scenario.follower.attraction.stiffness_n_m
            way = force.forces_n / stiffness - force.distances_m
            yield [
                law,
                f"{way.max():.1f} m",
                f"{force.distances_m[way.argmax()]:.3f} m",
                f"{phase_portrait(scenario).ratio:.3f}",
            ]

    head = (
        "law",
        "goal behind the obstacle, at most",
        "then c",
        "certified / safe within 1.5 m",
    )
    return Table("reach", head, rows())


def draw(directory: Path) -> None:
    """Pictures of the velocity terms, oscillations, maps and bounds of each law."""
    from studies.nonlinear.plots import (
        plot_contact_oscillation,
        plot_equilibrium_maps,
        plot_ratio_map,
        plot_velocity_terms,
    )
    from studies.proofs.plots import plot_disturbance_bounds

    directory.mkdir(parents=True, exist_ok=True)
    active = scenario_of("active 2019")
    figures = {"stiffness_ratio": plot_ratio_map(stiffness_ratio_map(active))}
    for name, law in NAMES.items():
        case = scenario_of(name)
        sensing = ("exact nearest", "exact sum", "cones")
        between = [gap_map(case, _GAPS_M, sensing=each) for each in sensing]
        beside = [offset_map(case, sensing=each) for each in sensing[::2]]
        figures |= {
            f"velocity_terms_{law}": plot_velocity_terms(velocity_term_analysis(case)),
            f"oscillation_{law}": plot_contact_oscillation(contact_oscillation(case)),
            f"gaps_{law}": plot_equilibrium_maps(between),
            f"offsets_{law}": plot_equilibrium_maps(beside),
            f"moving_bodies_{law}": plot_disturbance_bounds(disturbance_bounds(case)),
        }
    for name, figure in figures.items():
        figure.savefig(directory / f"{name}.png", dpi=90)
