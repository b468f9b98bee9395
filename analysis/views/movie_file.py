"""Encodes movies as GIF files with Pillow, or as MP4 files with ffmpeg.

The file of a movie appears only after the whole movie is encoded.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.run_error import RunError
from systems.framework.input_error import InputError

#: Frames per second, by file extension. A GIF stores durations in units of 10 ms.
FRAMES_PER_S = {".gif": 10.0, ".mp4": 25.0}
#: Codecs of ffmpeg that an MP4 file needs.
_CODECS = ("libx264", "aac")


class MovieFile:
    """Output file of a movie.

    The name of the file must end in .gif or .mp4. The file must not exist, but its
    directory must. The constructor raises an InputError if one of these conditions does
    not hold, if the directory is not writable, or if an MP4 file needs an encoder that
    is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path).expanduser()
        ending = self.path.suffix.lower()
        if ending not in FRAMES_PER_S:
            raise _refused(f"{path} is neither .gif nor .mp4; name a file of one kind")
        try:
            exists = self.path.exists()
        except OSError as error:  # for example, the name is too long
            raise _refused(f"{path} is not a usable path ({error.strerror})") from None
        if exists:
            raise _refused(f"{path} already exists; name another file")
        folder = self.path.parent
        if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
            raise _refused(
                f"{folder} is not a directory that can be written; create it"
            )
        self.frames_per_s = FRAMES_PER_S[ending]
        self._ffmpeg = _find_ffmpeg() if ending == ".mp4" else ""

    @property
    def has_sound(self) -> bool:
        """Whether the file format supports sound."""
        return bool(self._ffmpeg)

    def write(
        self, frames: Iterable[NDArray[np.uint8]], sound: Path | None = None
    ) -> None:
        """Encodes frames of equal size, and writes the file.

        Each frame has the shape (rows, columns, 3): red, green and blue, 0 to 255.
        ``sound`` is a sound file with one channel per microphone, the leftmost
        microphone first. An MP4 file gets the two outer microphones as left and right
        channel. A GIF file has no sound. The function raises a RunError if the encoder
        fails, or if the file cannot be written.
        """
        handle, partial = tempfile.mkstemp(
            prefix=".movie.", suffix=self.path.suffix, dir=self.path.parent
        )
        os.close(handle)
        try:
            if self.has_sound:
                self._write_mp4(frames, sound, Path(partial))
            else:
                self._write_gif(frames, Path(partial))
            Path(partial).chmod(0o644)
            Path(partial).rename(self.path)
        except OSError as error:
            reason = error.strerror
            raise RunError(f"{self.path} cannot be written ({reason})") from None
        finally:
            with suppress(FileNotFoundError):
                Path(partial).unlink()

    def _write_gif(self, frames: Iterable[NDArray[np.uint8]], path: Path) -> None:
        from PIL import Image

        images = (Image.fromarray(frame).quantize(128) for frame in frames)
        first = next(images)
        first.save(
            path,
            save_all=True,
            append_images=images,
            duration=round(1000.0 / self.frames_per_s),
            loop=0,
        )

    def _write_mp4(
        self, frames: Iterable[NDArray[np.uint8]], sound: Path | None, path: Path
    ) -> None:
        pictures = iter(frames)
        first = next(pictures)
        rows, columns, _ = first.shape
        words = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{columns}x{rows}"]
        words += ["-r", f"{self.frames_per_s:g}", "-i", "-"]
        if sound is not None:
            words += ["-i", str(sound), "-af", _stereo(sound), "-c:a", "aac"]
        # All players support even sizes and this pixel format.
        words += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"]
        words += ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
        with tempfile.TemporaryFile() as log:
            process = subprocess.Popen(
                [self._ffmpeg, "-v", "error", "-y", *words, str(path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=log,
            )
            assert process.stdin is not None
            try:
                with process.stdin as pipe:
                    pipe.write(first.tobytes())
                    for frame in pictures:
                        pipe.write(frame.tobytes())
            except BrokenPipeError:
                pass  # the log of ffmpeg contains the reason
            except BaseException:
                process.kill()
                process.wait()
                raise
            if process.wait():
                log.seek(0)
                said = log.read().decode(errors="replace").strip().splitlines()
                reason = said[-1] if said else "it does not say why"
                raise RunError(f"ffmpeg failed: {reason}")


def _stereo(sound: Path) -> str:
    """Returns an ffmpeg filter that makes loud stereo sound from outer microphones."""
    import soundfile

    last = soundfile.info(sound).channels - 1
    pan = f"pan=stereo|c0=c0|c1=c{last}"
    samples, _ = soundfile.read(sound, dtype="float32")
    loudest = float(np.max(np.abs(samples), initial=0.0))
    gain = min(0.9 / loudest, 1e4) if loudest > 0.0 else 1.0
    # AAC does not support all sample rates of the converters.
    return f"{pan},volume={gain:.6g},aresample=48000"


def _find_ffmpeg() -> str:
    """Returns the path of an ffmpeg program that has all codecs."""
    program = shutil.which("ffmpeg")
    if importlib.util.find_spec("imageio_ffmpeg") is not None:
        import imageio_ffmpeg

        with suppress(RuntimeError):
            program = imageio_ffmpeg.get_ffmpeg_exe()
    remedy = "pip install 'phonotaxis[movie]', or ffmpeg, or write a .gif"
    if program is None:
        raise _refused(f"an .mp4 needs ffmpeg, which is not installed: {remedy}")
    done = subprocess.run(
        [program, "-hide_banner", "-encoders"],
        capture_output=True,
        text=True,
        check=False,
    )
    for codec in _CODECS:
        if f" {codec} " not in done.stdout:
            raise _refused(f"{program} cannot encode {codec}: {remedy}")
    return program


def _refused(why: str) -> InputError:
    return InputError("movie", why)
