"""Finds faults of the description of an array: size, order, and speed of sound.

The delays of all pairs of channels, frame by frame, are compared with those that a
source can cause at the stated positions.
"""

from __future__ import annotations

from collections.abc import Callable

from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.frame_delays import (
    DelayScale,
    FrameDelays,
    delay_scale,
    exchanged_channels,
    misfit,
    near_range_m,
    slower_than_stated,
)
from systems.hearing.source_fix import NEAREST_M
from systems.sound.array_shape import ArrayShape

# Least number of frames that must agree. Fewer frames may agree by chance, for example
# in a recording with few long frames.
_LEAST_FRAMES = 16

# Delays that are too long by more than this factor mean wrong units of the positions.
# Up to this factor, they mean wrong positions or wrongly ordered channels.
_OTHER_UNITS = 3.5

# Distance from the middle up to which a source is amid the array, in apertures.
_AMID = 0.1

# Largest plausible distance of a source straight above the array, m.
_FARTHEST_M = 20.0


def geometry_faults(
    delays: FrameDelays, c: float, farther: Callable[[], list[FrameDelays]]
) -> list[ChannelFault]:
    """Finds faults of the geometry that delays of the channels show.

    ``c`` is the stated speed of sound, m/s. ``farther`` returns the delays from
    searches over longer delays.
    """
    # On a body, only the delays of distant sources are known.
    in_air = delays.shape.body is None
    speed = _speed_fault(delays, c) if in_air else None
    if speed is not None:
        return [speed]
    order = _order(delays)
    if any(fault.kind == "swapped" for fault in order):
        return order
    near = _near(delays) if in_air else None
    if near is not None:
        return [near]
    scale = delay_scale(delays)
    if scale is None and not _fits(delays):
        scales = (delay_scale(seen) for seen in farther())
        scale = next((found for found in scales if found is not None), None)
    return order if scale is None else [_scale_fault(scale, delays.shape)]


def _speed_fault(delays: FrameDelays, c: float) -> ChannelFault | None:
    ratio = slower_than_stated(delays)
    if ratio is None:
        return None
    return ChannelFault(
        "speed",
        (),
        f"microphones: the delays fit a speed of sound of about "
        f"{10 * round(0.1 * c / ratio)} m/s, not {c:.0f} m/s; state 'sound_speed' "
        f"(in water 1480), or divide the positions by {1.0 / ratio:.2g}",
    )


def _near(delays: FrameDelays) -> ChannelFault | None:
    distance = near_range_m(delays)
    # All delays of a source amid the array are short, as with positions in other units.
    if distance is None or distance < _AMID * delays.shape.aperture_m:
        return None
    return ChannelFault(
        "near",
        (),
        f"the source is about {distance:.2f} m from the middle of the "
        f"array; make sounds at least {NEAREST_M:g} m away",
    )


def _fits(delays: FrameDelays) -> bool:
    agreed, _ = delays.agreeing()
    return len(agreed) >= max(_LEAST_FRAMES, len(delays.lags) / 2)


def _scale_fault(scale: DelayScale, shape: ArrayShape) -> ChannelFault:
    size = f"an array of {shape.aperture_m:.3g} m"
    if scale.kind == "beyond":
        remedy = "check the positions (in m) and the order of the channels"
        if scale.share > _OTHER_UNITS:
            remedy = "give positions in m (multiply them by 10, 100 or 1000?)"
        times = f"{scale.share:.1f} times as long as sound takes along it"
        text = f"microphones: {size} cannot have delays {times}; {remedy}"
        return ChannelFault("units", (), text)
    said = f"delays are below {100 * scale.share:.1g} % of what {size} can have"
    if shape.kind == "space" or scale.least_range_m > _FARTHEST_M:
        remedy = "give positions in m (divide those in cm by 100, in mm by 1000)"
        return ChannelFault("units", (), f"microphones: {said}; {remedy}")
    where = "ahead of" if shape.kind == "row" else "above or below"
    cause = f"the source is straight {where} it, or the positions are not in m"
    text = f"microphones: {said}: {cause}; check the positions"
    return ChannelFault("size", (), text)


def _order(delays: FrameDelays) -> list[ChannelFault]:
    """Finds exchanged channels, or a geometry that the delays do not fit."""
    exchanges = exchanged_channels(delays)
    if exchanges:
        names = " or ".join(f"{a + 1} and {b + 1}" for a, b in exchanges)
        text = (
            f"channels {names}: exchanged, because the delays fit the geometry only in "
            "the other order; exchange them in 'channels'"
        )
        channels = tuple(sorted({k for pair in exchanges for k in pair}))
        return [ChannelFault("swapped", channels, text)]
    share = misfit(delays)
    if share is None:
        return []
    text = (
        f"channels: {100 * share:.0f} % of the delays fit no place outside the array; "
        "check the microphones' positions (in m), their order and the speed of sound, "
        "and state the 'body' if the microphones are on a sphere"
    )
    return [ChannelFault("geometry", (), text)]
