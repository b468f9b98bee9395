"""Cells of free space: seen as a whole, remembered, forgotten, and their edge."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import norm

from systems.ranging.parameters import UltrasonicParameters
from systems.safety.danger import view_arcs
from systems.safety.free_space import (
    NEVER,
    FreeSpace,
    cell_is_free,
    clear_disc,
    clear_outline,
    disc_is_free,
    edge_cells,
    make_free_space,
    move_window,
)
from systems.safety.outline import Outline
from systems.safety.seen_cells import end_view, see
from systems.safety.views import PlaceError, lasting, place_error, sensor_sectors
from systems.world.cones import fan_ranges

CONTROL_POINT_M = 0.175
CELL_M = 0.05
EXACT = PlaceError(0.0, 0.0, 0.41, 0.0)
BEHIND = ((0, 0), (0, 0), (0, 0), (-0.35, 0), (-0.35, 0), (-0.35, 0))


def at(axes: Any, places: Any = ((0, 0),) * 6) -> list[dict[str, Any]]:
    return [
        {"axis_deg": axis, "position_m": place}
        for axis, place in zip(axes, places, strict=False)
    ]


SETS: dict[str, dict[str, Any]] = {
    "the papers' three": {},
    "ring of 12": {"sensors": 12},
    "three more behind": {
        "sensors": at((30.0, 0.0, -30.0, -150.0, -180.0, -210.0), BEHIND),
    },
    "apart from each other": {
        "sensors": at((30.0, 0.0, -30.0), ((0, 0.3), (0.02, 0), (0, -0.3)))
    },
    "72 narrow beams": {"sensors": 72, "beam_half_angle_deg": 2.5},
    "with overlaps": {"sensors": at((25.0, 0.0, -12.0)), "beam_half_angle_deg": 17.0},
    "ring that overlaps": {"sensors": 8, "beam_half_angle_deg": 40.0},
    "with a gap": {"sensors": at((40.0, 0.0, -30.0))},
}


def sensors_of(name: str) -> UltrasonicParameters:
    return UltrasonicParameters.model_validate({"noise_m": 0.0, **SETS[name]})


def ranges_of(
    sensors: UltrasonicParameters, pose: NDArray[np.float64], boxes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Free ways as the cones measure them, m."""
    axes, places, half = sensors.beams
    ranges = fan_ranges(pose, boxes, axes, places, half, CONTROL_POINT_M)
    return np.minimum(ranges, sensors.maximum_range_m)


def exact(ways: Any) -> NDArray[np.float64]:
    """Readings without noise: how far is free, and where an echo came from, m."""
    return np.pad(np.array(ways), ((0, 0), (0, 2)))


def noisy(ranges: Any, noise_m: float) -> NDArray[np.float64]:
    """Readings of echoes with noise, whose only error this is."""
    ranges = np.asarray(ranges)
    free, noise = ranges - 5.0 * noise_m, np.full(len(ranges), noise_m)
    return np.column_stack([free, ranges, ranges, noise])


def seen_space(
    sensors: UltrasonicParameters, pose: NDArray[np.float64], boxes: NDArray[np.float64]
) -> FreeSpace:
    """What one look of all rows enters."""
    space = make_free_space(160, CELL_M, sensors.count, 17)
    free = ranges_of(sensors, pose, boxes)
    readings = exact([[way, np.inf] for way in free])
    sectors = sensor_sectors(sensors, CONTROL_POINT_M)
    for tick in range(4):
        see(space, tick, pose, sectors, readings, EXACT)
    return space


def free_cells(space: FreeSpace) -> set[tuple[int, int]]:
    n = space.free_until.shape[0]
    first = tuple(space.first)
    i, j = (range(int(f), int(f) + n) for f in first)
    return {(a, b) for a in i for b in j if cell_is_free(space, a, b, 0.0)}


def is_seen(
    sensors: UltrasonicParameters,
    pose: NDArray[np.float64],
    boxes: NDArray[np.float64],
    points: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """(m, sensors) whose reading an obstacle at each of (m, 2) points would shorten."""
    before = ranges_of(sensors, pose, boxes)
    seen = np.zeros((len(points), sensors.count), dtype=bool)
    for k, (x, y) in enumerate(points):
        box = np.vstack([boxes, [x, y, 0.0, 1e-7, 1e-7, 0.0]])
        seen[k] = ranges_of(sensors, pose, box) < before + 1e-6
        seen[k] &= ranges_of(sensors, pose, box[-1:]) < before + 1e-6
        seen[k] &= ranges_of(sensors, pose, box[-1:]) < sensors.maximum_range_m
    return seen


def scene(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A pose and boxes around it."""
    draw = np.random.default_rng(seed)
    pose = draw.uniform([-0.3, -0.3, -math.pi], [0.3, 0.3, math.pi])
    angle, distance = draw.uniform(-math.pi, math.pi, 8), draw.uniform(0.9, 3.0, 8)
    boxes = np.column_stack(
        [
            pose[0] + distance * np.cos(angle),
            pose[1] + distance * np.sin(angle),
            draw.uniform(0, math.pi, 8),
            draw.uniform(0.02, 0.6, 8),
            draw.uniform(0.02, 0.3, 8),
            np.zeros(8),
        ]
    )
    return pose, boxes


@pytest.mark.parametrize("name", SETS)
def test_a_free_cell_was_seen_as_a_whole(name):
    """An obstacle anywhere in it would have shortened a reading."""
    sensors, share = sensors_of(name), np.array([0.0, 0.5, 1.0])
    grid = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
    for seed in range(2):
        pose, boxes = scene(seed)
        cells = np.array(sorted(free_cells(seen_space(sensors, pose, boxes))))
        assert len(cells) > 100
        draw = np.random.default_rng(seed)
        for cell in draw.choice(cells, size=min(len(cells), 300), replace=False):
            points = (cell + grid) * CELL_M
            assert is_seen(sensors, pose, boxes, points).any(axis=1).all(), cell


@pytest.mark.parametrize("name", SETS)
def test_a_cell_whose_whole_round_is_seen_from_one_place_is_free(name):
    """Else nothing would ever count as free."""
    sensors = sensors_of(name)
    pose, boxes = scene(5)
    space = seen_space(sensors, pose, boxes)
    half = CELL_M * math.sqrt(0.5)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    draw, whole = np.random.default_rng(1), 0
    for i, j in draw.integers(-60, 60, size=(400, 2)):
        middle = (np.array([i, j]) + 0.5) * CELL_M
        for place in set(sensors.places):
            ahead, aside = CONTROL_POINT_M + place[0], place[1]
            offset = c * ahead - s * aside, s * ahead + c * aside
            sensor = np.add(pose[:2], offset)
            distance = math.dist(middle, sensor)
            if distance < 2.0 * half + 1e-6 or distance > 3.1:
                continue
            hides = math.asin(half / distance) * (1.0 + 1e-6)
            toward = middle - sensor
            bearing = np.linspace(-hides, hides, 15) + math.atan2(*toward[::-1])
            round_ = sensor + (distance + half + 1e-5) * np.column_stack(
                [np.cos(bearing), np.sin(bearing)]
            )
            there = np.array([p == place for p in sensors.places])
            seen = is_seen(sensors, pose, boxes, round_)[:, there]
            # Seen at that distance in all directions, by sensors at one place.
            if seen.any(axis=1).all():
                whole += 1
                assert cell_is_free(space, i, j, 0.0), (i, j)
    assert whole > 5


def ring_of(count: int, half_angle_deg: float) -> set[tuple[int, int]]:
    sensors = UltrasonicParameters.model_validate(
        {"sensors": count, "beam_half_angle_deg": half_angle_deg}
    )
    return free_cells(
        seen_space(sensors, np.array([0.013, 0.02, 0.3]), np.empty((0, 6)))
    )


@pytest.mark.parametrize("count", [12, 72])
def test_beams_with_common_edges_see_what_one_disc_holds(count):
    """A ring without gaps sees all cells within its range, but for those at itself."""
    x = 0.013 + CONTROL_POINT_M * math.cos(0.3)
    y = 0.02 + CONTROL_POINT_M * math.sin(0.3)
    half = CELL_M * math.sqrt(0.5)
    expected = {
        (i, j)
        for i in range(-70, 70)
        for j in range(-70, 70)
        if 2.0 * half
        <= math.hypot((i + 0.5) * CELL_M - x, (j + 0.5) * CELL_M - y)
        <= 3.0 - half
    }
    assert ring_of(count, 180.0 / count) == expected


def test_beams_with_gaps_see_no_cell_that_lies_in_one():
    """Half a degree between beams is wider than nothing: far cells lie over gaps."""
    cells = ring_of(72, 2.25)
    assert cells  # near ones and far ones fit into 4.5 deg
    x = 0.013 + CONTROL_POINT_M * math.cos(0.3)
    y = 0.02 + CONTROL_POINT_M * math.sin(0.3)
    half = CELL_M * math.sqrt(0.5)
    for i, j in cells:
        dx, dy = (i + 0.5) * CELL_M - x, (j + 0.5) * CELL_M - y
        off = (math.degrees(math.atan2(dy, dx) - 0.3) + 2.5) % 5.0 - 2.5
        hides = math.degrees(math.asin(half / math.hypot(dx, dy)))
        assert abs(off) + hides <= 2.25 + 1e-9


def test_every_fourth_row_at_a_tick():
    sensors = sensors_of("the papers' three")
    sectors = sensor_sectors(sensors, CONTROL_POINT_M)
    readings = exact([[2.0, np.inf]] * 3)
    pose = np.zeros(3)
    whole = make_free_space(160, CELL_M, 3, 17)
    for tick in range(4):
        space = make_free_space(160, CELL_M, 3, 17)
        see(space, tick, pose, sectors, readings, EXACT)
        cells = free_cells(space)
        assert {(i - tick) % 4 for i, _ in cells} == {0}
        see(whole, tick, pose, sectors, readings, EXACT)
        assert free_cells(whole) >= cells


def test_an_echo_is_counted_where_it_came_from_until_the_cell_is_seen_free():
    sensors = sensors_of("the papers' three")
    sectors = sensor_sectors(sensors, CONTROL_POINT_M)
    space = make_free_space(160, CELL_M, 3, 17)
    pose = np.zeros(3)
    readings = exact([[0.0, np.inf], [1.18, 1.2], [0.0, np.inf]])
    for tick in range(8):
        see(space, tick, pose, sectors, readings, EXACT)
    i = math.floor((CONTROL_POINT_M + 1.2) / CELL_M)
    assert 0.9 < space.hits[i, 0] <= 2.0
    assert not cell_is_free(space, i, 0, 0.0)
    readings[1, :2] = 2.0, np.inf
    for tick in range(4):
        see(space, tick, pose, sectors, readings, EXACT)
    assert space.hits[i, 0] == 0.0
    assert cell_is_free(space, i, 0, 1e9)


@pytest.mark.parametrize("count", [12, 72])
def test_echoes_are_counted_in_all_cells_at_their_distances(count):
    space = make_free_space(160, CELL_M, count, 17)
    draw = np.random.default_rng(count)
    pose, echoes = draw.uniform(-0.5, 0.5, 3), draw.uniform(0.3, 3.5, count)
    sensors = sensors_of("ring of 12" if count == 12 else "72 narrow beams")
    readings = exact(np.column_stack([echoes - 0.02, echoes]))
    for tick in range(4):
        sectors = sensor_sectors(sensors, CONTROL_POINT_M)
        see(space, tick, pose, sectors, readings, EXACT)
    middles = (np.arange(-80, 80) + 0.5) * CELL_M
    x, y = np.meshgrid(middles, middles, indexing="ij")
    (axes, places, _), turn = sensors.beams, pose[2]
    ahead, aside = np.add(places[0], (CONTROL_POINT_M, 0.0))
    x -= pose[0] + math.cos(turn) * ahead - math.sin(turn) * aside
    y -= pose[1] + math.sin(turn) * ahead + math.cos(turn) * aside
    apart = np.arctan2(y, x)[..., None] - turn - np.array(axes)
    sensor = np.argmax(np.cos(apart), axis=-1)  # whose axis is nearest to the cell
    distance, half = np.hypot(x, y), CELL_M / math.sqrt(2.0)
    hit = (np.abs(distance - echoes[sensor]) <= half) & (distance >= 2.0 * half)
    assert hit.sum() > 200
    expected = np.where(hit, np.minimum(1.0, 0.6 / distance), 0.0)
    np.testing.assert_allclose(np.roll(space.hits, (80, 80), (0, 1)), expected)


@pytest.mark.parametrize(("x", "y"), [(3.2, 0.0), (-2.4, 5.0), (0.3, -9.0), (40, 40)])
def test_the_window_forgets_what_leaves_it_and_keeps_what_stays(x, y):
    space = make_free_space(64, CELL_M, 1, 2)
    draw = np.random.default_rng(3)
    space.free_until[:] = draw.choice([NEVER, 7.0], size=(64, 64))
    before = free_cells(space)
    move_window(space, x, y)
    i, j = space.first
    # A window of 64 may lag behind by an eighth of itself.
    assert abs(i + 32 - x / CELL_M) <= 9
    assert abs(j + 32 - y / CELL_M) <= 9
    window = {(a, b) for a in range(i, i + 64) for b in range(j, j + 64)}
    assert free_cells(space) == before & window
    assert not cell_is_free(space, i - 1, j, 0.0)
    assert not cell_is_free(space, i, j + 64, 0.0)


@pytest.mark.parametrize(
    ("sigmas", "looks"), [(5.01, 1), (4.99, 4), (2.0, 11), (1.0, 31), (0.5, None)]
)
def test_several_readings_are_evidence_as_one_of_five_deviations_is(sigmas, looks):
    """Of k deviations, n readings such that n (k - 1/2) exceeds ln(1/Q(5)) = 15.06."""
    assert -norm.logsf(5.0) == pytest.approx(15.06, abs=0.01)
    sensors = sensors_of("the papers' three")
    sectors, pose = sensor_sectors(sensors, CONTROL_POINT_M), np.zeros(3)
    space, noise_m = make_free_space(160, CELL_M, 3, 17), 0.005
    # A cell straight ahead, and the far side of the circle around it.
    i, half = 23, CELL_M * math.sqrt(0.5)
    far = math.hypot((i + 0.5) * CELL_M - CONTROL_POINT_M, 0.5 * CELL_M) + half
    readings, found = noisy([far + sigmas * noise_m] * 3, noise_m), None
    for look in range(40):
        if found is None and cell_is_free(space, i, 0, 0.0):
            found = look
        for turn in range(4):
            see(space, turn, pose, sectors, readings, EXACT)
    assert found == looks


def test_noise_alone_is_no_evidence():
    """10,000 readings of a surface at the far side of a cell; each may be 3e-7."""
    sensors, draw = sensors_of("the papers' three"), np.random.default_rng(0)
    sectors, pose = sensor_sectors(sensors, CONTROL_POINT_M), np.zeros(3)
    space, half = make_free_space(160, CELL_M, 3, 17), CELL_M * math.sqrt(0.5)
    far = math.hypot(23.5 * CELL_M - CONTROL_POINT_M, 0.5 * CELL_M) + half
    highest = 0.0
    for noise_m in (0.005, 0.02):
        for errors in draw.normal(0.0, noise_m, (5_000, 3)):
            for turn in range(4):
                readings = noisy(far + errors, noise_m)
                see(space, turn, pose, sectors, readings, EXACT)
            highest = max(highest, space.evidence[23, 0])
            assert not cell_is_free(space, 23, 0, 0.0)
    # By Ville's inequality, it comes to ln(1/p) once in 1/p readings at most.
    assert 1.0 < highest < 12.0


def test_the_window_stays_where_the_robot_is_near_its_middle():
    space = make_free_space(256, CELL_M, 1, 2)
    for x in (0.0, 0.95, -0.95):
        move_window(space, x, 0.0)
        assert space.first[0] == -128


def test_a_disc_clears_the_cells_that_lie_wholly_in_it():
    space = make_free_space(100, CELL_M, 1, 2)
    clear_disc(space, 0.51, -0.33, 0.7, 2.0)
    expected = {
        (i, j)
        for i in range(-50, 50)
        for j in range(-50, 50)
        if all(
            math.dist((a * CELL_M, b * CELL_M), (0.51, -0.33)) <= 0.7
            for a in (i, i + 1)
            for b in (j, j + 1)
        )
    }
    assert free_cells(space) == expected
    assert not cell_is_free(space, 10, -7, 2.5), "no longer than said"
    clear_disc(space, 0.51, -0.33, 0.7, 1.0)
    assert cell_is_free(space, 10, -7, 2.0), "what was known stays so"


def test_a_body_clears_the_cells_that_lie_wholly_in_it():
    space, pose = make_free_space(100, CELL_M, 1, 2), (0.51, -0.33, 0.4)
    clear_outline(space, pose, Outline(0.175, 0.41, 0.446), 2.0)
    c, s = math.cos(0.4), math.sin(0.4)
    expected = {
        (i, j)
        for i in range(-50, 50)
        for j in range(-50, 50)
        if all(
            abs(c * x + s * y) <= 0.175 and abs(c * y - s * x) <= 0.41
            for x in (i * CELL_M - 0.51, (i + 1) * CELL_M - 0.51)
            for y in (j * CELL_M + 0.33, (j + 1) * CELL_M + 0.33)
        )
    }
    assert free_cells(space) == expected


def test_a_disc_is_free_if_all_cells_that_it_meets_are():
    space = make_free_space(100, CELL_M, 1, 2)
    clear_disc(space, 0.0, 0.0, 1.0, 1.0)
    space.rolled_m[0] = 0.5
    assert disc_is_free(space, 0.02, -0.01, 0.9)
    space.free_until[4, 100 - 3] = NEVER  # x from 0.2 m, y up to -0.1 m
    corner = math.hypot(0.2 - 0.02, 0.1 - 0.01)
    assert disc_is_free(space, 0.02, -0.01, corner - 1e-6)
    assert not disc_is_free(space, 0.02, -0.01, corner + 1e-6)
    space.rolled_m[0] = 1.5
    assert not disc_is_free(space, 0.02, -0.01, 0.01)


def test_the_edge_holds_the_nearest_of_all_cells_that_are_not_free():
    draw = np.random.default_rng(8)
    out, checked = np.empty((4000, 2)), 0
    for _ in range(40):
        space = make_free_space(60, CELL_M, 1, 2)
        for _ in range(6):
            x, y, radius = draw.uniform([-0.6, -0.6, 0.2], 0.6)
            clear_disc(space, x, y, radius, 1.0)
        known = free_cells(space)
        corners = np.array(
            [
                (i * CELL_M, j * CELL_M)
                for i in range(-40, 40)
                for j in range(-40, 40)
                if (i, j) not in known
            ]
        )
        count = edge_cells(space, 0.0, 0.0, 1.5, 0.5, out)
        for x, y in draw.uniform(-1.0, 1.0, (20, 2)):
            if (math.floor(x / CELL_M), math.floor(y / CELL_M)) not in known:
                continue
            checked += 1
            beyond = np.maximum(corners - [x, y], [x, y] - corners - CELL_M)
            expected = np.hypot(*np.maximum(beyond, 0.0).T).min()
            edge = np.maximum(out[:count] - [x, y], [x, y] - out[:count] - CELL_M)
            found = np.hypot(*np.maximum(edge, 0.0).T).min()
            assert found == pytest.approx(expected, abs=1e-12)
    assert checked > 200


def test_an_edge_that_is_longer_than_the_list_is_counted_all_the_same():
    space = make_free_space(60, CELL_M, 1, 2)
    clear_disc(space, 0.0, 0.0, 1.0, 1.0)
    short, whole = np.full((5, 2), np.nan), np.empty((4000, 2))
    count = edge_cells(space, 0.0, 0.0, 1.2, 0.5, whole)
    assert edge_cells(space, 0.0, 0.0, 1.2, 0.5, short) == count > 5
    np.testing.assert_array_equal(short, whole[:5])


@pytest.mark.parametrize("pulse_m", [0.0, 1.45e-4])
@pytest.mark.parametrize("error", [0.0, 1e-3, 0.01, 0.1])
@pytest.mark.parametrize("distance", [0.1, 1.0, 3.0])
def test_a_place_lasts_as_long_as_its_error_is_small_enough(error, distance, pulse_m):
    """The way at which the largest error is what is allowed, found by bisection."""
    allowed = PlaceError(error, pulse_m, 0.41, allowed_m=0.03)

    def excess(way: float) -> float:
        by_wheels = error * way + 2.0 * error * way / 0.41 * (distance + way)
        by_pulses = pulse_m * (way + distance) / 0.41 + pulse_m
        assert place_error(distance, way, allowed) == pytest.approx(
            by_wheels + by_pulses, rel=1e-12
        )
        return by_wheels + by_pulses - 0.03

    found = lasting(distance, allowed)
    if error == pulse_m == 0.0:
        assert found == math.inf
    else:
        expected = brentq(excess, 0.0, 200.0, xtol=1e-13)
        assert found == pytest.approx(expected, rel=1e-9)


def test_what_is_known_too_badly_from_the_start_does_not_last():
    assert lasting(2.0, PlaceError(0.0, 1.45e-4, 0.41, allowed_m=8e-4)) == -math.inf


def test_cells_count_as_long_as_their_distance_from_the_axle_allows():
    sensors = sensors_of("the papers' three")
    sectors = sensor_sectors(sensors, CONTROL_POINT_M)
    space = make_free_space(160, CELL_M, 3, 17)
    error = PlaceError(0.01, 0.0, 0.41, allowed_m=0.03)
    space.rolled_m[0] = 5.0
    readings = exact([[2.0, np.inf]] * 3)
    for tick in range(4):
        see(space, tick, np.zeros(3), sectors, readings, error)
    for i, j in free_cells(space):
        far = math.hypot((i + 0.5) * CELL_M, (j + 0.5) * CELL_M)
        until = 5.0 + lasting(far, error)
        assert space.free_until[i % 160, j % 160] <= until + 1e-12
        later = 5.0 + lasting(far + 2.0 * CONTROL_POINT_M, error)
        assert space.free_until[i % 160, j % 160] >= later - 1e-12


def test_where_a_view_ends():
    space = make_free_space(10, CELL_M, 2, 5)
    end_view(space.ends[1], 3.0, (1.0, 2.0, 0.5), (0.2, 0.1), (0.3, 0.25), 1.7)
    c, s = math.cos(0.5), math.sin(0.5)
    sensor = 1.0 + 0.2 * c - 0.1 * s, 2.0 + 0.2 * s + 0.1 * c
    expected = [
        (sensor[0] + 1.7 * math.cos(angle), sensor[1] + 1.7 * math.sin(angle))
        for angle in (0.55, 0.675, 0.8, 0.925, 1.05)
    ]
    np.testing.assert_allclose(view_arcs(space, 2)[1], expected, atol=1e-12)
    assert space.ends[1, 5] == 3.0
    assert space.ends[0, 5] == NEVER
