"""Sources while they sound: streams of sound, what is wrong with them, and views."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
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
else:
    __getattr__, __dir__ = lazy_exports(__name__)

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
