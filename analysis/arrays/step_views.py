"""Displays the steps of ``phonotaxis listen``: as JSON, as text, or on a screen."""

from __future__ import annotations

import json
import math
import shutil
from contextlib import AbstractContextManager
from typing import TextIO

from analysis.arrays.live_hearing import HeardStep, track_document
from analysis.arrays.voting.source_listener import TrackedSources
from analysis.arrays.voting.track_state import SourceTrack

# _COLUMNS: largest number of columns of the compass. It is odd so that the direction
#   ahead is in the middle.
# _LEAST_COLUMNS: least number of columns of the compass.
_COLUMNS, _LEAST_COLUMNS = 73, 25

# _LEVELS_DB: lowest and highest level that the level bar shows, dB.
# _BARS: number of characters of the level bar.
_LEVELS_DB, _BARS = (-72.0, 0.0), 12

_HIDE, _SHOW, _TO_END, _BELOW = "\x1b[?25l", "\x1b[?25h", "\x1b[K", "\x1b[J"


class TextLines(AbstractContextManager["TextLines"]):
    """Writes sources to ``out``, one line per second, and faults to ``errors``."""

    def __init__(self, out: TextIO, errors: TextIO) -> None:
        self._out, self._errors = out, errors

    def tell(self, step: HeardStep) -> None:
        """Writes the sources of a step if its time is a whole second."""
        t_s = step.sources.t_s
        if abs(t_s - round(t_s)) < 1e-6:
            each = "  ".join(_words(track) for track in step.sources.tracks)
            self._out.write(f"{t_s:8.1f} s  {step.level_db:4.0f} dB  {each}\n")
            self._out.flush()

    def name_fault(self, fault: str, t_s: float) -> None:
        """Writes a fault at a time in s of sound."""
        self._errors.write(f"phonotaxis: at {t_s:.1f} s: {fault}\n")
        self._errors.flush()

    def __exit__(self, *_: object) -> None:
        """Does nothing, because there is nothing to end."""


class JsonLines(TextLines):
    """Writes one JSON line per source and step, and one per fault."""

    def tell(self, step: HeardStep) -> None:
        """Writes the sources of a step immediately, one line per source."""
        for line in track_document(step):
            self._out.write(f"{json.dumps(line, allow_nan=False)}\n")
        self._out.flush()

    def name_fault(self, fault: str, t_s: float) -> None:
        """Writes a fault to both streams."""
        super().name_fault(fault, t_s)
        self._out.write(f"{json.dumps({'t_s': round(t_s, 6), 'fault': fault})}\n")
        self._out.flush()


class Screen(TextLines):
    """Draws the latest step on the terminal ``out``, over the previous step."""

    def __init__(self, out: TextIO, errors: TextIO) -> None:
        super().__init__(out, errors)
        self._faults: list[str] = []
        self._step = HeardStep(TrackedSources(0.0, ()), _LEVELS_DB[0])
        self._height = 0

    def tell(self, step: HeardStep) -> None:
        """Draws a step over the previous step."""
        self._step = step
        self._draw()

    def name_fault(self, fault: str, t_s: float) -> None:
        """Adds a fault, which stays on the screen."""
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

    def __exit__(self, *_: object) -> None:
        """Leaves the last step on the screen, and shows the cursor below it."""
        self._out.write(_SHOW)
        self._out.flush()


def view(step: HeardStep, width: int, faults: list[str]) -> list[str]:
    """Formats a step as lines of text for a screen with ``width`` columns.

    The lines are a compass, one line per source, and one line per fault. The middle of
    the compass is straight ahead (+x). Bearings to the left are in its left half, those
    to the right in its right half. Both ends are straight behind.
    """
    columns = min(_COLUMNS, max(_LEAST_COLUMNS, width - 3) // 2 * 2 + 1)
    marks, names = ["·"] * columns, [" "] * columns
    for degrees in (180, 90, 0, -90, -180):
        column = _column(math.radians(degrees), columns)
        marks[column] = "|"
        name = f"{degrees:+d}" if degrees % 180 else f"{abs(degrees)}"
        first = min(max(0, column - len(name) // 2), columns - len(name))
        names[first : first + len(name)] = name
    # If several sources share a column, the most certain one is visible.
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
