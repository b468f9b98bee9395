"""Whether sound can be of an array, and arrays of some of its microphones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.recordings.array_geometry import ROBOT_ARRAY, ArrayGeometry

__all__ = ["array_mismatch", "chosen_microphones"]

_RATES_HZ = (8_000, 192_000)


def array_mismatch(geometry: ArrayGeometry, channels: int, rate: int) -> str:
    """Why an array cannot have made a recording.

    Args:
        geometry: The array.
        channels: Their number in the recording.
        rate: Its sample rate, Hz.

    Returns:
        What goes on from its name; empty if it can have.
    """
    count, needed = channels, len(geometry.microphones)
    if geometry.channels is not None and max(geometry.channels) >= count >= needed:
        return (
            f"has {count} channels, numbers 0 to {count - 1}; 'channels' in the "
            f"geometry file counts from 0 and names {max(geometry.channels)}"
        )
    if max(geometry.columns) >= count:
        what = "is mono" if count == 1 else f"has {count} channels"
        return (
            f"{what}, but the array needs {max(needed, max(geometry.columns) + 1)}; "
            "record every microphone on a channel of its own"
        )
    if geometry.channels is None and count > needed:
        default = geometry.microphones == ROBOT_ARRAY.microphones
        remedy = (
            "give the places of its microphones by --geometry FILE"
            if default
            else "name the channels to use in the geometry file, as "
            f"'channels: {list(range(needed))}'"
        )
        whose = "the robot's own array" if default else "the array"
        return f"has {count} channels, but {whose} {needed} microphones; {remedy}"
    if not _RATES_HZ[0] <= rate <= _RATES_HZ[1]:
        low, high = _RATES_HZ
        return f"has a sample rate of {rate} Hz; record at {low} to {high} Hz"
    if geometry.band is not None and rate < 2.0 * geometry.band[1]:
        return (
            f"has a sample rate of {rate} Hz, below twice the band's upper end of "
            f"{geometry.band[1]:g} Hz; lower the band or record at a higher rate"
        )
    return ""


def chosen_microphones(geometry: ArrayGeometry, chosen: Sequence[int]) -> ArrayGeometry:
    """An array of some of the microphones.

    Args:
        geometry: All of them.
        chosen: The numbers of those that stay, from 0.

    Returns:
        Their array.

    Raises:
        ValueError: They are too few.
    """
    fields = geometry.model_dump(exclude_unset=True)
    fields["microphones"] = [geometry.microphones[k] for k in chosen]
    fields["channels"] = [geometry.columns[k] for k in chosen]
    if isinstance(std := geometry.position_std_m, tuple):
        fields["position_std_m"] = [std[k] for k in chosen]
    if geometry.position_covariance_m2 is not None:
        matrix = np.array(geometry.position_covariance_m2)
        axes = len(geometry.microphones[0])
        if len(matrix) > axes:
            rows = [axes * k + axis for k in chosen for axis in range(axes)]
            fields["position_covariance_m2"] = matrix[np.ix_(rows, rows)].tolist()
    return ArrayGeometry(**fields)
