"""Radio: frames, the air between robots, and who listens."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.radio.codec import Frame, decode_frame, encode_frame
    from systems.radio.parameters import RadioParameters
    from systems.radio.radio_channel import RadioChannel
    from systems.radio.radio_range import RadioRange
    from systems.radio.sink_monitor import SinkMonitor
    from systems.radio.stream import StreamParser
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "Frame",
    "RadioChannel",
    "RadioParameters",
    "RadioRange",
    "SinkMonitor",
    "StreamParser",
    "decode_frame",
    "encode_frame",
]
