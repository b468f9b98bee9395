"""How ``phonotaxis listen`` tells what it hears: JSON lines, text, or a screen."""

from __future__ import annotations

import json
import math
import shutil
from types import TracebackType
from typing import Protocol, TextIO

from analysis.arrays.voting.source_listener import TrackedSources
from analysis.arrays.voting.source_tracks import SourceTrack
from analysis.listening.live_hearing import HeardStep, track_document

# Columns of the compass, which is odd so that ahead is in its middle, and its least.
_COLUMNS, _LEAST_COLUMNS = 73, 25

# Levels from the quietest to the loudest that are shown, dB, by so many bars.
_LEVELS_DB, _BARS = (-72.0, 0.0), 12

_HIDE, _SHOW, _TO_END, _BELOW = "\x1b[?25l", "\x1b[?25h", "\x1b[K", "\x1b[J"


class Teller(Protocol):
    """Tells steps and faults while they come."""

    def tell(self, step: HeardStep) -> None:
        """The sources of a step."""

    def name_fault(self, fault: str, t_s: float) -> None:
        """A fault that was seen at t.

        Args:
            fault: In words.
            t_s: When it was seen, s of sound.
        """

    def __enter__(self) -> object:
        """Begins."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Ends, however that comes."""


class TextLines:
    """A line a second.

    Args:
        out: Where sources are told.
        errors: Where faults are named.
    """

    def __init__(self, out: TextIO, errors: TextIO) -> None:
        self._out, self._errors = out, errors

    def tell(self, step: HeardStep) -> None:
        """The sources of a step, if a second is full."""
        t_s = step.sources.t_s
        if abs(t_s - round(t_s)) < 1e-6:
            each = "  ".join(_words(track) for track in step.sources.tracks)
            self._out.write(f"{t_s:8.1f} s  {step.level_db:4.0f} dB  {each}\n")
            self._out.flush()

    def name_fault(self, fault: str, t_s: float) -> None:
        """A fault, on standard error.

        Args:
            fault: In words.
            t_s: When it was seen, s of sound.
        """
        self._errors.write(f"phonotaxis: at {t_s:.1f} s: {fault}\n")
        self._errors.flush()

    def __enter__(self) -> TextLines:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Nothing to end."""


class JsonLines(TextLines):
    """A line for each source and step, and for each fault."""

    def tell(self, step: HeardStep) -> None:
        """The sources of a step, at once."""
        for line in track_document(step):
            self._out.write(f"{json.dumps(line, allow_nan=False)}\n")
        self._out.flush()

    def name_fault(self, fault: str, t_s: float) -> None:
        """A fault, on both streams.

        Args:
            fault: In words.
            t_s: When it was seen, s of sound.
        """
        super().name_fault(fault, t_s)
        self._out.write(f"{json.dumps({'t_s': round(t_s, 6), 'fault': fault})}\n")
        self._out.flush()


class Screen(TextLines):
    """All of it in place, each step written at once over the last one.

    Args:
        out: A terminal.
        errors: Not used: faults stay on the screen.
    """

    def __init__(self, out: TextIO, errors: TextIO) -> None:
        super().__init__(out, errors)
        self._faults: list[str] = []
        self._step = HeardStep(TrackedSources(0.0, ()), _LEVELS_DB[0])
        self._height = 0

    def tell(self, step: HeardStep) -> None:
        """Draws a step over the last one."""
        self._step = step
        self._draw()

    def name_fault(self, fault: str, t_s: float) -> None:
        """A fault stays on the screen.

        Args:
            fault: In words.
            t_s: When it was seen, s of sound.
        """
        self._faults.append(f"! {t_s:.1f} s: {fault}")
        self._draw()

    def _draw(self) -> None:
        size = shutil.get_terminal_size()
        lines = view(self._step, size.columns, self._faults)[: size.lines - 1]
        back = f"\x1b[{self._height}F" if self._height else ""
        text = "".join(f"{line[: size.columns - 1]}{_TO_END}\n" for line in lines)
        self._out.write(f"{back}{text}{_BELOW}")
        self._out.flush()
        self._height = len(lines)

    def __enter__(self) -> Screen:
        self._out.write(_HIDE)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leaves the last step where it is, and the cursor below it."""
        self._out.write(_SHOW)
        self._out.flush()


def view(step: HeardStep, width: int, faults: list[str]) -> list[str]:
    """A step as lines of text: a compass, and a line for each source and fault.

    Args:
        step: What was heard.
        width: Columns that there are.
        faults: A line each.

    Returns:
        The lines. The compass goes from behind over the left and ahead (+x) to behind.
    """
    columns = min(_COLUMNS, max(_LEAST_COLUMNS, width - 3) // 2 * 2 + 1)
    marks, names = ["·"] * columns, [" "] * columns
    for degrees in (180, 90, 0, -90, -180):
        column = _column(math.radians(degrees), columns)
        marks[column] = "|"
        name = f"{degrees:+d}" if degrees % 180 else f"{abs(degrees)}"
        first = min(max(0, column - len(name) // 2), columns - len(name))
        names[first : first + len(name)] = name
    # The surest one on top, where several are in a column.
    for track in sorted(step.sources.tracks, key=lambda track: track.sounding):
        marks[_column(track.bearing, columns)] = str(track.identity % 10)
    low, high = _LEVELS_DB
    share = min(1.0, max(0.0, (step.level_db - low) / (high - low)))
    bar = ("█" * round(_BARS * share)).ljust(_BARS, "░")
    return [
        f" {step.sources.t_s:8.1f} s   level {bar} {step.level_db:4.0f} dB",
        f" {''.join(names)}",
        f" {''.join(marks)}",
        *(f"   {_words(track)}" for track in step.sources.tracks),
        *faults,
    ]


def _column(bearing: float, columns: int) -> int:
    return round((0.5 - bearing / (2.0 * math.pi)) * (columns - 1))


def _words(track: SourceTrack) -> str:
    state = "sounds" if track.sounding > 0.5 * track.confidence else "pauses"
    height = ""
    if track.elevation is not None:
        height = f"  elevation {math.degrees(track.elevation):+.0f} deg"
    return (
        f"{track.identity}: {math.degrees(track.bearing):+4.0f} "
        f"±{math.degrees(track.bearing_std):.0f} deg{height}  "
        f"{100.0 * track.confidence:3.0f} %  {state}"
    )
