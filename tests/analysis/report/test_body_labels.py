"""Times beside bodies can be read: measured as they are drawn, not as they were put."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from analysis.report.body_labels import BodyLabel, spread_labels
from analysis.views.picture import plot_trajectory
from diagrams import load_scenario, simulate
from systems.world.geometry import rectangle_corners


def drawn(figure: Figure) -> list[tuple[BodyLabel, np.ndarray]]:
    """Labels that are seen, and the extents of their letters, px."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    axes = figure.axes[0]
    seen = [text for text in axes.texts if isinstance(text, BodyLabel)]
    boxes = [
        (text, np.array(text.get_window_extent(renderer).extents)) for text in seen
    ]
    edges = np.array(axes.get_window_extent(renderer).extents)
    low, high = edges[:2] - 1.0, edges[2:] + 1.0
    return [
        (text, box)
        for text, box in boxes
        if (low < axes.transData.transform(text.xy)).all()
        and (axes.transData.transform(text.xy) < high).all()
    ]


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    size = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
    return float(np.prod(np.maximum(size, 0.0)))


def assert_readable(figure: Figure) -> None:
    labels = drawn(figure)
    covered = [
        (a.get_text(), b.get_text())
        for (a, box_a), (b, box_b) in combinations(labels, 2)
        if overlap(box_a, box_b) > 0.0
    ]
    assert not covered
    edges = np.array(figure.axes[0].get_window_extent().extents)
    for text, box in labels:
        assert overlap(box, edges) == pytest.approx(np.prod(box[2:] - box[:2])), text


def crowd(*bodies: tuple[float, float, float, float, float]) -> Figure:
    figure = Figure(figsize=(5.0, 5.0))
    axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set(xlim=(-2.0, 2.0), ylim=(-2.0, 2.0), aspect="equal")
    for number, body in enumerate(bodies):
        axes.add_patch(Polygon(rectangle_corners([*body, 0.0]), fill=False))
        axes.add_artist(BodyLabel(f"{10 * number} s", body, "#0072B2"))
    return figure


def test_bodies_on_one_spot_have_words_of_their_own() -> None:
    figure = crowd(*[(0.05 * k, 0.0, 0.3 * k, 0.35, 0.82) for k in range(8)])
    with pytest.raises(AssertionError):
        assert_readable(figure)
    spread_labels(figure.axes[0])
    assert_readable(figure)


def test_words_far_off_are_tied_to_their_body() -> None:
    figure = crowd(*[(0.0, 0.0, 0.0, 0.2, 0.2)] * 30)
    axes = figure.axes[0]
    spread_labels(axes)
    assert_readable(figure)
    lines = [line for line in axes.get_lines() if line.get_gid() == "leader"]
    assert lines
    for line in lines:
        start, end = np.asarray(line.get_xydata())
        # On the edge of the circle or the box about the body, and on to the words.
        assert np.max(np.abs(start)) == pytest.approx(0.1, abs=0.05)
        pixel = axes.transData.transform(end)
        near = [
            np.abs(box.reshape(2, 2).mean(axis=0) - pixel) for _, box in drawn(figure)
        ]
        assert min(np.max(each) for each in near) < 25.0


def test_words_alone_stay_on_the_right_and_lines_do_not_cross_them() -> None:
    figure = crowd((0.0, 0.0, 0.0, 0.35, 0.82))
    axes = figure.axes[0]
    spread_labels(axes)
    ((_, box),) = drawn(figure)
    x, y = axes.transData.inverted().transform(box.reshape(2, 2).mean(axis=0))
    assert abs(x) < 0.05
    assert -0.7 < y < -0.41
    figure = crowd((0.0, 0.0, 0.0, 0.35, 0.82))
    axes = figure.axes[0]
    axes.plot([-2.0, 2.0], [-0.52, -0.52])
    spread_labels(axes)
    ((_, box),) = drawn(figure)
    line = axes.transData.transform((0.0, -0.52))[1]
    assert not box[1] < line < box[3]


def test_a_body_outside_the_picture_has_no_words_in_it() -> None:
    figure = crowd((5.0, 0.0, 0.0, 0.3, 0.3))
    spread_labels(figure.axes[0])
    assert not drawn(figure)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("convoy", ["hearing=ideal"]),
        ("odor_then_sound", []),
        ("robots_4", []),
        ("two_moving_obstacles", ["hearing=ideal", "law=guarded"]),
    ],
)
def test_times_of_robots_close_together_can_be_read(
    name: str, settings: list[str]
) -> None:
    run = simulate(load_scenario(name, settings), engine="compiled")
    assert_readable(plot_trajectory(run))
