"""Whether delays are of an array's size, or of one many times larger or smaller.

Sound cannot take longer from microphone to microphone than straight along. It can
take much less in all pairs, but only from straight ahead of a row or above a plane;
and, for its wave fronts to be so flat, from far away.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from analysis.recordings.channel_order import FrameDelays

#: Where delays do not fit an array they are looked for within these lengths, m.
REACHES_M = (0.3, 3.0)

# Frames that agree on delays, at least; and their share.
_LEAST_FRAMES, _LEAST_SHARE = 5, 0.2

# Delays over the longest possible ones: above the first number for a half of the
# frames they are impossible; below the second for three quarters they are of sound from
# straight above. Positions in inches make 0.025 of them, in cm 0.01.
_IMPOSSIBLE, _NOTHING = 1.5, 0.03
_MOST = 0.75

# Pairs nearer than this share of the aperture have delays too short to compare.
_LONG = 0.3

# What a delay may be off, samples.
_SAMPLES = 1.0


class DelayScale(NamedTuple):
    """Delays over the longest ones that the array allows."""

    kind: Literal["beyond", "nothing"]
    share: float
    """Median of the frames if beyond, else what three quarters stay below."""
    least_range_m: float
    """Where the source at least is, if the array is as large as it says, m."""


def delay_scale(delays: FrameDelays) -> DelayScale | None:
    """What is wrong with the size of delays, if anything.

    Returns:
        Delays over the longest ones possible, or None where they are of the array's
        size or too few agree.
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
    # A wave front from R is off the plane by a share a / 8 R of the aperture a.
    flat = max(share, 0.25 * delays.metres_per_sample / shape.aperture_m)
    return DelayScale("nothing", share, shape.aperture_m / (8.0 * flat))
