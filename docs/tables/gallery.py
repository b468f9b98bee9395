"""The gallery: every library scenario, run and drawn.

``python -m docs.tables.gallery`` writes ``docs/gallery.md`` and its pictures anew,
in about two minutes.
"""

from __future__ import annotations

from pathlib import Path

from analysis.runs.run_plots import plot_trajectory
from diagrams import RunResult, library_scenarios, load_scenario, simulate

__all__ = ["PICTURES", "entry", "write_gallery"]

_DOCS = Path(__file__).resolve().parents[1]
PICTURES = _DOCS / "images" / "gallery"
#: What is run otherwise than as it stands: scenarios that force laws jam in.
_SETTINGS = dict.fromkeys(
    ("clutter", "corridor", "crowd", "rooms", "u_trap"), ("law=guarded",)
)
_TOP = """# Gallery

Every scenario that comes with the package (`phonotaxis scenarios`), as
`python -m docs.tables.gallery` ran and drew it: with `hearing=ideal` where robots
follow a sound, and with the law that the command names.
"""


def write_gallery() -> None:
    """Runs and draws all."""
    PICTURES.mkdir(exist_ok=True)
    parts = [_TOP]
    for name in library_scenarios():
        settings = [*_SETTINGS.get(name, ())]
        scenario = load_scenario(name, settings)
        if all(not r.searches and not r.has_goal for r in scenario.all_robots.values()):
            settings.append("hearing=ideal")
            scenario = load_scenario(name, settings)
        result = simulate(scenario, engine="compiled")
        figure = plot_trajectory(result)
        figure.savefig(PICTURES / f"{name}.webp", dpi=80, pil_kwargs={"quality": 75})
        parts.append(entry(result, settings))
    (_DOCS / "gallery.md").write_text("\n".join(parts), "utf-8")


def entry(result: RunResult, settings: list[str]) -> str:
    """A section of the page.

    Args:
        result: The run.
        settings: How it was set, as on the command line.

    Returns:
        Markdown.
    """
    scenario = result.full_scenario
    name, options = scenario.name, "".join(f" --set {s}" for s in settings)
    options = options.replace("--set law=", "--law ")
    told = scenario.description
    return (
        f"## {name}\n\n{told[0].upper()}{told[1:]}: {result.ending} after "
        f"{result.simulated_s:.1f} s.\n\n`phonotaxis simulate {name}{options}`\n\n"
        f"![{name}](images/gallery/{name}.webp)\n"
    )


if __name__ == "__main__":
    write_gallery()
