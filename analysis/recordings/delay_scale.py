"""Checks whether delays match the size of an array, or a much larger or smaller array.

Sound takes at most the straight travel time from one microphone to another. The delays
of all pairs can be much shorter in only one case. In this case, the source is straight
ahead of a row, or straight above a plane. It is also far away, because the wave fronts
must be nearly flat.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from analysis.recordings.channel_order import FrameDelays

#: If delays do not fit the array, the search covers delays up to these path lengths, m.
REACHES_M = (0.3, 3.0)

# _LEAST_FRAMES: least number of frames that agree on their delays.
# _LEAST_SHARE: least share of such frames among all frames.
_LEAST_FRAMES, _LEAST_SHARE = 5, 0.2

# Limits of delays, as a share of the longest possible delay:
# - _IMPOSSIBLE: if half of the frames exceed this share, the delays are too long.
# - _NOTHING: if the share _MOST of the frames stays below this, the delays are too
#   short. They may also be those of a source straight above the array.
# - _MOST: share of the frames for _NOTHING.
# For comparison, positions in inches give a share of 0.025, and positions in cm 0.01.
_IMPOSSIBLE, _NOTHING = 1.5, 0.03
_MOST = 0.75

# Least distance of a pair as a share of the aperture. The delays of shorter pairs are
# too short to compare.
_LONG = 0.3

# Possible error of a delay, samples.
_SAMPLES = 1.0


class DelayScale(NamedTuple):
    """Ratio of measured delays to the longest delays that the array allows."""

    kind: Literal["beyond", "nothing"]
    share: float
    """Delay divided by the longest delay that the array allows. If ``kind`` is
    ``beyond``, it is the median of all frames. If ``kind`` is ``nothing``, three
    quarters of the frames have a smaller value."""
    least_range_m: float
    """Least distance of the source, m, if the array really has the stated size."""


def delay_scale(delays: FrameDelays) -> DelayScale | None:
    """Checks whether delays are too long or too short for the size of the array.

    Args:
        delays: Delays of all pairs of microphones in some frames.

    Returns:
        The ratio of the delays to the longest possible delays. None if the delays match
        the size of the array, or if the pairs agree in too few frames.
    """
    shape, error = delays.shape, _SAMPLES * delays.metres_per_sample
    d, _ = delays.agreeing(error)
    if len(d) < max(_LEAST_FRAMES, _LEAST_SHARE * len(delays.lags)):
        return None
    later = np.hstack((np.zeros((len(d), 1)), d))
    i, j = shape.pairs.T
    paths = np.abs(later[:, j] - later[:, i])
    certain = paths - error - delays.misplaced_m
    over = float(np.median((certain / shape.distances_m).max(axis=1)))
    if over > _IMPOSSIBLE:
        return DelayScale("beyond", over, 0.0)
    long = shape.distances_m > _LONG * shape.aperture_m
    shares = (paths / shape.distances_m)[:, long].max(axis=1)
    share = float(np.quantile(shares, _MOST))
    if share > _NOTHING:
        return None
    # At the edge of the aperture a, a wave front from the distance R differs from a
    # plane by a^2 / (8 R). As a share of the aperture, this is a / (8 R).
    flat = max(share, 0.25 * delays.metres_per_sample / shape.aperture_m)
    return DelayScale("nothing", share, shape.aperture_m / (8.0 * flat))
