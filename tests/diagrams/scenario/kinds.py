"""The shortest scenario with a robot of each kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

KINDS: dict[str, Mapping[str, Any]] = {
    "follower": {},
    "router": {"law": "trajectory_adaptive", "route": {}},
    "odor_searcher": {
        "law": "plume_search",
        "odor": {},
        "robot": {"preset": "song2011_olfactory"},
    },
    "sound_searcher": {
        "law": "sound_search",
        "robot": {"preset": "song2011_hearing"},
        "sound_search": {"await_call": False},
    },
}
