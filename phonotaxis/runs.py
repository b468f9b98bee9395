"""A run, and what can be made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import diagrams
from diagrams.running.audio.run_audio import RunAudio
from diagrams.scenario.loading import load_scenario
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["RunResult", "simulate"]


@dataclass(frozen=True, repr=False)
class RunResult(diagrams.RunResult):
    """What a run did, with its pictures and files."""

    @classmethod
    def of(cls, result: diagrams.RunResult) -> RunResult:
        """The same result, each robot's included."""
        values = {each.name: getattr(result, each.name) for each in fields(result)}
        values["several"] = {name: cls.of(own) for name, own in result.several.items()}
        return cls(**values)

    def __repr__(self) -> str:
        whole = self.full_scenario
        return (
            f"<RunResult {whole.name}, law {whole.law_names}, seed {whole.seed}: "
            f"{self.ending} after {self.simulated_s:.1f} s>"
        )

    def summary(self) -> dict[str, Any]:
        """The JSON document of ``phonotaxis simulate``: metrics, timing, versions."""
        from analysis.runs.run_report import run_summary

        return run_summary(self, None)

    def plot(self, what: Literal["trajectory", "time_series"] = "trajectory") -> Figure:
        """A picture of the run.

        Args:
            what: The run seen from above, or what was heard, felt and done over time.

        Returns:
            The figure; ``savefig`` writes it.

        Raises:
            InputError: There is no such picture, or several robots have one each.
        """
        from analysis.runs.proximity import Proximity
        from analysis.runs.run_plots import plot_time_series, plot_trajectory

        if what == "trajectory":
            return plot_trajectory(self)
        if what != "time_series":
            raise InputError("what", f"is {what!r}; use 'trajectory' or 'time_series'")
        if self.several:
            raise InputError(
                "what",
                "each robot has time series of its own; use "
                f"result.robots[{next(iter(self.several))!r}].plot('time_series')",
            )
        return plot_time_series(self, Proximity(self).clearance)

    def replay(self, path: str | Path) -> Path:
        """Writes a page that plays the run in a browser, without network.

        Args:
            path: The .html file.

        Returns:
            The file.

        Raises:
            OSError: It cannot be written.
        """
        from analysis.runs.replay import write_replay

        write_replay(self, path)
        return Path(path)

    def to_mcap(self, path: str | Path) -> Path:
        """Writes an MCAP file of ROS 2 messages, for Foxglove and PlotJuggler.

        Args:
            path: The .mcap file.

        Returns:
            The file.

        Raises:
            InputError: The packages for it are not installed.
            OSError: The file cannot be written.
        """
        from analysis.exports.mcap_file import write_mcap
        from analysis.exports.recorded_run import RecordedRun

        write_mcap(RecordedRun.of(self), Path(path))
        return Path(path)

    def to_csv(self, path: str | Path) -> Path:
        """Writes ``trajectory`` as text, a row a tick; no digit is lost.

        Args:
            path: The .csv file.

        Returns:
            The file.

        Raises:
            OSError: It cannot be written.
        """
        self.trajectory.to_csv(path, index=False)
        return Path(path)

    def to_parquet(self, path: str | Path) -> Path:
        """Writes ``trajectory`` as Apache Parquet.

        Args:
            path: The .parquet file.

        Returns:
            The file.

        Raises:
            OSError: It cannot be written.
        """
        self.trajectory.to_parquet(path, index=False)
        return Path(path)

    def save(self, directory: str | Path | None = None) -> Path:
        """Writes all that ``phonotaxis simulate`` does into a new directory.

        Args:
            directory: It; none: the next number under ``results``.

        Returns:
            The directory.

        Raises:
            InputError: It is in use, or cannot be made or written.
        """
        from analysis.reporting.result_directory import whole_directory
        from analysis.runs.run_report import run_summary, write_run

        with whole_directory(directory) as (shown, partial):
            write_run(self, run_summary(self, shown), partial)
        return shown


def simulate(
    scenario: Scenario | str | Path = "default",
    *,
    engine: Engine | None = None,
    progress: Callable[[float], None] | None = None,
    audio: RunAudio | None = None,
) -> RunResult:
    """Runs a scenario to its end.

    Args:
        scenario: What to run: from ``load_scenario``, or a name or file for it.
        engine: ``drake``, or ``compiled``: the same blocks in one compiled loop,
            faster after a first run that compiles them; none: that of the scenario.
        progress: Called with the simulated time, s, once a simulated second.
        audio: Opened files for what is heard and played; none: nothing is saved.

    Returns:
        What happened.

    Raises:
        InputError: Something of the scenario is no good; names field and remedy.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    result = diagrams.simulate(scenario, engine=engine, progress=progress, audio=audio)
    return RunResult.of(result)
