"""``--movie``: a film of a run, with what its first robot heard."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.commands.command import Place
    from analysis.commands.saved_audio import SavedAudio
    from diagrams import RunAudio, RunResult, Scenario


class SavedMovie:
    """Where the film goes, and where its sound is until then.

    Args:
        file: Ends in .gif or .mp4; nothing is there yet.
        scenario: What is to be run.
        place: Of the results; its directory takes the sound meanwhile.
        saved: What saves the sound anyway; none: nothing does.

    Raises:
        InputError: The file cannot be made, or nothing is installed to encode it.
    """

    def __init__(
        self, file: str, scenario: Scenario, place: Place, saved: SavedAudio | None
    ) -> None:
        from analysis.movies.encoding import MovieFile
        from diagrams.scenario.audible import check_audible
        from systems.framework.input_error import InputError

        self._shown, self._movie = file, MovieFile(file)
        self._scenario, self._saved = scenario, saved
        if self._movie.path.resolve().is_relative_to(place.out.resolve()):
            raise InputError(
                "movie",
                f"{file} is in the directory of the results, and that directory is "
                "created at the end; name another directory",
            )
        self._directory = place.directory / "heard"
        self._own: RunAudio | None = None
        self._audible = self._movie.has_sound
        try:
            check_audible(scenario)
        except InputError:  # a silent film
            self._audible = False

    @contextmanager
    def opened(self) -> Iterator[RunAudio | None]:
        """What listens to the run, for the time of the run.

        Yields:
            What ``simulate`` takes.
        """
        from diagrams import RunAudio

        if self._saved is not None:
            with self._saved.opened() as audio:
                yield audio
        elif self._audible:
            with RunAudio(self._scenario, self._directory) as self._own:
                yield self._own
        else:
            yield None

    def write(self, result: RunResult) -> None:
        """Writes the film.

        Args:
            result: The run.

        Raises:
            RunError: The encoder fails, or the disk does.
        """
        from analysis.movies.run_frames import RunFrames

        sound = None
        if self._audible and self._saved is not None:
            sound = self._saved.heard
        elif self._own is not None:
            sound = self._own.first_heard
        frames = RunFrames(result).frames(self._movie.frames_per_s)
        self._movie.write(frames, sound if sound and sound.is_file() else None)
        shutil.rmtree(self._directory, ignore_errors=True)

    def text(self) -> str:
        """The line of a summary."""
        return f"{'movie':<21} {self._shown}"
