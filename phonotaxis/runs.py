"""Single runs of a scenario, and the pictures and files that show a run."""

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
    """Result of a run, with methods that make pictures and files."""

    @classmethod
    def of(cls, result: diagrams.RunResult) -> RunResult:
        """Converts a result of ``diagrams``, including the results of each robot."""
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
        """Returns the JSON document of ``phonotaxis simulate``."""
        from analysis.runs.run_report import run_summary

        return run_summary(self, None)

    def plot(self, what: Literal["trajectory", "time_series"] = "trajectory") -> Figure:
        """Draws the run.

        Args:
            what: ``trajectory`` for the run seen from above. ``time_series`` for the
                signals of the sensors and the actuators over time.

        Returns:
            The figure. Its method ``savefig`` writes the figure to a file.

        Raises:
            InputError: ``what`` is unknown. Or ``what`` is ``time_series`` and the run
                has several robots. Each robot then has time series of its own.
        """
        from analysis.runs.proximity import Proximity
        from analysis.views.picture import plot_trajectory
        from analysis.views.time_series import plot_time_series

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
        """Writes an HTML page that replays the run in a browser, without a network.

        Args:
            path: The .html file.

        Returns:
            Path of the file.

        Raises:
            OSError: The file cannot be written.
        """
        from analysis.views.replay import write_replay

        write_replay(self, path)
        return Path(path)

    def to_mcap(self, path: str | Path) -> Path:
        """Writes an MCAP file of ROS 2 messages, for Foxglove and PlotJuggler.

        Args:
            path: The .mcap file.

        Returns:
            Path of the file.

        Raises:
            InputError: The packages that write MCAP files are not installed.
            OSError: The file cannot be written.
        """
        from analysis.runs.recorded_run import RecordedRun
        from analysis.views.mcap_file import write_mcap

        write_mcap(RecordedRun.of(self), Path(path))
        return Path(path)

    def to_csv(self, path: str | Path) -> Path:
        """Writes the table ``trajectory`` as a CSV file.

        The file has one row per tick (tick = control period). Its numbers have all
        digits, so that reading the file gives the same numbers.

        Args:
            path: The .csv file.

        Returns:
            Path of the file.

        Raises:
            OSError: The file cannot be written.
        """
        self.trajectory.to_csv(path, index=False)
        return Path(path)

    def to_parquet(self, path: str | Path) -> Path:
        """Writes the table ``trajectory`` as an Apache Parquet file.

        Args:
            path: The .parquet file.

        Returns:
            Path of the file.

        Raises:
            OSError: The file cannot be written.
        """
        self.trajectory.to_parquet(path, index=False)
        return Path(path)

    def save(self, directory: str | Path | None = None) -> Path:
        """Writes all files of ``phonotaxis simulate`` into a new directory.

        Args:
            directory: New or empty directory. None means the next number under
                ``results``.

        Returns:
            Path of the directory.

        Raises:
            InputError: The directory is in use, or cannot be created or written.
        """
        from analysis.reporting.result_directory import whole_directory
        from analysis.runs.run_report import run_summary
        from analysis.views.run_directory import write_run

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
        scenario: Scenario from ``load_scenario``, name of a scenario in the library, or
            path of a YAML file.
        engine: ``drake`` or ``compiled``. The compiled engine runs the same blocks in
            one compiled loop. Its first run compiles the loop, and later runs are
            faster than with Drake. None means the engine of the scenario.
        progress: Function that is called once per simulated second with the simulated
            time in seconds.
        audio: Open files for the sound that the robot hears and plays. None means that
            no sound is saved.

    Returns:
        Result of the run.

    Raises:
        InputError: The scenario is not valid. The message names the field and the
            remedy.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    result = diagrams.simulate(scenario, engine=engine, progress=progress, audio=audio)
    return RunResult.of(result)
