"""Radio: frames, the air between robots, and who listens."""

from systems.radio.codec import Frame, decode_frame, encode_frame
from systems.radio.radio_channel import RadioChannel, RadioParameters
from systems.radio.radio_range import RadioRange
from systems.radio.sink_monitor import SinkMonitor
from systems.radio.stream import StreamParser

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
