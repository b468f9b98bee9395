"""Localization results that the papers report."""

from __future__ import annotations

from typing import NamedTuple


class PaperCell(NamedTuple):
    """Result for one source position in tables 1 and 2 of Han 2019.

    Han measured on hardware, with 100 measurements per position.
    """

    range_m: float
    """True range from microphone M2, m."""
    bearing_deg: float
    """True bearing from microphone M2, deg."""
    bearing_mean_deg: float
    range_mean_m: float
    bearing_std_deg: float
    range_std_m: float


PAPER_CELLS = (
    PaperCell(1.0, 0.0, 0.4, 1.04, 0.08, 0.02),
    PaperCell(1.0, 30.0, 29.9, 0.99, 0.20, 0.03),
    PaperCell(1.0, 60.0, 60.0, 0.99, 0.20, 0.07),
    PaperCell(2.0, 0.0, 0.4, 1.98, 0.05, 0.05),
    PaperCell(2.0, 30.0, 30.0, 1.90, 0.34, 0.08),
    PaperCell(2.0, 60.0, 61.3, 1.98, 0.54, 0.13),
    PaperCell(3.0, 0.0, 0.4, 3.07, 0.15, 0.09),
    PaperCell(3.0, 30.0, 30.1, 2.86, 0.35, 0.12),
    PaperCell(3.0, 60.0, 61.6, 2.89, 0.66, 0.37),
    PaperCell(4.0, 0.0, 0.4, 3.93, 1.12, 0.48),
    PaperCell(4.0, 30.0, 30.4, 3.72, 2.27, 0.20),
    PaperCell(4.0, 60.0, 59.7, 3.82, 2.40, 0.43),
)
