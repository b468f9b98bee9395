"""The colours of things, and the grid behind them: the same in every picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["COLOURS", "ROBOT_COLOURS", "SERIES_COLOURS", "draw_grid", "luminance"]

#: Okabe and Ito's palette: told apart with any colour vision.
COLOURS = {
    "robot": "#0072B2",
    "source": "#D55E00",
    "estimate": "#CC79A7",
    "obstacle": "#4D4D4D",
    "echo": "#E69F00",
    "empty": "#999999",
    "attraction": "#D55E00",
    "repulsion": "#4D4D4D",
    "sound": "#F0E442",
    "left": "#56B4E9",
    "right": "#E69F00",
    "seen": "#009E73",
    "echoes": "#9A6A00",
    "tracked": "#882255",
    "interferer": "#7B3F00",
    "hit": "#C1121F",
    "law": "#009E73",
    "wall": "#8A8478",
    "odor": "#772266",
}
#: Of several robots, in turn.
ROBOT_COLOURS = (
    "#0072B2",
    "#009E73",
    "#AA4499",
    "#56B4E9",
    "#B07D00",
    "#332288",
    "#882255",
    "#444444",
)

#: For curves that are no such thing, as of laws: in order, after the grey of none.
SERIES_COLOURS = (
    COLOURS["empty"],
    "#D55E00",
    "#0072B2",
    "#E69F00",
    "#CC79A7",
    "#009E73",
    "#56B4E9",
    "#F0E442",
    "#000000",
)


def luminance(colour: Any) -> float:
    """How light a colour is, 0 to 1, after WCAG 2.2.

    Below 0.18 white letters stand out more than black ones.

    Args:
        colour: As matplotlib takes it; how transparent it is does not count.
    """
    from matplotlib.colors import to_rgb

    linear = [
        level / 12.92 if level <= 0.04045 else ((level + 0.055) / 1.055) ** 2.4
        for level in to_rgb(colour)
    ]
    return sum(
        k * level for k, level in zip((0.2126, 0.7152, 0.0722), linear, strict=True)
    )


def draw_grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """A faint grid behind all else.

    Args:
        axes: Where to draw.
        axis: Whose ticks have lines.
    """
    axes.grid(axis=axis, color="#E5E5E5", linewidth=0.6)
    axes.set_axisbelow(True)
