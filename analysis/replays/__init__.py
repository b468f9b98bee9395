"""What a replay has beside its scene: legend, switches, clock, curves over time."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.replays.arrows import Arrow, arrows, record_arrows, scale_m_n
    from analysis.replays.replay_page import Layer, ReplayFacts, replay_page
    from analysis.replays.time_charts import Chart, time_chart
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "Arrow",
    "Chart",
    "Layer",
    "ReplayFacts",
    "arrows",
    "record_arrows",
    "replay_page",
    "scale_m_n",
    "time_chart",
]
