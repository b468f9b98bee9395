"""Several talkers at once: simulated recordings, and what is found in them."""

from analysis.talkers.synthetic_speech import speech_like
from analysis.talkers.talker_trials import (
    TALKER_ARRAYS,
    TalkerScene,
    TalkerScore,
    draw_talkers,
    record_talkers,
    score_bearings,
)

__all__ = [
    "TALKER_ARRAYS",
    "TalkerScene",
    "TalkerScore",
    "draw_talkers",
    "record_talkers",
    "score_bearings",
    "speech_like",
]
