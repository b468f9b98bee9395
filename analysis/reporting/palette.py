"""The colours of things, and the grid behind them: the same in every picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Okabe and Ito's palette, told apart with any colour vision; its light ones darker, so
#: that lines stand out from white by 3 to 1 (WCAG 2.2, 1.4.11). Their orange is brown:
#: one between would be their vermilion to who sees no green. Sound is laid below.
COLOURS = {
    "robot": "#0072B2",
    "source": "#D55E00",
    "estimate": "#A8498A",
    "obstacle": "#4D4D4D",
    "echo": "#7A5200",
    "empty": "#858585",
    "attraction": "#D55E00",
    "repulsion": "#4D4D4D",
    "sound": "#F0E442",
    "sounding": "#8A7A00",
    "left": "#3A9AD0",
    "right": "#7A5200",
    "seen": "#009E73",
    "echoes": "#9A6A00",
    "tracked": "#882255",
    "interferer": "#7B3F00",
    "hit": "#C1121F",
    "law": "#00835F",
    "wall": "#8A8478",
    "odor": "#772266",
    "passed": "#6B6B6B",
    "lessened": "#A86B00",
}
#: Of several robots, in turn.
ROBOT_COLOURS = (
    "#0072B2",
    "#009E73",
    "#AA4499",
    "#3A9AD0",
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
    "#7A5200",
    "#A8498A",
    "#009E73",
    "#3A9AD0",
    "#882255",
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


def contrast(first: Any, second: Any) -> float:
    """How much two colours stand out from each other, 1 to 21, after WCAG 2.2.

    Args:
        first: As matplotlib takes it.
        second: The same.

    Returns:
        The ratio of their luminances, each with 0.05 of stray light.
    """
    less, more = sorted((luminance(first), luminance(second)))
    return (more + 0.05) / (less + 0.05)


def text_colour(colour: Any) -> str:
    """A colour as dark as words on white need it, 4.5 to 1.

    Args:
        colour: As matplotlib takes it.

    Returns:
        The same one if it is dark enough.
    """
    from matplotlib.colors import to_hex, to_rgb

    red, green, blue = to_rgb(colour)
    share = 1.0
    while True:
        darker = to_hex((share * red, share * green, share * blue))
        if contrast(darker, "white") >= 4.5:
            return darker
        share -= 0.01


def faintest(colour: Any) -> float:
    """How opaque a mark on white must be at least, to stand out by 3 to 1.

    Args:
        colour: As matplotlib takes it.

    Returns:
        0 to 1; 1 for a colour that does not itself.
    """
    from matplotlib.colors import to_rgb

    rgb = to_rgb(colour)
    for percent in range(1, 100):
        thin = [1.0 - percent / 100.0 * (1.0 - level) for level in rgb]
        if contrast(thin, "white") >= 3.05:
            return percent / 100.0
    return 1.0


def draw_grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """A faint grid behind all else.

    Args:
        axes: Where to draw.
        axis: Whose ticks have lines.
    """
    axes.grid(axis=axis, color="#E5E5E5", linewidth=0.6)
    axes.set_axisbelow(True)
