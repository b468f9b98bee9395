"""Sources while they sound: streams of sound, what is wrong with them, and views."""

from analysis.listening.live_hearing import (
    HeardStep,
    HeardStream,
    LiveHearing,
    listen,
)
from analysis.listening.sound_card import open_card
from analysis.listening.sound_pipe import open_flac, open_pipe
from analysis.listening.sound_stream import (
    SoundBlock,
    SoundStream,
    StreamBrokenError,
)

__all__ = [
    "HeardStep",
    "HeardStream",
    "LiveHearing",
    "SoundBlock",
    "SoundStream",
    "StreamBrokenError",
    "listen",
    "open_card",
    "open_flac",
    "open_pipe",
]
