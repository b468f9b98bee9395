"""Areas and extents of flat meshes, against those of the figures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.views.meshes import arrow, circle, prism, rectangles, ribbon, star


def area(mesh):
    """Sum of the areas of the triangles, by the cross product of two edges."""
    a, b, c = (mesh.vertices.T[corner] for corner in mesh.faces)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_a_straight_band_has_its_length_times_its_width():
    mesh = ribbon([[0.0, 0.0], [1.5, 2.0]], 0.3, 0.1)
    assert area(mesh) == pytest.approx(2.5 * 0.1)
    assert (mesh.vertices[2] == 0.3).all()


def test_a_circle_is_a_ring_of_its_radius():
    mesh = circle(0.5, 0.0, 0.02)
    away = np.hypot(*mesh.vertices[:2])
    assert (away.min(), away.max()) == pytest.approx((0.49, 0.51), abs=1e-3)
    assert area(mesh) == pytest.approx(math.pi * (0.51**2 - 0.49**2), rel=2e-2)


def test_rectangles_are_covered_once():
    edges = np.array([[0.0, 2.0, 1.0, 1.5], [5.0, 5.5, 0.0, 4.0]])
    assert area(rectangles(edges, 0.1)) == pytest.approx(1.0 + 2.0)


def test_an_arrow_ends_one_meter_ahead_and_a_star_has_five_tips():
    tip = arrow().vertices[:, arrow().vertices[0].argmax()]
    assert tip == pytest.approx([1.0, 0.0, 0.0])
    middle = star(0.2, 0.0, 1e-6).vertices[:2, :10]
    assert (np.hypot(*middle) > 0.19).sum() == 5


def test_a_prism_has_the_area_of_its_outline_on_top():
    """Stars with dents, in both orders: the top by the shoelace formula."""
    rng = np.random.default_rng(4)
    for turn in (1, -1):
        angle = np.linspace(0.0, 2.0 * math.pi, 17)[:-1]
        far = rng.uniform(0.3, 2.0, 16)
        outline = np.column_stack([far * np.cos(angle), far * np.sin(angle)])[::turn]
        x, y = outline.T
        top = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        around = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T).sum()
        mesh = prism(outline, 0.35)
        assert area(mesh) == pytest.approx(top + 0.35 * around)
        # All triangles of the top face up.
        a, b, c = (mesh.vertices.T[corner] for corner in mesh.faces)
        up = np.cross(b - a, c - a)[:, 2]
        assert up.sum() / 2.0 == pytest.approx(top)
