"""``--save-audio``: a directory for the sound of a run, kept even if the run fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from diagrams import RunAudio, Scenario


class SavedAudio:
    """The sound files of a run, and how much sound has been written.

    The sound is written directly into its final directory. A result directory, in
    contrast, appears only when it is complete. If an interrupt or a full disk ends the
    run, the sound up to this time remains and can be read.

    Args:
        directory: New or empty directory for the sound files.
        out: Result directory of the run. The sound directory must not be inside it,
            because ``out`` is replaced at the end.
        scenario: Scenario of the run.

    Raises:
        InputError: The directory cannot be used, or the scenario has no sound to save.
    """

    def __init__(self, directory: str, out: Path, scenario: Scenario) -> None:
        from analysis.reporting.result_directory import check_directory
        from diagrams.scenario.audible import check_audible
        from systems.framework.input_error import InputError

        check_audible(scenario)
        self._scenario, self._shown = scenario, Path(directory).expanduser()
        self._files: RunAudio | None = None
        with _naming_option():
            self._path = check_directory(directory)
        if self._path.is_relative_to(out.expanduser().resolve()):
            raise InputError(
                "save_audio",
                f"{directory} is the directory of the results or in it, and that "
                "directory is created at the end; name another directory",
            )

    @contextmanager
    def opened(self) -> Iterator[RunAudio]:
        """Opens the sound files for the duration of the run.

        Yields:
            The open files, which ``simulate`` takes as ``audio``.

        Raises:
            InputError: Another process took the directory after this object was made.
        """
        from analysis.reporting.result_directory import take_directory
        from diagrams import RunAudio

        with _naming_option():
            taken = take_directory(self._path)
        try:
            with RunAudio(self._scenario, self._path) as self._files:
                yield self._files
        finally:
            # Remove directories that were made for the sound and stayed empty.
            taken.undo()

    @property
    def heard(self) -> Path:
        """File of the sound at the first listening robot; complete after the run."""
        assert self._files is not None
        return self._files.first_heard

    def left(self) -> str:
        """Says what sound remains after an interrupt; an empty text if none remains."""
        if self._files is None or self._files.until_s == 0.0:
            return ""
        return f"the sound until {self._files.until_s:g} s is in {self._shown}"

    def facts(self) -> dict[str, Any]:
        """The directory, and the contents of each file, as plain values."""
        assert self._files is not None
        return {"directory": str(self._shown), **self._files.facts()}

    def text(self) -> str:
        """The line of the run's summary about the sound."""
        return f"{'sound':<21} {self._shown}"


@contextmanager
def _naming_option() -> Iterator[None]:
    """Makes errors about a directory name the option ``--save-audio``."""
    from systems.framework.input_error import InputError

    try:
        yield
    except InputError as error:
        raise InputError("save_audio", error.message) from None
