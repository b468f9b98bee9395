"""``--save-audio``: a directory for the sound of a run, kept however the run ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from diagrams import RunAudio, Scenario


class SavedAudio:
    """Where the sound goes, and how far it got.

    Unlike a result directory it is not written aside first: what was heard before an
    interrupt, or a full disk, stays and can be read.

    Args:
        directory: One that does not exist yet, or is empty.
        out: The result directory, which would replace what is in it.
        scenario: What is to be run.

    Raises:
        InputError: The directory cannot be used, or there is nothing to hear.
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
        """The files, for the time of the run.

        Yields:
            What ``simulate`` takes.

        Raises:
            InputError: Somebody else has taken the directory meanwhile.
        """
        from analysis.reporting.result_directory import take_directory
        from diagrams import RunAudio

        with _naming_option():
            taken = take_directory(self._path)
        try:
            with RunAudio(self._scenario, self._path) as self._files:
                yield self._files
        finally:
            # Directories that were made, and stayed empty.
            taken.undo()

    @property
    def heard(self) -> Path:
        """What the first robot that listens has heard; the file is closed by then."""
        assert self._files is not None
        return self._files.first_heard

    def left(self) -> str:
        """What an interrupt leaves, in words; nothing where there is nothing."""
        if self._files is None or self._files.until_s == 0.0:
            return ""
        return f"the sound until {self._files.until_s:g} s is in {self._shown}"

    def facts(self) -> dict[str, Any]:
        """The directory, and what stands in which file, as plain values."""
        assert self._files is not None
        return {"directory": str(self._shown), **self._files.facts()}

    def text(self) -> str:
        """The line of a summary."""
        return f"{'sound':<21} {self._shown}"


@contextmanager
def _naming_option() -> Iterator[None]:
    """Errors of a directory name this option."""
    from systems.framework.input_error import InputError

    try:
        yield
    except InputError as error:
        raise InputError("save_audio", error.message) from None
