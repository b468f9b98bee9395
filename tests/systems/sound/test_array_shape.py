"""What an array of microphones spans, and how its side is chosen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.sound.array_shape import ArrayShape

ROW = [[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]]
SQUARE = [[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]]
TETRAHEDRON = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]


def in_space(places):
    return [[*place, 0.3] for place in places]


@pytest.mark.parametrize(
    ("places", "kind", "ambiguity", "angles", "freedom"),
    [
        (ROW, "row", "front_back", ("bearing",), 0),
        (in_space(ROW), "row", "front_back", ("bearing",), 0),
        (
            [[0, 0, 0.1], [0, 0, 0.2], [0, 0, 0.4]],
            "row",
            "front_back",
            ("elevation",),
            0,
        ),
        ([[0, 0, 0], [1, 0, 1], [2, 0, 2]], "row", "front_back", (), 0),
        (SQUARE, "plane", "none", ("bearing",), 1),
        (in_space(SQUARE), "plane", "mirror", ("bearing", "elevation"), 0),
        (in_space(SQUARE[:3]), "plane", "mirror", ("bearing", "elevation"), -1),
        (TETRAHEDRON, "space", "none", ("bearing", "elevation"), 0),
    ],
)
def test_kinds(places, kind, ambiguity, angles, freedom):
    shape = ArrayShape.of(places)
    assert (shape.kind, shape.ambiguity, shape.angles) == (kind, ambiguity, angles)
    assert shape.freedom == freedom
    assert shape.p_AM.mean(axis=0) == pytest.approx(np.zeros(shape.dimension))
    assert shape.p_AM[1] - shape.p_AM[0] == pytest.approx(np.subtract(*places[1::-1]))


@given(st.floats(-math.pi, math.pi), st.permutations(range(4)))
def test_ahead_of_a_row_is_toward_x_whatever_the_order(angle, order):
    u = np.array([math.cos(angle), math.sin(angle)])
    shape = ArrayShape.of(np.outer([-1.0, 0.2, 0.5, 1.0], u)[list(order)])
    assert shape.ahead is not None
    ahead, left = shape.ahead, shape.span[0]
    assert ahead @ u == pytest.approx(0.0, abs=1e-9)
    assert ahead[0] > 0.0 or ahead == pytest.approx([0.0, 1.0], abs=1e-6)
    assert left == pytest.approx([-ahead[1], ahead[0]], abs=1e-9)


def test_row_along_x_looks_toward_y():
    shape = ArrayShape.of([[0.0, 0.0], [0.1, 0.0], [0.3, 0.0]])
    assert shape.ahead == pytest.approx([0.0, 1.0])


@given(st.floats(-1.5, 1.5), st.floats(0.0, 6.0))
def test_a_plane_looks_up_and_an_upright_one_forward(tilt, turn):
    """A square turned about y by the tilt, then about z."""
    c, s = math.cos(tilt), math.sin(tilt)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    about_z = np.array(
        [
            [math.cos(turn), -math.sin(turn), 0],
            [math.sin(turn), math.cos(turn), 0],
            [0, 0, 1],
        ]
    )
    shape = ArrayShape.of(np.array(in_space(SQUARE)) @ (about_z @ about_y).T)
    normal = about_z @ about_y @ np.array([0.0, 0.0, 1.0])
    assert shape.ahead == pytest.approx(normal, abs=1e-9)
    upright = ArrayShape.of([[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]])
    assert upright.ahead == pytest.approx([1.0, 0.0, 0.0])


def test_flat_to_one_per_cent_is_flat():
    bent = np.array([[0.0, 0.4], [0.02, 0.0], [0.0, -0.4]])
    assert ArrayShape.of(bent).kind == "plane"
    assert ArrayShape.of(bent * [0.5, 1.0]).kind == "row"
    assert ArrayShape.of(bent, flat_m=0.015).kind == "row"


def test_three_in_a_row_are_known_in_any_order():
    places = [[0.5, 0.0], [0.1, 0.0], [0.3, 0.0]]
    row = ArrayShape.of(places).equal_row
    # Ahead is +y, left is -x: from left to right 1, 2, 0.
    assert row is not None
    assert row.spacing_m == pytest.approx(0.2)
    np.testing.assert_array_equal(row.to_delays, [[-1.0, 1.0], [-1.0, 0.0]])
    np.testing.assert_allclose(row.axes, [[0.0, -1.0], [1.0, 0.0]], atol=1e-12)
    for other in ([*places[:2], [0.31, 0.0]], SQUARE[:3], [*places, [0.7, 0.0]]):
        assert ArrayShape.of(other).equal_row is None


def test_two_microphones_are_a_row():
    shape = ArrayShape.of([[0.0, -0.1], [0.0, 0.1]])
    assert (shape.kind, shape.ambiguity, shape.angles) == (
        "row",
        "front_back",
        ("bearing",),
    )
    assert shape.ahead == pytest.approx([1.0, 0.0])
    assert shape.freedom < 0
    assert shape.facing("behind").ahead == pytest.approx([-1.0, 0.0])
    assert ArrayShape.of([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]).angles == ("elevation",)
    assert ArrayShape.of([[0.0, 0.0, 0.0], [0.1, 0.0, 0.2]]).angles == ()


def test_pairs_and_delays():
    shape = ArrayShape.of(SQUARE)
    assert shape.pairs.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    root = 0.2 * math.sqrt(2)
    assert shape.distances_m == pytest.approx([0.2, root, 0.2, 0.2, root, 0.2])
    assert shape.max_delay(340.0) == pytest.approx(root / 340.0)


@pytest.mark.parametrize(
    ("places", "words"),
    [
        (ROW[:1], "1 given; a direction takes at least 2"),
        ([[0, 0], [0.1, 0], [0.1, 0.0005]], "numbers 2 and 3 are 0.5 mm apart"),
        ([[0, 0], [0, math.nan], [1, 1]], "number 2 is not finite"),
        ([0.0, 0.1, 0.2], "give \\(x, y\\) or"),
        ([[0.0], [0.1], [0.2]], "give \\(x, y\\) or"),
    ],
)
def test_impossible_arrays_are_named(places, words):
    with pytest.raises(ValueError, match=words):
        ArrayShape.of(places)
