"""Several talkers at once: simulated recordings, and what is found in them."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
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
else:
    __getattr__, __dir__ = lazy_exports(__name__)

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
