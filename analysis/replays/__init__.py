"""What a replay has beside its scene: legend, switches, clock, curves over time."""

from analysis.replays.arrows import Arrow, arrows, record_arrows, scale_m_n
from analysis.replays.replay_page import Layer, ReplayFacts, replay_page
from analysis.replays.time_charts import Chart, time_chart

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
