"""Several talkers at once: simulated recordings, and what is found in them."""

from analysis.talkers.moving_talkers import moving_sound, ring_scene
from analysis.talkers.synthetic_speech import speech_like
from analysis.talkers.talker_trials import (
    TALKER_ARRAYS,
    TalkerScene,
    TalkerScore,
    draw_talkers,
    heard_from,
    impulse_responses,
    record_talkers,
    score_bearings,
    talker_sounds,
    with_noise,
)

__all__ = [
    "TALKER_ARRAYS",
    "TalkerScene",
    "TalkerScore",
    "draw_talkers",
    "heard_from",
    "impulse_responses",
    "moving_sound",
    "record_talkers",
    "ring_scene",
    "score_bearings",
    "speech_like",
    "talker_sounds",
    "with_noise",
]
