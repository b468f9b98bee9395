"""Certificates of the laws beside simulation: the table of docs/results_stability.md.

``python -m studies certificates`` prints it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from analysis.energy.certificate_trials import CertificateTrials, try_certificate
from analysis.energy.energy_certificate import certify_energy
from diagrams import load_scenario
from studies.proofs.diagram_trials import DiagramTrials, try_diagram
from studies.proofs.sos_region import SosRegion, sos_region
from studies.tables import Table
from systems.framework.input_error import InputError

#: Kim's conventional law is left out: between rho_1 and mu_1 his laws are the same.
LAWS = ("conventional", "active", "active2017")


@dataclass(frozen=True, eq=False)
class CertificateRow:
    """One law."""

    law: str
    """As in a scenario."""
    trials: CertificateTrials
    """The energy certificate's starts in its own model."""
    diagram: DiagramTrials
    """Certified starts in the full diagram."""
    region: SosRegion | str
    """The sum-of-squares region, or why there is none."""


def certificate_rows(
    scenario_name: str,
    laws: Sequence[str] = LAWS,
    *,
    starts: int = 10_000,
    diagram_starts: int = 200,
    hearing: str = "audio",
    settings: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> list[CertificateRow]:
    """Certifies and tries each law.

    Args:
        scenario_name: Library name or YAML file.
        laws: As in a scenario.
        starts: Simulated starts inside each certified set.
        diagram_starts: Runs of the full diagram.
        hearing: ``audio`` or ``ideal``, of those.
        settings: Further fields of the scenario, ``key=value``.
        progress: Called with what is begun.

    Raises:
        InputError: There is no such scenario or law.
        ValueError: A law has no certificate.
    """
    say = progress or (lambda text: None)
    rows = []
    for law in laws:
        scenario = load_scenario(scenario_name, [f"law={law}", *settings])
        say(f"{law}: certificate and {starts} starts")
        certificate = certify_energy(scenario)
        trials = try_certificate(certificate, starts=starts)
        say(f"{law}: {diagram_starts} runs of the full diagram")
        diagram = try_diagram(certificate, starts=diagram_starts, hearing=hearing)
        say(f"{law}: sum of squares and {starts} starts")
        region: SosRegion | str
        try:
            region = sos_region(scenario, starts=starts)
        except InputError as error:
            region = str(error)
        rows.append(CertificateRow(law, trials, diagram, region))
    return rows


def certificate_tables(rows: Sequence[CertificateRow]) -> Sequence[Table]:
    """Three tables: energy certificate, full diagram, sums of squares."""
    energy = Table(
        "energy certificate",
        (
            "law",
            "velocity term",
            "certified starts tried",
            "collide",
            "other starts tried",
            "collide",
            "certified share",
            "by energy alone",
            "safe share",
            "certified / safe",
        ),
        [*map(_energy_row, rows)],
    )
    diagram = Table(
        "full diagram",
        (
            "law",
            "runs from certified starts",
            "collisions",
            "rate, 95 %",
            "ahead",
            "beside",
            "behind",
        ),
        [*map(_diagram_row, rows)],
    )
    squares = Table(
        "sums of squares",
        (
            "law",
            "proved",
            "half extents of c, v",
            "starts inside",
            "touch",
            "starts by energy alone",
            "touch with the lag",
        ),
        [*map(_squares_row, rows)],
    )
    return energy, diagram, squares


def _energy_row(row: CertificateRow) -> tuple[object, ...]:
    trials = row.trials
    return (
        f"`{row.law}`",
        trials.certificate.term,
        len(trials.inside.starts),
        trials.inside_collisions,
        len(trials.outside.starts),
        trials.outside_collisions,
        f"{trials.certified_share:.4f}",
        f"{trials.energy_share:.4f}",
        f"{trials.safe_share:.4f}",
        f"{trials.ratio:.4f}",
    )


def _diagram_row(row: CertificateRow) -> tuple[object, ...]:
    found = row.diagram
    rate = found.collision_rate
    counts = [found.mechanisms.count(name) for name in ("ahead", "beside", "behind")]
    return (
        f"`{row.law}`",
        len(found.causes),
        found.collisions,
        f"{rate.value:.3f} ({rate.low:.3f}-{rate.high:.3f})",
        *counts,
    )


def _squares_row(row: CertificateRow) -> tuple[object, ...]:
    region = row.region
    if isinstance(region, str):
        return f"`{row.law}`", "no: " + region.partition(": ")[2], *["-"] * 5
    c, v, _ = region.extent()
    return (
        f"`{row.law}`",
        "yes" if region.certified else "no",
        f"{c:.3f} m, {v:.3f} m/s",
        region.starts,
        region.collisions,
        region.energy_starts,
        region.energy_collisions,
    )


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("scenario", nargs="?", default="two_static_obstacles")
    parser.add_argument("--laws", nargs="+", default=LAWS, metavar="LAW")
    parser.add_argument("--starts", type=int, default=10_000, metavar="N")
    parser.add_argument("--diagram", type=int, default=200, metavar="N")
    parser.add_argument("--hearing", choices=("audio", "ideal"), default="audio")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--pictures", metavar="DIR", type=Path, help="draw there")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The tables; progress goes to standard error."""
    rows = certificate_rows(
        options.scenario,
        options.laws,
        starts=options.starts,
        diagram_starts=options.diagram,
        hearing=options.hearing,
        settings=options.set,
        progress=lambda text: print(text, file=sys.stderr),
    )
    yield from certificate_tables(rows)
    if options.pictures is not None:
        _draw(rows, options.pictures)


def _draw(rows: Sequence[CertificateRow], directory: Path) -> None:
    """Map, phase plane and region of each law."""
    from analysis.energy.certificate_plots import plot_energy_certificate
    from studies.nonlinear.phase_portrait import phase_portrait
    from studies.nonlinear.plots import plot_phase_portrait
    from studies.proofs.plots import plot_sos_region

    directory.mkdir(parents=True, exist_ok=True)
    for row in rows:
        certificate = row.trials.certificate
        figures = {
            "certificate": plot_energy_certificate(certificate),
            "phase": plot_phase_portrait(phase_portrait(certificate.scenario)),
        }
        if not isinstance(row.region, str):
            figures["region"] = plot_sos_region(row.region)
        for name, figure in figures.items():
            figure.savefig(directory / f"{name}_{row.law}.png", dpi=110)
