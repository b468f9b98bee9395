"""Colors that have the same meaning in every picture, and a faint grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Color of each kind of thing, from the palette of Okabe and Ito. People with any kind
#: of color vision can distinguish these colors. Light colors of the palette are
#: darkened, so that lines have a contrast of 3 to 1 on white (WCAG 2.2, 1.4.11).
#: Brown replaces orange, because people who cannot see green would confuse a darker
#: orange with vermilion. "sound" is light, because other things are drawn over it.
COLORS = {
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
#: Colors of several robots, in order.
ROBOT_COLORS = (
    "#0072B2",
    "#009E73",
    "#AA4499",
    "#3A9AD0",
    "#B07D00",
    "#332288",
    "#882255",
    "#444444",
)

#: Colors of curves that belong to none of the things in ``COLORS``, for example the
#: curves of several laws, in order. The first color is gray, for driving without
#: avoidance.
SERIES_COLORS = (
    COLORS["empty"],
    "#D55E00",
    "#0072B2",
    "#7A5200",
    "#A8498A",
    "#009E73",
    "#3A9AD0",
    "#882255",
    "#000000",
)


def luminance(color: Any) -> float:
    """Computes the relative luminance of a color: 0 for black, 1 for white (WCAG 2.2).

    If the luminance is below 0.18, white text has more contrast than black text. The
    transparency of the color is ignored.
    """
    from matplotlib.colors import to_rgb

    linear = [
        level / 12.92 if level <= 0.04045 else ((level + 0.055) / 1.055) ** 2.4
        for level in to_rgb(color)
    ]
    return sum(
        k * level for k, level in zip((0.2126, 0.7152, 0.0722), linear, strict=True)
    )


def contrast(first: Any, second: Any) -> float:
    """Computes the contrast ratio of two colors, from 1 to 21, as defined by WCAG 2.2.

    The ratio is (L1 + 0.05) / (L2 + 0.05), where L1 and L2 are the luminances of the
    lighter and the darker color. The number 0.05 represents stray light.
    """
    less, more = sorted((luminance(first), luminance(second)))
    return (more + 0.05) / (less + 0.05)


def text_color(color: Any) -> str:
    """Darkens a color, if needed, until its contrast on white is 4.5 to 1."""
    from matplotlib.colors import to_hex, to_rgb

    red, green, blue = to_rgb(color)
    share = 1.0
    while True:
        darker = to_hex((share * red, share * green, share * blue))
        if contrast(darker, "white") >= 4.5:
            return darker
        share -= 0.01


def faintest(color: Any) -> float:
    """Computes the least opacity at which a mark has a contrast of 3 to 1 on white.

    The opacity is 1 if even the opaque color is too light.
    """
    from matplotlib.colors import to_rgb

    rgb = to_rgb(color)
    for percent in range(1, 100):
        thin = [1.0 - percent / 100.0 * (1.0 - level) for level in rgb]
        if contrast(thin, "white") >= 3.05:
            return percent / 100.0
    return 1.0


def draw_grid(axes: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """Draws a faint grid behind all other parts of a picture."""
    axes.grid(axis=axis, color="#E5E5E5", linewidth=0.6)
    axes.set_axisbelow(True)
