"""Base classes of all results, and the class of work that is ready to start."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Output", "Prepared", "Result"]


class Output(ABC):
    """What a command prints: a JSON document or text."""

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """Returns the JSON document of the command, from plain values."""

    @abstractmethod
    def __str__(self) -> str:
        """Returns the text that the command prints, without a final newline."""

    def failure(self, out: Path | None) -> Exception | None:
        """Returns an exception if the command fails although it has a result.

        Args:
            out: Directory that contains the files; None if there are no files.

        Returns:
            The exception, whose message the command prints. None if the command
            succeeds.
        """
        return None


class Result(Output):
    """Result of a public function, and of the command with the same name."""

    where: ClassVar[str] = ""
    """Last lines that the command prints, with ``{out}`` for the directory. Empty means
    those of the command."""

    if not TYPE_CHECKING:  # type checkers report unknown attributes themselves

        def __getattr__(self, name: str) -> Any:
            """Raises an error that names the attribute that is meant."""
            if hasattr(type(self), name):  # a property has raised an AttributeError
                return object.__getattribute__(self, name)
            from phonotaxis.other_names import of_result

            known = {*dir(type(self)), *vars(self)}
            hint = of_result(name, (each for each in known if each[0] != "_"))
            kind = type(self).__name__
            raise AttributeError(f"{kind!r} object has no attribute {name!r}{hint}")

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings and remarks about the result, each in one line."""
        return ()

    @property
    def out(self) -> Path | None:
        """Directory that already contains the files; None before ``save``."""
        return None

    @abstractmethod
    def plot(self) -> Figure | dict[str, Figure]:
        """Draws the result: one figure, or several figures by name."""

    @abstractmethod
    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes the files of the result into an existing directory.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """

    def save(self, directory: str | Path | None = None) -> Path:
        """Writes the files of the result into a new directory.

        Args:
            directory: New or empty directory. None means the next number under
                ``results``.

        Returns:
            Path of the directory.

        Raises:
            InputError: The directory is in use, or cannot be created or written.
        """
        from analysis.report.result_directory import whole_directory

        with whole_directory(directory) as (shown, partial):
            self.write({**self.document(), "out": str(shown)}, partial)
        return shown

    def save_figures(self, directory: str | Path) -> list[Path]:
        """Writes all figures as PDF, SVG and PNG files, for papers.

        Args:
            directory: Directory, which is created if it does not exist.

        Returns:
            Paths of the files.
        """
        from analysis.report.figure_files import write_figures

        return write_figures(self.figures(), Path(directory))

    def figures(self) -> dict[str, Figure]:
        """Draws all figures of the result, by name; those of ``plot`` at least."""
        figures = self.plot()
        return figures if isinstance(figures, dict) else {"figure": figures}


Output_co = TypeVar("Output_co", bound=Output, covariant=True)


@dataclass(frozen=True, kw_only=True)
class Prepared(Generic[Output_co]):
    """Work whose input has been checked, and which can be done once."""

    run: Callable[[Callable[[Any], None]], Output_co]
    """Does the work. The argument is a function that ``run`` calls during the work:
    with the amount of finished work in ``unit``, or with the name of the next step. If
    this function raises an exception, the work ends."""
    total: float = 0.0
    """Total amount of work; 0 if ``run`` does not report its progress."""
    unit: str = ""
    """Unit of the work, for example runs."""
    done: float = 0.0
    """Amount of work that earlier runs of the command have already done."""
    left: Callable[[], str] = str
    """Returns a text about files that remain after an interrupt; it can be empty."""
    stay: Callable[[], None] | None = None
    """Goes on after the command has printed its result, until an interrupt."""


def ignore(done: Any) -> None:
    """Does nothing; stands for a missing ``progress`` function."""
