"""Files that a run can write outside of its result directory: sound, and a movie."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from diagrams import RunAudio, RunResult, Scenario

#: Files with the table of a run, for other programs.
MCAP_FILE, CSV_FILE = "run.mcap", "trajectory.csv"


class SavedAudio:
    """The sound files of a run, and how much sound has been written.

    During the run, the sound is written directly into its final directory. If an
    interrupt or a full disk ends the run, the sound up to this time remains and can be
    read. A result directory, in contrast, appears only when it is complete.

    Args:
        directory: New or empty directory for the sound files.
        scenario: Scenario of the run.

    Raises:
        InputError: The directory cannot be used, or the scenario has no sound to save.
    """

    def __init__(self, directory: str | Path, scenario: Scenario) -> None:
        from analysis.report.result_directory import check_directory
        from diagrams.scenario.audible import check_audible

        check_audible(scenario)
        self._scenario, self._shown = scenario, Path(directory).expanduser()
        self._files: RunAudio | None = None
        with _naming_option():
            self.path = check_directory(directory)

    @contextmanager
    def opened(self) -> Iterator[RunAudio]:
        """Opens the sound files for the duration of the run.

        Yields:
            The open files, which ``diagrams.simulate`` takes as ``audio``.

        Raises:
            InputError: Another process took the directory after this object was made.
        """
        from analysis.report.result_directory import take_directory
        from diagrams import RunAudio

        with _naming_option():
            taken = take_directory(self.path)
        try:
            with RunAudio(self._scenario, self.path) as self._files:
                yield self._files
        finally:
            # Remove directories that were made for the sound and stayed empty.
            taken.undo()

    @property
    def heard(self) -> Path:
        """File of the sound at the first robot that listens; complete after the run."""
        assert self._files is not None
        return self._files.first_heard

    def left(self) -> str:
        """Returns a text about sound that remains after an interrupt, if any."""
        if self._files is None or self._files.until_s == 0.0:
            return ""
        return f"the sound until {self._files.until_s:g} s is in {self._shown}"

    def facts(self) -> dict[str, Any]:
        """The directory, and the contents of each file, as plain values."""
        assert self._files is not None
        return {"directory": str(self._shown), **self._files.facts()}


class SavedMovie:
    """The movie of a run, with the sound that its first robot heard.

    Args:
        file: New file that ends in .gif or .mp4.
        scenario: Scenario of the run.

    Raises:
        InputError: The file cannot be made, or no encoder for it is installed.
    """

    def __init__(self, file: str | Path, scenario: Scenario) -> None:
        from analysis.views.movie_file import MovieFile
        from diagrams.scenario.audible import check_audible
        from systems.framework.input_error import InputError

        self.shown, self._movie = str(file), MovieFile(file)
        self.path, self._scenario = self._movie.path, scenario
        self.has_sound = self._movie.has_sound
        try:
            check_audible(scenario)
        except InputError:  # a silent movie
            self.has_sound = False

    @contextmanager
    def sound(self, saved: SavedAudio | None) -> Iterator[SavedAudio | None]:
        """Provides the sound files for the movie.

        Args:
            saved: Sound files that the user wants to keep. If None, the sound is in a
                hidden directory beside the movie during the ``with`` block.

        Yields:
            The sound files, or None if the movie is silent and ``saved`` is None.
        """
        with ExitStack() as stack:
            if saved is None and self.has_sound:
                hidden = stack.enter_context(
                    TemporaryDirectory(prefix=".movie.", dir=self.path.parent)
                )
                saved = SavedAudio(Path(hidden) / "heard", self._scenario)
            yield saved

    def write(
        self, result: RunResult, sound: SavedAudio | None, step: Callable[[], None]
    ) -> None:
        """Writes the movie.

        Args:
            result: Result of the run that the movie shows.
            sound: Sound files from ``sound``.
            step: Function that is called before each frame.

        Raises:
            RunError: The encoder failed, or the file could not be written to the disk.
        """
        from analysis.views.film import RunFrames

        def watched(frames: Iterable[Any]) -> Iterator[Any]:
            for frame in frames:
                step()
                yield frame

        heard = sound.heard if sound is not None and self.has_sound else None
        frames = RunFrames(result).frames(self._movie.frames_per_s)
        self._movie.write(watched(frames), heard if heard and heard.is_file() else None)


@contextmanager
def _naming_option() -> Iterator[None]:
    """Assigns errors within the block to the option ``--save-audio``."""
    from systems.framework.input_error import InputError

    try:
        yield
    except InputError as error:
        raise InputError("save_audio", error.message) from None
