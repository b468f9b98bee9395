"""Tracking of all sound sources in a stream of sound."""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from phonotaxis.result import Result

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from analysis.arrays.array_geometry import ArrayGeometry
    from analysis.arrays.live_hearing import HeardStep, HeardStream
    from analysis.arrays.sound_pipe import SampleFormat
    from analysis.arrays.sound_stream import SoundStream

__all__ = ["ListenResult", "listen"]

#: Number of estimates that a result keeps: those of at least an hour.
_MOST_ROWS = 100_000


@dataclass(frozen=True, repr=False)
class ListenResult(Result):
    """The sources that were heard in a stream."""

    heard: HeardStream
    """How long the stream was, how it ended, and its faults."""
    rows: Sequence[dict[str, Any]]
    """The latest 100 000 estimates, in the order of time."""

    def __repr__(self) -> str:
        return f"<ListenResult {self.heard.seconds:.1f} s: {self.heard.status}>"

    @property
    def table(self) -> pd.DataFrame:
        """Table with one row per source and step: times in s, angles in deg."""
        import pandas as pd

        return pd.DataFrame(list(self.rows))

    def document(self) -> dict[str, Any]:
        """Returns the last line of ``phonotaxis listen --json``."""
        return self.heard.document()

    def __str__(self) -> str:
        """How the stream ended, in one line."""
        return (
            f"{self.heard.status}; {self.heard.seconds:.1f} s heard, sources: "
            f"{len(self.heard.identities)}"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Faults of the stream and of its channels."""
        return tuple(self.heard.faults)

    def failure(self, out: Path | None) -> Exception | None:
        """Returns an error if the stream ended by a fault."""
        from analysis.run_error import RunError

        return RunError(self.heard.status) if self.heard.failed else None

    def plot(self) -> Figure:
        """Draws the bearings of all sources over time."""
        from analysis.arrays.track_plots import plot_tracks

        return plot_tracks(self.table)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes ``listen.json``, ``tracks.csv`` and ``listen.png``.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        from analysis.report.plain_values import write_json

        write_json(document, directory / "listen.json")
        self.table.to_csv(directory / "tracks.csv", index=False)
        self.plot().savefig(directory / "listen.png", dpi=150)


def listen(
    sound: str | Path | BinaryIO | None = None,
    geometry: ArrayGeometry | str | Path | Sequence[Sequence[float]] | None = None,
    *,
    device: str | int | None = None,
    channels: int | None = None,
    sample_rate_hz: int | None = None,
    sample_format: SampleFormat = "s16le",
    step: Callable[[HeardStep], None] | None = None,
    fault: Callable[[str, float], None] | None = None,
) -> ListenResult:
    """Tracks all sources in a live or recorded sound, until the sound ends.

    An interrupt (Ctrl-C) ends the function, too. The result then states the sources
    until the interrupt.

    Args:
        sound: WAV or FLAC file, file of raw samples, or an open pipe of WAV or raw
            samples with a file descriptor. None means the sound card.
        geometry: Geometry of the microphones, the path of a geometry file, or a list of
            positions (x, y) or (x, y, z) in m. None: the robot's own array.
        device: Name or number of the sound card, if ``sound`` is None. None means the
            default card.
        channels: Number of channels of raw samples or of the sound card. None: as in
            the array.
        sample_rate_hz: Sample rate of raw samples or of the sound card, Hz. None: the
            rate that a file states, or 48 kHz from the sound card.
        sample_format: Format of raw samples.
        step: Function that is called with the sources of each step as soon as they are
            known.
        fault: Function that is called once for each fault as soon as it is detected,
            with the message and the time in s.

    Returns:
        Estimates, how the stream ended, and its faults. A stream that ended by a fault
        has ``heard.failed``.

    Raises:
        InputError: The stream cannot be opened, does not match the array, or cannot be
            used.
    """
    from systems.framework.input_error import InputError

    for name, value in (("channels", channels), ("sample_rate_hz", sample_rate_hz)):
        if value is not None and value < 1:
            raise InputError(name, f"is {value}; give a number above 0")
    stream, known = open_sound(
        sound,
        geometry,
        device=device,
        channels=channels,
        sample_rate_hz=sample_rate_hz,
        sample_format=sample_format,
    )
    return track_sources(stream, known, step, fault)


def track_sources(
    stream: SoundStream,
    geometry: ArrayGeometry,
    step: Callable[[HeardStep], None] | None = None,
    fault: Callable[[str, float], None] | None = None,
) -> ListenResult:
    """Tracks the sources in an open stream; see ``listen``."""
    from analysis.arrays.live_hearing import LiveHearing, listen_to, track_document

    rows: deque[dict[str, Any]] = deque(maxlen=_MOST_ROWS)

    def keep(heard: HeardStep) -> None:
        rows.extend(track_document(heard))
        if step is not None:
            step(heard)

    hearing = LiveHearing(stream, geometry, fault or (lambda message, t_s: None))
    # The listening thread must not wait long for the thread that checks channels.
    before = sys.getswitchinterval()
    sys.setswitchinterval(before / 10.0)
    try:
        listen_to(hearing, keep)
    except KeyboardInterrupt:
        hearing.heard.status = "interrupted"
    finally:
        sys.setswitchinterval(before)
    return ListenResult(hearing.heard, rows)


def open_sound(
    sound: str | Path | BinaryIO | None,
    geometry: ArrayGeometry | str | Path | Sequence[Sequence[float]] | None,
    *,
    device: str | int | None,
    channels: int | None,
    sample_rate_hz: int | None,
    sample_format: SampleFormat,
) -> tuple[SoundStream, ArrayGeometry]:
    """Opens a stream of sound, and loads the geometry of its array; see ``listen``."""
    from analysis.arrays.array_geometry import make_geometry
    from analysis.arrays.flac_stream import open_flac
    from analysis.arrays.sound_card import open_card
    from analysis.arrays.sound_pipe import open_pipe
    from systems.framework.input_error import InputError

    known = make_geometry(geometry)
    if known.known.far_apart:
        size = known.known.shape.aperture_m
        raise InputError(
            "geometry",
            f"has microphones {size:.3g} m apart, too far for a live direction; give "
            "positions in m (divide those in cm by 100), or locate recordings with "
            "'phonotaxis locate'",
        )
    every = max(known.columns) + 1
    if sound is None:
        stream = open_card(
            device,
            channels=channels or every,
            sample_rate_hz=sample_rate_hz or 48_000,
        )
        return stream, known
    if isinstance(sound, str | Path):
        path = Path(sound)
        try:
            pipe: BinaryIO = path.open("rb")  # the stream reads it to its end
        except OSError as error:
            text = f"cannot read it ({error}); name a file"
            raise InputError("input", text) from None
        if path.is_file() and os.pread(pipe.fileno(), 4, 0) == b"fLaC":
            pipe.close()
            stream = open_flac(path, channels=channels, sample_rate_hz=sample_rate_hz)
            return stream, known
    else:
        pipe = sound
    stream = open_pipe(
        pipe,
        raw_channels=every,
        channels=channels,
        sample_rate_hz=sample_rate_hz,
        sample_format=sample_format,
    )
    return stream, known
