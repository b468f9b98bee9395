"""Every scenario of the library, run and drawn: docs/gallery.md.

``python -m studies gallery --pictures docs/images/gallery`` takes about two minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from analysis.views.picture import plot_trajectory
from diagrams import Scenario, library_scenarios, load_scenario, simulate
from studies.tables import Table

SEED = 1
#: What is run otherwise than as it stands: scenarios in which force laws jam.
_SETTINGS = dict.fromkeys(
    ("barn", "clutter", "corridor", "crowd", "rooms", "u_trap"), ("law=guarded",)
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--pictures", metavar="DIR", type=Path, help="draw there")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """One row per scenario."""
    head = ("scenario", "description", "command", "ended")
    yield Table("gallery", head, _rows(options.pictures))


def _rows(pictures: Path | None) -> Iterator[list[str]]:
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
    for name in library_scenarios():
        settings = [*_SETTINGS.get(name, ())]
        scenario = load_scenario(name, settings)
        if _follows_a_sound(scenario):
            settings.append("hearing=ideal")
            scenario = load_scenario(name, settings)
        result = simulate(scenario, engine="compiled")
        if pictures is not None:
            figure = plot_trajectory(result)
            picture = pictures / f"{name}.webp"
            figure.savefig(picture, dpi=80, pil_kwargs={"quality": 75})
        options = "".join(f" --set {s}" for s in settings)
        command = f"phonotaxis simulate {name}{options}".replace("--set law=", "--law ")
        ended = f"{result.ending} after {result.simulated_s:.1f} s"
        yield [name, result.full_scenario.description, command, ended]


def _follows_a_sound(scenario: Scenario) -> bool:
    robots = scenario.robots.values()
    return all(robot.listens and not robot.searches for robot in robots)
