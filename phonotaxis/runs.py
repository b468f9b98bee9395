"""Single runs of a scenario, and the pictures and files that show a run."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import diagrams
from diagrams.running.audio.run_audio import RunAudio
from diagrams.scenario.loading import changed_scenario
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.scenario_files import check_files
from diagrams.scenario.warnings.warnings_of import warnings_of
from phonotaxis.result import Prepared, Result, ignore
from phonotaxis.run_files import CSV_FILE, MCAP_FILE, SavedAudio, SavedMovie
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pydrake.geometry import Meshcat

__all__ = ["RunResult", "simulate"]


@dataclass(frozen=True, repr=False)
class RunResult(diagrams.RunResult, Result):
    """Result of a run, with methods that make pictures and files."""

    audio: dict[str, Any] | None = None
    """Directory of the saved sound, and the contents of its files; None if no sound was
    saved."""
    movie: str | None = None
    """File of the movie; None if no movie was written."""

    @classmethod
    def of(cls, result: diagrams.RunResult) -> RunResult:
        """Converts a result of ``diagrams.simulate``, also for each robot."""
        values = {each.name: getattr(result, each.name) for each in fields(result)}
        values["several"] = {name: cls.of(own) for name, own in result.several.items()}
        return cls(**values)

    def __repr__(self) -> str:
        whole = self.full_scenario
        return (
            f"<RunResult {whole.name}, law {whole.law_names}, seed {whole.seed}: "
            f"{self.ending} after {self.simulated_s:.1f} s>"
        )

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of ``phonotaxis simulate``."""
        from analysis.runs.run_report import run_document

        files = {"audio": self.audio, "movie": self.movie}
        given = {name: value for name, value in files.items() if value is not None}
        return {**run_document(self), **given}

    def __str__(self) -> str:
        """Summary of the run, for a terminal."""
        from analysis.runs.run_report import run_text

        lines = [run_text(self, self.document())]
        if self.audio is not None:
            lines.append(f"{'sound':<21} {self.audio['directory']}")
        if self.movie is not None:
            lines.append(f"{'movie':<21} {self.movie}")
        return "\n".join(lines)

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the scenario, each in one line."""
        return tuple(str(each) for each in self.warnings)

    @property
    def metrics(self) -> dict[str, Any]:
        """Metrics of the run by name; ``phonotaxis columns --metrics`` lists them."""
        metrics: dict[str, Any] = self.document()["metrics"]
        return metrics

    def plot(self, what: Literal["trajectory", "time_series"] = "trajectory") -> Figure:
        """Draws the run.

        Args:
            what: ``trajectory`` for the run seen from above. ``time_series`` for the
                signals of the sensors and the actuators over time.

        Returns:
            The figure. Its method ``savefig`` writes the figure to a file.

        Raises:
            InputError: ``what`` is unknown, or it is ``time_series`` and the run has
                several robots. Draw the time series of each of ``robots`` instead.
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

    def figures(self) -> dict[str, Figure]:
        """Draws the run from above, and the time series of each robot, by name."""
        names = {name: f"time_series_{name}" for name in self.several}
        return {"trajectory": self.plot()} | {
            names.get(name, "time_series"): own.plot("time_series")
            for name, own in self.robots.items()
        }

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

        The file has one row per tick (control period). All digits are written, so that
        reading the file gives exactly the same numbers.

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

    def write(
        self,
        document: dict[str, Any],
        directory: Path,
        *,
        pictures: bool = True,
        mcap: bool = False,
        csv: bool = False,
    ) -> None:
        """Writes the files of the run into an existing directory.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
            pictures: Whether to write the PNG and SVG files.
            mcap: Whether to write ``run.mcap``.
            csv: Whether to write ``trajectory.csv``.
        """
        from analysis.views.run_directory import write_run

        write_run(self, document, directory, pictures=pictures)
        if mcap:
            self.to_mcap(directory / MCAP_FILE)
        if csv:
            self.to_csv(directory / CSV_FILE)


def simulate(
    scenario: Scenario | str | Path = "default",
    settings: Iterable[str] | Mapping[str, Any] = (),
    *,
    engine: Engine | None = None,
    progress: Callable[[float], None] | None = None,
    audio: RunAudio | None = None,
    save_audio: str | Path | None = None,
    movie: str | Path | None = None,
    meshcat: Meshcat | None = None,
    rate: float | None = None,
    **fields: Any,
) -> RunResult:
    """Runs a scenario to its end.

    Example: ``simulate("default", law="active", duration_s=20)``.

    The logger ``phonotaxis`` states warnings about the scenario, for example if the
    robot cannot come to rest with its gains. The attribute ``notes`` of the result
    contains the same texts.

    Args:
        scenario: Scenario from ``load_scenario``, name of a scenario in the library, or
            path of a YAML file.
        settings: Fields of the scenario to change, as for ``load_scenario``.
        engine: ``drake`` or ``compiled``. The compiled engine runs the same blocks in
            one compiled loop. Its first run compiles the loop, and later runs are
            faster than with Drake. None means the engine of the scenario.
        progress: Function that is called once per simulated second with the simulated
            time in seconds.
        audio: Open files for the sound that robots hear and loudspeakers play. They are
            not used if ``save_audio`` is given or the movie has sound.
        save_audio: New or empty directory for the sound that robots hear and
            loudspeakers play. None means that no sound is saved.
        movie: New .gif or .mp4 file for a movie of the run from above. None means no
            movie.
        meshcat: Drake's 3D viewer, which shows the run while it is computed, for
            example ``pydrake.geometry.StartMeshcat()``. It needs the engine ``drake``.
        rate: Greatest ratio of simulated time to real time with ``meshcat``, >= 0. The
            default 1 is real time, and 0 is as fast as possible.
        **fields: Further fields of the scenario to change. They override ``settings``.

    Returns:
        Result of the run.

    Raises:
        InputError: The scenario or a file is not valid. The message names the field and
            the remedy.
        RunError: The encoder of the movie failed.
    """
    scenario = changed_scenario(scenario, settings, fields)
    prepared = prepare_simulation(
        scenario,
        engine=engine,
        audio=audio,
        saved=SavedAudio(save_audio, scenario) if save_audio is not None else None,
        movie=SavedMovie(movie, scenario) if movie is not None else None,
        meshcat=meshcat,
        rate=rate,
    )
    return prepared.run(progress or ignore)


def prepare_simulation(
    scenario: Scenario,
    *,
    engine: Engine | None = None,
    audio: RunAudio | None = None,
    saved: SavedAudio | None = None,
    movie: SavedMovie | None = None,
    meshcat: Meshcat | None = None,
    rate: float | None = None,
) -> Prepared[RunResult]:
    """Checks a scenario, and builds what a run needs; see ``simulate``.

    Args:
        scenario: Scenario of the run.
        engine: Engine of the run; None means the engine of the scenario.
        audio: Open files for the sound, see ``simulate``.
        saved: Sound files that the run writes, or None.
        movie: Movie that the run writes, or None.
        meshcat: Drake's 3D viewer that shows the run, or None.
        rate: Ratio of simulated time to real time, see ``simulate``.

    Returns:
        The work, which returns the result of the run.

    Raises:
        InputError: The scenario, a file or the rate is not valid, or the engine cannot
            show the run.
    """
    check_files(scenario)
    if meshcat is not None and (engine or scenario.engine) == "compiled":
        raise InputError(
            "engine",
            "the compiled engine cannot show a run while it is computed; use drake",
        )
    realtime_rate = _realtime_rate(rate, live=meshcat is not None)
    for warning in warnings_of(scenario):
        logging.getLogger("phonotaxis").warning("%s", warning)
    follower = None
    if (engine or scenario.engine) == "compiled":
        diagrams.prepared_loop(scenario)
    else:
        follower = diagrams.build_sound_follower(scenario, log=True)
    if meshcat is not None and follower is not None:
        from analysis.views.live_view import with_live_view

        follower = with_live_view(follower, meshcat)

    def run(progress: Callable[[float], None]) -> RunResult:
        with movie.sound(saved) if movie else nullcontext(saved) as sound:
            with sound.opened() if sound else nullcontext(audio) as files:
                result = RunResult.of(
                    diagrams.simulate(
                        scenario,
                        engine=engine,
                        follower=follower,
                        progress=progress,
                        audio=files,
                        realtime_rate=realtime_rate,
                    )
                )
            if movie is not None:
                movie.write(result, sound, lambda: progress(result.simulated_s))
        return replace(
            result,
            audio=saved.facts() if saved else None,
            movie=movie.shown if movie else None,
        )

    return Prepared(
        run=run,
        total=scenario.duration_s,
        unit="s simulated",
        left=saved.left if saved else str,
    )


def _realtime_rate(rate: float | None, *, live: bool) -> float:
    """Returns the ratio of simulated time to real time; 0 is as fast as possible."""
    if not live:
        if rate is not None:
            raise InputError(
                "rate", f"{rate:g} needs a live view; give meshcat, too, or remove it"
            )
        return 0.0
    if rate is None:
        return 1.0
    if not (math.isfinite(rate) and rate >= 0.0):
        raise InputError(
            "rate", f"is {rate:g}; give 1 for real time, or 0 for the fastest"
        )
    return float(rate)
