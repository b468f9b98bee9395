"""Delays between channels: spectra, correlations, peaks, fits, their errors."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.delays.delays import METHODS, DelayEstimate, estimate_delays
    from systems.delays.frame_energy import frame_energy
    from systems.delays.occupied_band import occupied_band
    from systems.delays.pair_correlations import PairCorrelations, correlate_pairs
    from systems.delays.precedence import EchoMemory, keep_first_wave_front
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "METHODS",
    "DelayEstimate",
    "EchoMemory",
    "PairCorrelations",
    "correlate_pairs",
    "estimate_delays",
    "frame_energy",
    "keep_first_wave_front",
    "occupied_band",
]
