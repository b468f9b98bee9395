"""``--movie``: a movie of a run, with the sound that its first robot heard."""

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
    """The movie of a run, and the sound files that the movie needs.

    Args:
        file: New file that ends in .gif or .mp4.
        scenario: Scenario of the run.
        place: Result directory of the run. Its hidden directory holds the sound until
            the movie is written.
        saved: Sound files of the option ``--save-audio``, which the movie then uses,
            too. None if the user did not give this option.

    Raises:
        InputError: The file cannot be made, or no encoder for it is installed.
    """

    def __init__(
        self, file: str, scenario: Scenario, place: Place, saved: SavedAudio | None
    ) -> None:
        from analysis.views.movie_file import MovieFile
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
        """Opens the sound files for the duration of the run.

        Yields:
            The open files, which ``simulate`` takes as ``audio``. None for a silent
            movie.
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
        """Writes the movie.

        Args:
            result: Result of the run that the movie shows.

        Raises:
            RunError: The encoder failed, or the file could not be written to the disk.
        """
        from analysis.views.film import RunFrames

        sound = None
        if self._audible and self._saved is not None:
            sound = self._saved.heard
        elif self._own is not None:
            sound = self._own.first_heard
        frames = RunFrames(result).frames(self._movie.frames_per_s)
        self._movie.write(frames, sound if sound and sound.is_file() else None)
        shutil.rmtree(self._directory, ignore_errors=True)

    def text(self) -> str:
        """The line of the run's summary about the movie."""
        return f"{'movie':<21} {self._shown}"
