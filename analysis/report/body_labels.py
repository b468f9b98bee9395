"""Labels of bodies in a picture, placed where they can be read."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.textpath import TextPath
from numpy.typing import ArrayLike, NDArray

from analysis.report.palette import text_color

_POINTS_PER_INCH = 72.0
#: _GAPS_PT: possible gaps between a body and its label, pt.
#: _LEAD_FROM_PT: least gap at which a line connects the label with the body, pt.
_GAPS_PT, _LEAD_FROM_PT = (2.0, 8.0, 15.0, 24.0, 34.0, 46.0), 8.0
#: Number of possible directions from a body to its label. The preferred direction is
#: to the right, as seen along the body's x axis.
_DIRECTIONS = 16
#: Margin around a label, pt.
_MARGIN_PT = 1.0
#: Costs of a label's position. The position with the least cost is used.
#: _WORDS: for each other label or large mark that the label covers.
#: _INK: for each point of a line that the label covers.
#: _FAR: for each pt of the gap.
#: _ROUND: for each step away from the preferred direction.
#: _IN_ANOTHER: if the label is inside another body, and would seem to name that body.
_WORDS, _INK, _FAR, _ROUND, _IN_ANOTHER = 1e4, 1.0, 0.35, 0.6, 8.0
_Box = tuple[float, float, float, float]


class BodyLabel(Annotation):
    """Text label of a rectangular body; ``spread_labels`` finds its final position."""

    def __init__(self, text: str, rectangle: ArrayLike, color: str) -> None:
        """Places the label at the right side of the body.

        The argument ``rectangle`` is the outline of the body: (x, y, theta, length,
        width) in the world frame W, m and rad. The text gets the color of the body,
        darkened if needed.
        """
        x, y, theta, length, width = map(float, np.asarray(rectangle))
        unit = math.sin(theta), -math.cos(theta)
        self.rectangle = x, y, theta, length, width
        super().__init__(
            text,
            (x + 0.5 * width * unit[0], y + 0.5 * width * unit[1]),
            xytext=(9.0 * unit[0], 7.0 * unit[1]),
            textcoords="offset points",
            color=text_color(color),
            fontsize=8,
            ha="center",
            va="center",
            annotation_clip=True,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
            zorder=7,
        )

    def size_pt(self) -> tuple[float, float]:
        """Width and height of the label with its margin, in points."""
        size = float(self.get_fontsize())
        box = TextPath((0.0, 0.0), self.get_text(), size=size).get_extents()
        return float(box.width) + 2.0 * _MARGIN_PT, size + 2.0 * _MARGIN_PT


def spread_labels(axes: Axes) -> None:
    """Moves all labels to places where they cover as little of the picture as possible.

    The drawing must be complete, and the limits of the axes final. A label covers
    another label only if there is no other place. If a label is 8 points or more away
    from its body, a thin line connects them.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    scale = _POINTS_PER_INCH / figure.dpi
    labels = [text for text in axes.texts if isinstance(text, BodyLabel)]
    edges = np.asarray(axes.bbox.extents) * scale
    ink = _ink(axes, scale)
    taken: list[_Box] = _marks(axes, scale)
    for label in labels:
        x, y, theta, length, width = label.rectangle
        middle = axes.transData.transform((x, y)) * scale
        along = axes.transData.transform((x + 1.0, y))[0] * scale - middle[0]
        if not _inside((*middle, *middle), edges):
            continue
        half = np.array(label.size_pt()) / 2.0
        best: tuple[float, Any] = (math.inf, None)
        for turn in range(_DIRECTIONS):
            # The order is: right, then one step to each side, and so on to the left.
            step = (turn + 1) // 2 * (1 if turn % 2 else -1)
            angle = theta - math.pi / 2.0 + 2.0 * math.pi * step / _DIRECTIONS
            unit = np.array([math.cos(angle), math.sin(angle)])
            sides = length * abs(math.cos(angle - theta))
            sides += width * abs(math.sin(angle - theta))
            body = 0.5 * along * sides
            reach = body + float(half @ np.abs(unit))
            for gap in _GAPS_PT:
                place = middle + (reach + gap) * unit
                box = (*(place - half), *(place + half))
                if not _inside(box, edges):
                    continue
                cost = _FAR * gap + _ROUND * abs(step) + _INK * _within(ink, box)
                cost += _WORDS * sum(_overlap(box, other) > 0.0 for other in taken)
                at = axes.transData.inverted().transform(place / scale)
                cost += _IN_ANOTHER * any(
                    other is not label and _contains(other.rectangle, at)
                    for other in labels
                )
                if cost < best[0]:
                    best = cost, (place, box, gap, body, unit)
        if best[1] is None:
            continue
        place, box, gap, body, unit = best[1]
        taken.append(box)
        label.xy = x, y
        label.set_position(tuple(place - middle))
        if gap >= _LEAD_FROM_PT:
            ends = np.array([middle + body * unit, place - _to_edge(half, unit)])
            where = axes.transData.inverted().transform(ends / scale)
            color = label.get_color()
            line = Line2D(*where.T, color=color, lw=0.6, zorder=6.9, gid="leader")
            axes.add_line(line)


def _to_edge(half: NDArray[np.float64], unit: NDArray[np.float64]) -> Any:
    """Vector from the center of a label to its edge, along a unit vector."""
    return unit * np.min(half / np.maximum(np.abs(unit), 1e-9))


def _inside(box: ArrayLike, edges: NDArray[np.float64]) -> bool:
    low_x, low_y, high_x, high_y = np.asarray(box)
    return bool(
        low_x >= edges[0]
        and low_y >= edges[1]
        and high_x <= edges[2]
        and high_y <= edges[3]
    )


def _contains(rectangle: tuple[float, ...], point: NDArray[np.float64]) -> bool:
    x, y, theta, length, width = rectangle
    dx, dy = float(point[0]) - x, float(point[1]) - y
    ahead = dx * math.cos(theta) + dy * math.sin(theta)
    aside = dy * math.cos(theta) - dx * math.sin(theta)
    return abs(ahead) < 0.5 * length and abs(aside) < 0.5 * width


def _overlap(a: _Box, b: _Box) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(height, 0.0)


def _within(points: NDArray[np.float64], box: _Box) -> int:
    """Number of points that a label covers."""
    x, y = points.T
    inside = (x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])
    return int(np.count_nonzero(inside))


def _ink(axes: Axes, scale: float) -> NDArray[np.float64]:
    """(n, 2) points every 1 pt along the lines and the edges of bodies, pt."""
    found = [np.zeros((0, 2))]
    for line in axes.get_lines():
        data = line.get_transform().contains_branch_seperately(axes.transData)
        xy = np.asarray(line.get_xydata())
        if all(data) and len(xy):
            drawn = line.get_linestyle() != "None"
            found.append(_dots(axes.transData.transform(xy) * scale, drawn=drawn))
    for patch in axes.patches:
        if isinstance(patch, Polygon):
            corners = axes.transData.transform(patch.get_xy()) * scale
            found.append(_dots(corners, drawn=True))
    return np.concatenate(found)


def _dots(points: NDArray[np.float64], *, drawn: bool) -> NDArray[np.float64]:
    """Points every 1 pt along a line through points. If not ``drawn``, these points."""
    points = points[np.isfinite(points).all(axis=1)]
    if not drawn or len(points) < 2:
        return points
    way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    at = np.arange(0.0, way[-1] + 1.0)
    return np.column_stack([np.interp(at, way, points[:, k]) for k in (0, 1)])


def _marks(axes: Axes, scale: float) -> list[_Box]:
    """Boxes of large marks, for example of a collision, which labels must not cover."""
    found = []
    for line in axes.get_lines():
        size = float(line.get_markersize())
        if line.get_linestyle() == "None" and size > 8.0:
            points = axes.transData.transform(np.asarray(line.get_xydata())) * scale
            for x, y in points:
                half = 0.5 * size
                found.append((x - half, y - half, x + half, y + half))
    return found
